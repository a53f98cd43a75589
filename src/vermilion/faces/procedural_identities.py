"""What differs between generated people: smooth displacement modes at one standard deviation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vermilion.faces.procedural_fields import Fields
from vermilion.faces.procedural_head import bump, smoothstep

Mode = Callable[[np.ndarray], np.ndarray]


def _front(point: np.ndarray) -> np.ndarray:
    return smoothstep(-30.0, 40.0, point[:, 2])


def _stack(point: np.ndarray, dx=0.0, dy=0.0, dz=0.0) -> np.ndarray:
    return np.stack(np.broadcast_arrays(dx, dy, dz, point[:, 0])[:3], axis=-1)


def face_length(p: np.ndarray) -> np.ndarray:
    """A longer lower face: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    return _stack(p, dy=-4.0 * smoothstep(5.0, -80.0, p[:, 1]) * _front(p))


def jaw_width(p: np.ndarray) -> np.ndarray:
    """A wider jaw: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    low = smoothstep(0.0, -55.0, p[:, 1]) * (1 - smoothstep(-85.0, -115.0, p[:, 1]))
    return _stack(p, dx=0.065 * p[:, 0] * low)


def mouth_width(p: np.ndarray) -> np.ndarray:
    """A wider mouth: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    return _stack(p, dx=0.085 * p[:, 0] * bump(p[:, 0], p[:, 1], 0, -39, 30, 18) * _front(p))


def nose_length(p: np.ndarray) -> np.ndarray:
    """A longer nose: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    tip = bump(p[:, 0], p[:, 1], 0, -9, 14, 8) * _front(p)
    return _stack(p, dy=-1.8 * tip, dz=1.4 * tip)


def nose_width(p: np.ndarray) -> np.ndarray:
    """A wider nose: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    return _stack(p, dx=0.15 * p[:, 0] * bump(p[:, 0], p[:, 1], 0, -9, 17, 11) * _front(p))


def nose_bridge(p: np.ndarray) -> np.ndarray:
    """A higher bridge of the nose: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    return _stack(p, dz=2.0 * bump(p[:, 0], p[:, 1], 0, 14, 8, 14) * _front(p))


def chin(p: np.ndarray) -> np.ndarray:
    """A more prominent chin: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    return _stack(p, dz=2.6 * bump(p[:, 0], p[:, 1], 0, -74, 20, 12) * _front(p))


def cheeks(p: np.ndarray) -> np.ndarray:
    """Fuller cheeks: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    full = bump(np.abs(p[:, 0]), p[:, 1], 46, -24, 15, 20) * _front(p)
    return _stack(p, dx=1.8 * np.sign(p[:, 0]) * full, dz=2.2 * full)


def eye_spacing(p: np.ndarray) -> np.ndarray:
    """Eyes further apart: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    band = np.exp(-0.5 * ((p[:, 1] - 28.0) / 22.0) ** 2) * _front(p)
    return _stack(p, dx=1.5 * np.tanh(p[:, 0] / 18.0) * band)


def brow(p: np.ndarray) -> np.ndarray:
    """A stronger brow ridge: points `p` (N, 3) mm -> displacements (N, 3) mm."""
    return _stack(p, dz=1.5 * bump(np.abs(p[:, 0]), p[:, 1], 22, 48, 20, 8) * _front(p))


_SHAPE_MODES: dict[str, Mode] = {
    mode.__name__: mode
    for mode in (
        face_length, jaw_width, mouth_width, nose_length, nose_width, chin, cheeks, eye_spacing,
        nose_bridge, brow,
    )
}  # fmt: skip

#: Order of the modes: what shapes lips and lower face most comes first.
IDENTITY_NAMES = (
    "face_length", "mouth_width", "lip_upper", "lip_lower", "jaw_width", "nose_length",
    "nose_width", "cheeks", "eye_spacing", "chin", "nose_bridge", "brow",
)  # fmt: skip


def _lip_fullness(f: Fields, lip: np.ndarray, sign: float) -> np.ndarray:
    """Border away from the meeting line, and a fuller bulge; the meeting line stays."""
    s = np.clip(f.mesh.s, 0.0, 1.0)
    fade = np.clip(1.0 - (f.mesh.distance_mm / 16.0) ** 2, 0, 1) ** 3 * (f.mesh.s < 1.0)
    weight = f.carried(lip) * fade
    rise, bulge = 1.1 * (1 - s) ** 1.5, 0.7 * np.sin(np.pi * s) ** 2 + 0.3 * (1 - s)
    return _stack(f.mesh.point_mm, dy=sign * rise * weight, dz=bulge * weight)


def identities(f: Fields, count: int) -> np.ndarray:
    """Displacements (I, V, 3) mm of the first `count` modes over a head mesh."""
    modes = []
    for name in IDENTITY_NAMES[:count]:
        if name in _SHAPE_MODES:
            modes.append(_SHAPE_MODES[name](f.mesh.point_mm))
        elif name == "lip_upper":
            modes.append(_lip_fullness(f, f.widened(f.upper), 1.0))
        else:
            modes.append(_lip_fullness(f, f.widened(f.lower), -1.0))
    return np.array(modes).reshape(-1, len(f.mesh.s), 3)


def rigid_identities(centre_mm: np.ndarray, count: int) -> np.ndarray:
    """Shifts (I, 3) mm of a rigid part (eyeball, teeth) that lies at `centre_mm` (3,)."""
    at = np.asarray(centre_mm, dtype=float)[None]
    zero = np.zeros(3)
    return np.array(
        [_SHAPE_MODES[n](at)[0] if n in _SHAPE_MODES else zero for n in IDENTITY_NAMES[:count]]
    ).reshape(-1, 3)


def asymmetry(point: np.ndarray, seed: int, amplitude_mm: float = 0.5) -> np.ndarray:
    """A smooth random asymmetry (V, 3) mm of points `point` (V, 3) mm, as every face has."""
    rng = np.random.default_rng(seed)
    result = np.zeros_like(point)
    for _ in range(8):
        x0, y0 = rng.uniform(-55, 55), rng.uniform(-70, 60)
        move = rng.normal(size=3) * amplitude_mm
        result += (bump(point[:, 0], point[:, 1], x0, y0, 26, 26) * _front(point))[:, None] * move
    return result
