"""The lips of the generated head: outline, rounded cross-section, inner fold and mouth socket.

A point of the mouth has the loop parameter theta (0 at the subject's left corner, pi/2 at the
cupid's bow, pi at the right corner; equal steps are equal lengths of the vermilion border) and a
depth s: 0 on the vermilion border, 1 where the lips meet, 2 at the end of the inner fold, 3 at the
bottom of the socket.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from vermilion.faces.procedural_head import chart_at, skin_point, smoothstep
from vermilion.geometry.polylines import lengths_along

HALF_WIDTH_MM = 26.0
STOMION_Y_MM = -39.0
REST_GAP_MM = 0.3  # between the lips of the neutral, where they meet

# Height of the vermilion border over the line where the lips meet, along |x| / half width.
_UPPER = [(0, 7.4), (0.1, 7.8), (0.25, 8.7), (0.4, 7.9), (0.6, 5.7), (0.8, 3.0), (0.93, 1.05)]
_LOWER = [(0, 9.4), (0.2, 9.25), (0.4, 8.3), (0.6, 6.3), (0.8, 3.5), (0.93, 1.25)]

# Cross-section at the middle: depth s, height as a share of the border's, forward of the meeting
# line (mm, tapers to the corners), and how far the corner of this ring lies inward in x (mm).
_SECTION_UPPER = [
    (0.0, 1.00, 0.0, 0.0), (0.25, 0.77, 1.3, 0.35), (0.5, 0.48, 2.7, 0.8), (0.75, 0.18, 2.5, 1.3),
    (1.0, 0.0, 0.0, 1.8), (1.3, 0.12, -3.4, 1.6), (1.65, 0.38, -6.2, 1.0), (2.0, 0.72, -8.4, 0.2),
]  # fmt: skip
_SECTION_LOWER = [
    (0.0, 1.00, 0.0, 0.0), (0.25, 0.78, 1.6, 0.35), (0.5, 0.48, 3.1, 0.8), (0.75, 0.17, 2.7, 1.3),
    (1.0, 0.0, 0.0, 1.8), (1.3, 0.12, -3.4, 1.6), (1.65, 0.36, -6.2, 1.0), (2.0, 0.66, -8.4, 0.2),
]  # fmt: skip
_CORNER_MEETING_MM = -2.0  # z of the meeting line behind the border, at the corners
_CORNER_FOLD = CubicSpline([1.0, 1.3, 2.0], [0.0, -1.4, -5.0])  # and of the fold behind that


def _even(table: list[tuple[float, float]]) -> PchipInterpolator:
    x, y = np.array(table).T
    x, y = np.append(x, 1.0), np.append(y, 0.0)
    return PchipInterpolator(np.concatenate([-x[:0:-1], x]), np.concatenate([y[:0:-1], y]))


_UPPER_AT, _LOWER_AT = _even(_UPPER), _even(_LOWER)


def lip_line_y(u: np.ndarray) -> np.ndarray:
    """Height (N,) mm of the line where the lips meet; `u` (N,) is x / half width."""
    tubercle = -0.7 * np.exp(-((u / 0.22) ** 2)) + 0.35 * np.exp(-(((np.abs(u) - 0.45) / 0.2) ** 2))
    return STOMION_Y_MM + tubercle - 1.1 * np.abs(u) ** 3


def border_height(u: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Distance in y, (N,) mm, of the vermilion border from the line where the lips meet.

    `u` (N,) is x / half width; `upper` (N,) bool, which lip.
    """
    return np.where(upper, _UPPER_AT(u), _LOWER_AT(u))


def _border_xy(u: np.ndarray, upper: np.ndarray) -> np.ndarray:
    sign = np.where(upper, 1.0, -1.0)
    return np.stack([HALF_WIDTH_MM * u, lip_line_y(u) + sign * border_height(u, upper)], axis=-1)


class LipLoop:
    """Position along the lips: theta -> u = x / half width, by equal lengths of each lip's border."""

    def __init__(self) -> None:
        # Cosine spacing, as the border turns fastest at the corners.
        phase = np.linspace(0.0, np.pi, 801)
        u = np.cos(phase)
        self._tables = []
        self.length_mm = 0.0
        for upper in (True, False):
            xy = _border_xy(u, np.full(len(u), upper))
            length = lengths_along(xy)
            self._tables.append(PchipInterpolator(length / length[-1], u))
            self.length_mm += float(length[-1])

    def u(self, theta: np.ndarray) -> np.ndarray:
        """x / half width, (N,), at loop parameters `theta` (N,)."""
        turn = np.mod(theta, 2 * np.pi)
        upper = self._tables[0](np.clip(turn / np.pi, 0, 1))
        lower = self._tables[1](np.clip(2.0 - turn / np.pi, 0, 1))
        return np.where(turn <= np.pi, upper, lower)


LIP_LOOP = LipLoop()


def is_upper(theta: np.ndarray) -> np.ndarray:
    """Whether loop parameters `theta` (N,) lie on the upper lip, corners included, (N,) bool."""
    return np.mod(theta, 2 * np.pi) <= np.pi + 1e-12


def taper(u: np.ndarray) -> np.ndarray:
    """1 at the middle of the mouth, 0 at the corners, (N,); `u` (N,) is x / half width."""
    return np.clip(1.0 - np.abs(u) ** 2.6, 0.0, 1.0)


def border_xy(theta: np.ndarray) -> np.ndarray:
    """Frontal position (N, 2) mm of the vermilion border at loop parameters `theta` (N,)."""
    return _border_xy(LIP_LOOP.u(theta), is_upper(theta))


def border_chart(theta: np.ndarray) -> np.ndarray:
    """Chart position (N,) complex of the vermilion border at loop parameters `theta` (N,)."""
    return chart_at(border_xy(theta))


def lip_point(theta: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Surface of vermilion and inner fold: `theta` (N,), `s` (N,) in [0, 2] -> (N, 3) mm."""
    return lip_surface(theta, s[None])[0]


def lip_surface(theta: np.ndarray, s: np.ndarray) -> np.ndarray:
    """As `lip_point`, several depths over the same places: `theta` (N,), `s` (R, N) -> (R, N, 3) mm."""
    u, upper = LIP_LOOP.u(theta), is_upper(theta)
    sign = np.where(upper, 1.0, -1.0)
    middle = taper(u)
    sections = [_section(table, s) for table in (_SECTION_UPPER, _SECTION_LOWER)]
    share, forward, inward = (np.where(upper, a, b) for a, b in zip(*sections, strict=True))
    # The fold has some height at the corners too, where the vermilion has none.
    behind = np.clip(s - 1.0, 0.0, 1.0)
    height = border_height(u, upper) + 2.5 * behind * (1 - middle)
    gap = 0.5 * REST_GAP_MM * middle * np.clip(s / 0.75, 0.0, 1.0) ** 2
    y = lip_line_y(u) + sign * (share * height + gap)
    borders = [_border_xy(u, upper), _border_xy(u, np.ones(len(u), dtype=bool))]
    border_z, upper_z = skin_point(chart_at(np.concatenate(borders)))[:, 2].reshape(2, -1)
    meeting_z = upper_z + _CORNER_MEETING_MM * (1 - middle)
    leaving = smoothstep(0.0, 1.0, np.clip(s, 0.0, 1.0))
    corner = np.where(s > 1.0, _CORNER_FOLD(np.maximum(s, 1.0)), 0.0)
    z = border_z + leaving * (meeting_z - border_z) + forward * middle + corner * (1 - middle)
    return np.stack([u * (HALF_WIDTH_MM - inward), y, z], axis=-1)


def _section(table: Sequence[tuple[float, ...]], s: np.ndarray) -> np.ndarray:
    rows = np.array(table)
    return np.moveaxis(CubicSpline(rows[:, 0], rows[:, 1:], bc_type="natural")(s), -1, 0)


def socket_point(theta: np.ndarray, s: np.ndarray, fold_end: np.ndarray) -> np.ndarray:
    """The surface of the mouth's socket behind the lips, (N, 3) mm.

    `theta` (N,) and `s` (N,) in [2, 3]; it joins `fold_end` (N, 3) at s = 2.
    """
    depth = s - 2.0
    ball = np.stack(
        [25.0 * np.cos(theta), STOMION_Y_MM + 15.0 * np.sin(theta), np.zeros_like(theta)], axis=-1
    )
    shrink = np.sqrt(np.clip(1.0 - np.clip((depth - 0.35) / 0.65, 0, 1) ** 2.2, 0.0, 1.0))
    front_z = 74.0 - 10.0 * np.cos(theta) ** 2
    wall = np.stack(
        [
            ball[:, 0] * shrink,
            STOMION_Y_MM + (ball[:, 1] - STOMION_Y_MM) * shrink,
            front_z + (30.0 - front_z) * np.clip((depth - 0.2) / 0.8, 0, 1),
        ],
        axis=-1,
    )
    join = np.clip(depth / 0.3, 0, 1)[:, None]
    join = join * join * (3 - 2 * join)
    return fold_end * (1 - join) + wall * join
