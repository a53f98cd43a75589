"""The skin of the generated head as one smooth function of a planar chart.

The chart is a disc (complex number w, |w| <= 1) whose centre is the mouth and whose rim is the cut
through the neck: the sphere of directions is projected stereographically from below, and a Moebius
transformation moves the mouth to the centre. Both are conformal, so rings round the mouth stay
rings on the head. Every mesh of the head, whatever its topology, samples this function.

Head frame: millimetres, x to the subject's left, y up, z out of the face. The numbers below are the
proportions of an average adult (pupils 63 mm apart, head 152 mm wide, nasion to menton 114 mm).
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

RIM_ANGLE = np.deg2rad(165.0)  # polar angle of the neck's cut, from the top of the head
MOUTH_ANGLE = np.deg2rad(112.5)
EYE_CENTRE_MM = np.array([31.5, 27.0, 63.5])  # subject's left
EYE_RADIUS_MM = 12.0
LID_RADIUS_MM = 13.2
_FRONTAL_STRETCH = 0.23  # of the azimuth, so that chart squares are squares of skin at the mouth

# Meridians: polar angle in degrees, then coordinates in millimetres.
_FRONT = np.array(  # angle, y, z at the middle of the face, without nose and lips
    [
        (0, 136, -8), (15, 133, 22), (30, 122, 50), (45, 102, 73), (60, 77, 86), (70, 58, 90),
        (78, 43, 89.5), (85, 30, 85.5), (92, 14, 84), (100, -8, 85), (107, -23, 87),
        (112.5, -38, 87.5), (117, -54, 84.5), (122, -69, 86.5), (128, -83, 82), (134, -90, 70),
        (142, -94, 51), (150, -99, 38), (158, -113, 36), (165, -130, 37),
    ],
    dtype=float,
)  # fmt: skip
_SIDE = np.array(  # angle, x, y, z at the subject's left
    [
        (0, 0, 136, -8), (15, 28, 132, -8), (30, 52, 120, -8), (45, 67, 100, -9),
        (60, 74, 76, -10), (75, 76, 48, -10), (90, 73, 18, -8), (100, 70, -6, -6),
        (110, 65.5, -28, -3), (120, 59, -48, 0), (128, 52.5, -63, 2), (135, 46, -76, -2),
        (143, 43.5, -88, -8), (152, 45, -102, -14), (165, 51, -126, -20),
    ],
    dtype=float,
)  # fmt: skip
_BACK = np.array(
    [
        (0, 136, -8), (15, 132, -38), (30, 120, -66), (45, 100, -87), (60, 76, -99),
        (75, 48, -104), (90, 18, -100), (105, -12, -90), (120, -45, -78), (135, -75, -72),
        (150, -100, -72), (165, -124, -76),
    ],
    dtype=float,
)  # fmt: skip
_ROUNDNESS = np.array(  # angle, superellipse exponent of the front half's cross-section
    [(0, 2.0), (40, 2.1), (65, 2.35), (90, 2.1), (105, 1.97), (118, 1.82), (128, 1.72), (136, 1.8), (150, 2.0),
     (165, 2.0)], dtype=float,
)  # fmt: skip
_NOSE_HEIGHT = np.array(  # y, height of the ridge over the face
    [(60, 0), (50, 0.0), (42, 0.8), (34, 3.0), (26, 7.0), (14, 13.5), (4, 18.0), (-2, 20.3),
     (-6, 21.2), (-10, 20.6), (-14, 17.4), (-18, 11.5), (-22, 6.2), (-26, 3.2), (-31, 1.2),
     (-38, 0), (-50, 0)],
    dtype=float,
)[::-1]  # fmt: skip
_NOSE_WIDTH = np.array(  # y, half width of the ridge
    [(60, 12), (42, 10.5), (34, 9.2), (24, 9.4), (12, 11.0), (0, 11.5), (-8, 11.0), (-16, 10.5),
     (-24, 8.5), (-38, 6), (-50, 6)], dtype=float,
)[::-1]  # fmt: skip


def _meridian(table: np.ndarray) -> CubicSpline:
    angle, values = np.deg2rad(table[:, 0]), table[:, 1:]
    return CubicSpline(angle, values, bc_type="natural")


_FRONT_AT, _SIDE_AT, _BACK_AT = (_meridian(t) for t in (_FRONT, _SIDE, _BACK))
_ROUNDNESS_AT = _meridian(_ROUNDNESS)
_NOSE_HEIGHT_AT = CubicSpline(_NOSE_HEIGHT[:, 0], _NOSE_HEIGHT[:, 1])
_NOSE_WIDTH_AT = CubicSpline(_NOSE_WIDTH[:, 0], _NOSE_WIDTH[:, 1])


def bump(x: np.ndarray, y: np.ndarray, x0: float, y0: float, sx: float, sy: float) -> np.ndarray:
    """Gaussian of height 1 at (x0, y0) with deviations sx, sy (mm).

    `x` and `y` (N,) mm; returns (N,).
    """
    return np.exp(-0.5 * (((x - x0) / sx) ** 2 + ((y - y0) / sy) ** 2))


def smoothstep(low: float, high: float, value: np.ndarray) -> np.ndarray:
    """0 at `low`, 1 at `high` (which may be the smaller), twice differentiable.

    `value` (...,); returns (...,).
    """
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


def smooth_max(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """Maximum of `a` (...,) and `b` (...,), its crease rounded over about `width`; (...,)."""
    return 0.5 * (a + b + np.sqrt((a - b) ** 2 + width * width))


def chart_angles(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Polar angle from the top and azimuth from the front of chart points.

    `w` (N,) complex; returns two arrays (N,) in radians.
    """
    centre = np.tan(MOUTH_ANGLE / 2) / np.tan(RIM_ANGLE / 2)
    turned = 1j * w
    z = (turned + centre) / (1 + centre * turned)
    polar = 2 * np.arctan(np.abs(z) * np.tan(RIM_ANGLE / 2))
    azimuth = np.angle(z)
    return polar, azimuth + _FRONTAL_STRETCH * np.sin(2 * azimuth)


def chart_of(polar: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Inverse of `chart_angles`: chart points (N,) complex.

    `polar` (N,) and `azimuth` (N,) in radians.
    """
    grid = np.linspace(-np.pi, np.pi, 4001)
    plain = np.interp(azimuth, grid + _FRONTAL_STRETCH * np.sin(2 * grid), grid)
    rim = np.tan(RIM_ANGLE / 2)
    centre = np.tan(MOUTH_ANGLE / 2) / rim
    z = np.tan(polar / 2) / rim * np.exp(1j * plain)
    return -1j * (z - centre) / (1 - centre * z)


def base_point(w: np.ndarray) -> np.ndarray:
    """The head without features, `w` (..., N) complex in the chart -> (..., N, 3) mm."""
    polar, azimuth = chart_angles(w)
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    exponent = 2.0 / _ROUNDNESS_AT(polar)[..., 0]
    exponent = np.where(cosine > 0, exponent, 1.0)
    # |.|^p is not smooth at 0; the tiny addition keeps derivatives finite there.
    along = (cosine**2 + 1e-6) ** (0.5 * exponent)
    across = np.sign(sine) * np.abs(sine) ** exponent
    side = _SIDE_AT(polar)
    end = np.where((cosine > 0)[..., None], _FRONT_AT(polar), _BACK_AT(polar))
    x = side[..., 0] * across
    yz = side[..., 1:] + (end - side[..., 1:]) * along[..., None]
    return np.concatenate([x[..., None], yz], axis=-1)


def _nose(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the nose in y and z (mm) over the face at |x|, y."""
    height = np.where((y > _NOSE_HEIGHT[0, 0]) & (y < _NOSE_HEIGHT[-1, 0]), _NOSE_HEIGHT_AT(y), 0.0)
    width = _NOSE_WIDTH_AT(np.clip(y, _NOSE_WIDTH[0, 0], _NOSE_WIDTH[-1, 0]))
    ridge = height * np.exp(-(((x / width) ** 2 + 1e-9) ** 1.15))
    wing = 9.5 * np.exp(-((((x - 12.5) / 5.6) ** 2 + ((y + 10.0) / 6.8) ** 2) ** 1.35))
    crease = 2.2 * bump(x, y, 19.8, -9.0, 2.4, 6.0)
    nostril = bump(x, y, 7.6, -17.2, 3.1, 2.2)
    droop = 3.6 * bump(x, y, 0.0, -10.5, 7.5, 4.5) + 3.4 * bump(x, y, 12.0, -13.0, 5.0, 3.6)
    return 4.5 * nostril - droop, smooth_max(ridge, wing, 2.5) - 1.25 - crease - 4.0 * nostril


def _face_relief(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Brows, cheeks, muzzle, chin: displacement in z (mm) at |x|, y."""
    return (
        3.2 * bump(x, y, 27, 46, 15, 6.5)  # brow ridge
        - 1.0 * bump(x, y, 0, 46, 7, 6)
        + 5.8 * bump(x, y, 47, 0, 15, 13)  # cheek bone
        + 1.8 * bump(x, y, 30, -4, 11, 9)
        - 3.2 * bump(x, y, 47, -36, 13, 15)  # hollow under the cheek bone
        - 2.0 * bump(x, y, 23, -15, 4.5, 9)  # beginning of the nasolabial fold
        + 5.6 * bump(x, y, 0, -38, 23, 15)  # muzzle
        - 1.3 * bump(x, y, 0, -23, 2.8, 6.0)  # philtrum and its columns
        + 0.7 * bump(x, y, 5.8, -24, 2.4, 7)
        - 3.0 * bump(x, y, 0, -56, 17, 4.0)  # mentolabial fold
        + 2.6 * bump(x, y, 0, -71, 13, 9)  # chin
        - 1.2 * bump(x, y, 31, -42, 5, 7)  # beside the mouth corner
        - 3.0 * bump(x, y, 66, 38, 14, 20)  # temple
    )


def skin_point(w: np.ndarray) -> np.ndarray:
    """The skin of the mean head, `w` (N,) complex in the chart -> (N, 3) mm."""
    point = base_point(w)
    x, y, z = np.abs(point[..., 0]), point[..., 1], point[..., 2]
    front = smoothstep(-5.0, 35.0, z)
    nose_y, nose_z = _nose(x, y)
    ex, ey, ez = EYE_CENTRE_MM
    socket = -11.0 * np.exp(
        -((((x - ex - 1.0) / 21.0) ** 2 + ((y - ey - 1.0) / 14.5) ** 2) ** 1.15)
    )
    socket += -3.5 * bump(x, y, 19.0, ey + 3, 5.0, 8.0)
    skin = z + front * (_face_relief(x, y) + socket)
    inside = LID_RADIUS_MM**2 - (x - ex) ** 2 - (y - ey) ** 2
    ball = ez + np.sign(inside) * np.sqrt(np.abs(inside) + 1e-9)
    near_eye = bump(x, y, ex, ey, 16, 16) > 0.05
    lids = np.where(near_eye, smooth_max(skin, ball, 3.2), skin)
    fade = front * np.exp(-((((x - ex) / 22.0) ** 2 + ((y - ey) / 19.0) ** 2) ** 3))
    point[..., 2] = skin + fade * (lids - skin) + front * nose_z
    point[..., 1] = y + front * nose_y
    return point


def chart_at(xy: np.ndarray, steps: int = 12) -> np.ndarray:
    """Chart points whose skin lies at frontal positions `xy` (N, 2) mm; front of the face only.

    Newton's method with numerical derivatives on the featureless head, which shares x, and y but
    for the tip of the nose, with the skin.
    """
    target = xy[:, 0] + 1j * xy[:, 1]
    w = np.zeros(len(xy), dtype=complex)
    delta, limit, exact = 1e-5, 0.05, 1e-10
    for _ in range(steps):
        at, right, up = base_point(np.stack([w, w + delta, w + 1j * delta]))
        fx = (right[:, 0] - at[:, 0]) / delta, (up[:, 0] - at[:, 0]) / delta
        fy = (right[:, 1] - at[:, 1]) / delta, (up[:, 1] - at[:, 1]) / delta
        residual = target - (at[:, 0] + 1j * at[:, 1])
        determinant = fx[0] * fy[1] - fx[1] * fy[0]
        step_x = (residual.real * fy[1] - residual.imag * fx[1]) / determinant
        step_y = (residual.imag * fx[0] - residual.real * fy[0]) / determinant
        step = step_x + 1j * step_y
        length = np.abs(step)
        w = w + step * np.minimum(1.0, limit / np.maximum(length, 1e-12))
        if (length < exact).all():  # another step would be shorter by four digits at least
            break
    return w


def chart_scale_mm() -> float:
    """Millimetres of skin a unit of chart, at the mouth."""
    ends = base_point(np.array([-1e-3, 1e-3], dtype=complex))
    return float(np.linalg.norm(ends[1] - ends[0]) / 2e-3)
