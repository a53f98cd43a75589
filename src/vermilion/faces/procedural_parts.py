"""Eyeballs and teeth of the generated head: closed surfaces of their own."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vermilion.faces.procedural_head import EYE_CENTRE_MM, EYE_RADIUS_MM
from vermilion.faces.procedural_layout import strip_triangles
from vermilion.faces.procedural_mouth import STOMION_Y_MM


@dataclass(frozen=True)
class Part:
    """A closed surface: point_mm (V, 3), triangles (T, 3), uv (V, 2)."""

    point_mm: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray


def eyeball(side: float, rings: int = 18, around: int = 28) -> Part:
    """A sphere with a slight cornea; `side` +1 for the subject's left. Iris faces +z."""
    angle = np.pi * (np.linspace(0, 1, rings + 1) ** 1.35)[1:-1]
    turn = np.arange(around) * (2 * np.pi / around)
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    unit = np.stack(
        [sine * np.cos(turn), sine * np.sin(turn), np.broadcast_to(cosine, (len(angle), around))],
        axis=-1,
    ).reshape(-1, 3)
    unit = np.concatenate([unit, [[0, 0, 1.0], [0, 0, -1.0]]])
    off_axis = EYE_RADIUS_MM * np.hypot(unit[:, 0], unit[:, 1])
    cornea = 0.5 * np.exp(-((off_axis / 4.5) ** 4)) * (unit[:, 2] > 0)
    centre = EYE_CENTRE_MM * np.array([side, 1.0, 1.0])
    point = centre + unit * (EYE_RADIUS_MM + cornea)[:, None]
    ids = np.arange(len(angle) * around).reshape(len(angle), around)
    front, back = len(ids) * around, len(ids) * around + 1
    # Rings run counter-clockwise seen from the front, each later one behind.
    body = strip_triangles(list(ids[::-1]))
    caps = np.concatenate([_fan(ids[0], front), _fan(ids[-1][::-1], back)])
    radius = np.arccos(np.clip(unit[:, 2], -1, 1)) / np.pi
    direction = unit[:, :2] / np.maximum(np.hypot(unit[:, 0], unit[:, 1]), 1e-9)[:, None]
    uv = np.array([0.5 + 0.43 * side, 0.93]) + 0.065 * radius[:, None] * direction
    return Part(point, np.concatenate([body, caps]).astype(np.int32), uv)


def _fan(ring: np.ndarray, centre: int) -> np.ndarray:
    return np.stack([ring, np.roll(ring, -1), np.full(len(ring), centre)], axis=-1)


# Cross-section of a tooth row: (share of the height from the edge to the root, backward mm).
_TOOTH_SECTION = np.array(
    [(0.02, 0.9), (0.0, 1.6), (0.02, 2.4), (0.4, 4.6), (0.8, 6.2), (1.0, 5.0), (1.0, 2.0),
     (0.8, 0.75), (0.55, 0.1), (0.3, 0.0), (0.1, 0.35)]
)  # fmt: skip


def tooth_row(upper: bool, samples_per_tooth: int = 7) -> Part:
    """One arch of fourteen teeth as a closed ribbon, notched between neighbours."""
    widths = np.array([8.4, 6.6, 7.6, 7.0, 6.8, 9.5, 9.0]) * (1.0 if upper else 0.86)
    widths[0] *= 1.0 if upper else 0.75
    joints = np.concatenate([[0.0], np.cumsum(widths)])
    joints = np.concatenate([-joints[:0:-1], joints])
    fine = np.linspace(0, 1, samples_per_tooth + 1)[:-1]
    length = np.concatenate([a + (b - a) * fine for a, b in pairwise(joints)])
    length = np.append(length, joints[-1])
    tooth = np.concatenate([np.tile(fine, len(joints) - 1), [0.0]])
    notch = np.abs(2 * tooth - 1) ** 6
    arch, normal = _arch(length, half_width=26.0 if upper else 23.5, depth=42.0)
    front_z = 82.0 if upper else 79.8
    edge_y = STOMION_Y_MM - 1.6 if upper else STOMION_Y_MM - 2.4
    sign, height = (1.0, 12.0) if upper else (-1.0, 11.0)
    back_teeth = np.clip(np.abs(length) / 30.0, 0, 1) ** 2
    share, backward = _TOOTH_SECTION[:, 0], _TOOTH_SECTION[:, 1]
    inset = backward[None] + 0.9 * notch[:, None] * (backward < 1.0)[None]
    lift = share[None] * height + 0.9 * notch[:, None] * (1 - share)[None] ** 3
    lift = lift + 1.2 * back_teeth[:, None] * (1 - share)[None]
    point = np.empty((len(length), len(share), 3))
    point[..., 0] = arch[:, None, 0] - normal[:, None, 0] * inset
    point[..., 1] = edge_y + sign * lift
    point[..., 2] = front_z + arch[:, None, 1] - normal[:, None, 1] * inset
    ids = np.arange(point.shape[0] * point.shape[1]).reshape(point.shape[:2])
    flat = point.reshape(-1, 3)
    ends = np.stack([point[0].mean(axis=0), point[-1].mean(axis=0)])
    body = strip_triangles(list(ids))
    caps = np.concatenate([_fan(ids[0][::-1], len(flat)), _fan(ids[-1], len(flat) + 1)])
    triangles = np.concatenate([body, caps]).astype(np.int32)
    if _volume(np.concatenate([flat, ends]), triangles) < 0:
        triangles = triangles[:, [0, 2, 1]]
    ring = np.linspace(0, 1, len(share), endpoint=False)
    u = (length - length[0]) / (length[-1] - length[0])
    uv = np.stack(np.broadcast_arrays(u[:, None], ring[None]), axis=-1).reshape(-1, 2)
    uv = np.concatenate([uv, [[0.0, 0.5], [1.0, 0.5]]])
    corner = np.array([0.01 if upper else 0.86, 0.01])
    return Part(np.concatenate([flat, ends]), triangles, corner + uv * np.array([0.13, 0.10]))


def _arch(length: np.ndarray, half_width: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """A parabola-like dental arch by arc length: (x, z) from the front tooth, and unit normals."""
    phase = np.linspace(-np.pi / 2, np.pi / 2, 2001)
    curve = np.stack([half_width * np.sin(phase), depth * (np.cos(phase) ** 0.85 - 1.0)], axis=-1)
    step = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    along = np.concatenate([[0], np.cumsum(step)])
    along -= along[len(along) // 2]
    at = np.stack([np.interp(length, along, curve[:, k]) for k in range(2)], axis=-1)
    tangent = np.gradient(curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
    return at, np.stack([np.interp(length, along, normal[:, k]) for k in range(2)], axis=-1)


def _volume(point: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (point[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)
