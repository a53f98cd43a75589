"""Building blocks of the generated head's expressions: curves along the lips, rolls, jaw, lids.

An expression gives the lips a displacement curve D(theta); skin near the mouth follows by the
mesh's `spread` weights and fades with the distance from the vermilion border.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vermilion.faces.procedural_head import EYE_CENTRE_MM, bump, smoothstep
from vermilion.faces.procedural_head_mesh import N_LOOP, HeadMesh, loop_theta
from vermilion.faces.procedural_layout import lid_margin_xy
from vermilion.faces.procedural_mouth import (
    LIP_LOOP,
    border_height,
    is_upper,
    lip_line_y,
    lip_point,
)

JAW_HINGE_MM = np.array([0.0, 4.0, -4.0])
JAW_AT_CORNERS = 0.40  # share of the jaw's motion that the mouth corners follow
JAW_OPEN_RAD = np.deg2rad(16.5)


@dataclass(frozen=True)
class Fields:
    """Displacement fields over one head mesh; all (V, 3) mm in the head frame."""

    mesh: HeadMesh

    # -- the lips' loop -------------------------------------------------------------------------

    @cached_property
    def u(self) -> np.ndarray:
        """(N_LOOP,) x over the mouth's half width: 1 at the subject's left corner."""
        return LIP_LOOP.u(loop_theta())

    @cached_property
    def upper(self) -> np.ndarray:
        """(N_LOOP,) weight of the upper lip: 1 at its middle, 0 at the corners and below."""
        return np.where(is_upper(loop_theta()), 1.0, 0.0) * self.middle

    @cached_property
    def lower(self) -> np.ndarray:
        """(N_LOOP,) weight of the lower lip."""
        return np.where(is_upper(loop_theta()), 0.0, 1.0) * self.middle

    @cached_property
    def middle(self) -> np.ndarray:
        """(N_LOOP,) 1 at the middle of either lip, 0 at the corners, as an opening mouth parts."""
        return np.clip(1.0 - self.u**2, 0.0, 1.0) ** 0.8

    def widened(self, lip: np.ndarray) -> np.ndarray:
        """The whole of a lip, (N_LOOP,), given its weights `lip` (N_LOOP,), `upper` or `lower`."""
        return np.where(lip > 0, 1.0 - np.abs(self.u) ** 4, 0.0)

    def corner(self, side: float) -> np.ndarray:
        """(N_LOOP,) 1 at the corner of one side (+1: subject's left), fading over that half."""
        return smoothstep(0.05, 1.0, np.clip(side * self.u, 0, 1)) * 0.75 + 0.25 * np.clip(
            side * self.u, 0, 1
        )

    def half(self, side: float) -> np.ndarray:
        """(N_LOOP,) smooth share of one side of the mouth; both sides add to 1."""
        return 0.5 * (1.0 + np.tanh(side * self.u / 0.35) / np.tanh(1 / 0.35))

    # -- fields -----------------------------------------------------------------------------------

    @cached_property
    def _x(self) -> np.ndarray:
        return self.mesh.point_mm[:, 0]

    @cached_property
    def _y(self) -> np.ndarray:
        return self.mesh.point_mm[:, 1]

    @cached_property
    def _inside(self) -> np.ndarray:
        """(V,) 1 to the end of the inner fold, 0 deep in the socket."""
        return 1.0 - smoothstep(1.9, 2.7, self.mesh.s)

    @cached_property
    def _nose(self) -> np.ndarray:
        """(V,) how firmly the nose holds the skin: 1 on its bone, less at its base."""
        upward = smoothstep(-27.0, -8.0, self._y)
        return 0.9 * upward * bump(self._x, np.minimum(self._y, 20), 0, 0, 19, 40)

    def fade(self, reach_mm: float) -> np.ndarray:
        """(V,) 1 on the lips, falling to 0 at `reach_mm` of skin; less on the nose and neck."""
        share = np.clip(1.0 - (self.mesh.distance_mm / reach_mm) ** 2, 0.0, 1.0) ** 2
        neck = 1.0 - smoothstep(np.deg2rad(132), np.deg2rad(150), self.mesh.polar)
        return share * self._inside * (1.0 - self._nose) * neck

    def carried(self, curve: np.ndarray) -> np.ndarray:
        """A curve along the lips (N_LOOP,) or (N_LOOP, 3) at every vertex."""
        return self.mesh.spread @ curve

    def lips(
        self,
        dx: np.ndarray | float,
        dy: np.ndarray | float,
        dz: np.ndarray | float,
        reach_mm: float = 38.0,
    ) -> np.ndarray:
        """Move the lips by curves, and the skin after them, (V, 3) mm.

        `dx` (N_LOOP,), `dy` (N_LOOP,) and `dz` (N_LOOP,) mm along the lips' loop; a number holds for
        all of it.
        """
        curve = np.stack(np.broadcast_arrays(dx, dy, dz, self.u)[:3], axis=-1)
        return self.carried(curve) * self.fade(reach_mm)[:, None]

    def roll(self, angle_rad: np.ndarray, reach_mm: float = 11.0) -> np.ndarray:
        """Turn each cross-section of the lips about an axis within the lip, (V, 3) mm.

        `angle_rad` (N_LOOP,); positive turns the red inwards on both lips.
        """
        axis, direction = self._roll_axes
        fade = np.clip(1.0 - (self.mesh.distance_mm / reach_mm) ** 2, 0, 1) ** 3
        angle = -self.carried(angle_rad) * fade * (1.0 - smoothstep(1.15, 2.1, self.mesh.s))
        arm = self.mesh.point_mm - axis
        along = (arm * direction).sum(axis=1, keepdims=True) * direction
        across = arm - along
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return across * (cosine - 1.0) + np.cross(direction, across) * sine

    @cached_property
    def _roll_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """A point (V, 3) mm and the direction (V, 3) of each vertex's axis of rolling."""
        theta = loop_theta()
        step = 1e-3
        ahead, behind = (self._axis(theta + d) for d in (step, -step))
        tangent = ahead - behind
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        axis, direction = self.carried(self._axis(theta)), self.carried(tangent)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True) + 1e-12
        return axis, direction

    @cached_property
    def _meeting(self) -> np.ndarray:
        """(V, 3) mm: where the lips meet, carried to every vertex."""
        return self.carried(lip_point(loop_theta(), np.ones(N_LOOP)))

    @staticmethod
    def _axis(theta: np.ndarray) -> np.ndarray:
        """Axis of rolling, (N, 3): within the lip, half its height from the meeting line."""
        meeting = lip_point(theta, np.ones(len(theta)))
        u = LIP_LOOP.u(theta)
        sign = np.where(is_upper(theta), 1.0, -1.0)
        meeting[:, 1] = lip_line_y(u) + sign * 0.45 * border_height(u, is_upper(theta))
        meeting[:, 2] -= 1.0
        return meeting

    def thin(self, share: np.ndarray, reach_mm: float = 9.0) -> np.ndarray:
        """Draw the lips together towards the line where they meet, (V, 3) mm.

        `share` (N_LOOP,) of the way, along the lips' loop.
        """
        fade = np.clip(1.0 - (self.mesh.distance_mm / reach_mm) ** 2, 0, 1) ** 3 * self._inside
        inside = 1.0 - smoothstep(1.0, 1.6, self.mesh.s)
        arm = (self._meeting - self.mesh.point_mm) * np.array([0.0, 1.0, 0.8])
        limit = np.clip(10.0 / (np.linalg.norm(arm, axis=1) + 1e-9), 0, 1)
        return arm * (self.carried(share) * fade * inside * limit)[:, None]

    def bumped(
        self, x0: float, y0: float, sx: float, sy: float, move: tuple[float, float, float]
    ) -> np.ndarray:
        """Move the front of the face by `move` under a Gaussian at (x0, y0)."""
        front = smoothstep(0.0, 35.0, self.mesh.point_mm[:, 2])
        off_lips = smoothstep(1.0, 16.0, self.mesh.distance_mm)
        weight = bump(self._x, self._y, x0, y0, sx, sy) * front * off_lips
        weight = weight * np.clip(weight - 0.004, 0, 1) / np.maximum(weight, 1e-9)
        return weight[:, None] * np.asarray(move)

    # -- jaw --------------------------------------------------------------------------------------

    @cached_property
    def jaw_loop(self) -> np.ndarray:
        """(N_LOOP,) how far the lips go with the jaw bone."""
        closed, rest = JAW_AT_CORNERS * (1 - self.middle), 1.0 - JAW_AT_CORNERS
        return np.where(is_upper(loop_theta()), closed, JAW_AT_CORNERS + rest * self.middle)

    @cached_property
    def jaw_weight(self) -> np.ndarray:
        """(V,) how far each vertex goes with the jaw bone."""
        z = self.mesh.point_mm[:, 2]
        body = smoothstep(-14.0, -66.0, self._y) * smoothstep(-25.0, 30.0, z)
        neck = 1.0 - smoothstep(np.deg2rad(131), np.deg2rad(152), self.mesh.polar)
        near = np.clip(1.0 - (self.mesh.distance_mm / 42.0) ** 2, 0, 1) ** 2
        near = near * (1.0 - self._nose)
        return near * self.carried(self.jaw_loop) + (1.0 - near) * body * neck

    def jaw(self, open_rad: float = 0.0, shift_mm: tuple[float, float, float] = (0, 0, 0)):
        """Turn the jaw about its hinge and shift it, (V, 3) mm."""
        return self.jaw_weight[:, None] * jaw_motion(self.mesh.point_mm, open_rad, shift_mm)

    # -- lids -------------------------------------------------------------------------------------

    def lids(self, side: float, closing: float) -> np.ndarray:
        """Turn both lids of an eye about the eyeball, (V, 3) mm.

        They meet at `closing` 1; a negative value widens the eye.
        """
        centre = EYE_CENTRE_MM * np.array([side, 1, 1])
        x, y, z = self.mesh.point_mm.T
        t = np.clip((side * x - EYE_CENTRE_MM[0] - 0.3) / 13.6, -1, 1)
        phase = np.arccos(t)
        top, bottom = lid_margin_xy(phase)[:, 1], lid_margin_xy(-phase)[:, 1]
        meet = bottom + 0.22 * (top - bottom)
        above, below = np.clip(y - top, 0, None), np.clip(bottom - y, 0, None)
        weight_top = 1.0 - smoothstep(0.0, 11.0, above)
        weight_bottom = 1.0 - smoothstep(0.0, 9.0, below)
        is_top = y > 0.5 * (top + bottom)
        move = np.where(is_top, weight_top * (meet - top), weight_bottom * (meet - bottom))
        move = move * closing * (np.abs(side * x - centre[0] * side) < 18) * (z > 40)
        radius = np.hypot(y - centre[1], z - centre[2])
        limit = np.clip((y + move - centre[1]) / np.maximum(radius, 1e-9), -0.98, 0.98)
        turned = centre[2] + radius * np.sqrt(1 - limit**2)
        before = centre[2] + radius * np.sqrt(
            1 - np.clip((y - centre[1]) / np.maximum(radius, 1e-9), -0.98, 0.98) ** 2
        )
        return np.stack([np.zeros_like(x), move, turned - before], axis=-1)


def jaw_motion(
    point: np.ndarray, open_rad: float, shift_mm: tuple[float, float, float]
) -> np.ndarray:
    """Displacement (V, 3) mm of the jaw bone: a turn about the hinge, sliding forward as it opens.

    `point` (V, 3) mm in the head frame.
    """
    arm = point - JAW_HINGE_MM
    cosine, sine = np.cos(open_rad), np.sin(open_rad)
    turned = np.stack(
        [arm[:, 0], arm[:, 1] * cosine - arm[:, 2] * sine, arm[:, 1] * sine + arm[:, 2] * cosine],
        axis=-1,
    )
    slide = np.array([0.0, 0.0, 5.0 * open_rad / JAW_OPEN_RAD])
    return turned - arm + slide + np.asarray(shift_mm, dtype=float)
