"""Landmarks and regions of the generated head."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import REGIONS
from vermilion.faces.procedural_head_mesh import HeadMesh
from vermilion.faces.procedural_mouth import LIP_LOOP, is_upper

_OUTER_U = {48: -0.62, 49: -0.25, 50: 0.0, 51: 0.25, 52: 0.62}
_OUTER_LOWER_U = {53: 0.62, 54: 0.28, 55: 0.0, 56: -0.28, 57: -0.62}
_INNER_U = {59: -0.5, 60: 0.0, 61: 0.5}
_INNER_LOWER_U = {63: 0.5, 64: 0.0, 65: -0.5}


def landmarks(mesh: HeadMesh) -> np.ndarray:
    """Vertex of each of the 66 landmarks, (66,) int32."""
    ids = np.zeros(66, dtype=np.int32)
    ids[list(mesh.anchors)] = list(mesh.anchors.values())
    left, right = mesh.eyes
    turn = len(left)
    at = {name: round(turn * share) % turn for name, share in _EYE_SHARES.items()}
    for k, name in enumerate(("outer", "up_out", "up_in", "inner", "low_in", "low_out")):
        ids[36 + k] = right[at[name]]
    for k, name in enumerate(("inner", "up_in", "up_out", "outer", "low_out", "low_in")):
        ids[42 + k] = left[at[name]]
    n = len(mesh.border)
    theta = np.arange(n) * (2 * np.pi / n)
    ids[62], ids[58] = mesh.border[0], mesh.border[n // 2]
    for table, ring, upper in (
        (_OUTER_U, mesh.border, True), (_OUTER_LOWER_U, mesh.border, False),
        (_INNER_U, mesh.meeting, True), (_INNER_LOWER_U, mesh.meeting, False),
    ):  # fmt: skip
        u = np.where(is_upper(theta) == upper, LIP_LOOP.u(theta), np.inf)
        for k, target in table.items():
            ids[k] = ring[np.argmin(np.abs(u - target))]
    return ids


_EYE_SHARES = {
    "outer": 0.0, "up_out": 1 / 6, "up_in": 1 / 3, "inner": 0.5, "low_in": 2 / 3, "low_out": 5 / 6,
}  # fmt: skip


def head_regions(mesh: HeadMesh) -> dict[str, np.ndarray]:
    """The regions of the skin and the mouth, (V,) bool each; no teeth, no eyes."""
    x, y, z = np.abs(mesh.point_mm[:, 0]), mesh.point_mm[:, 1], mesh.point_mm[:, 2]
    inside = ~np.isnan(mesh.theta) & (mesh.s > 0)
    border = np.zeros(len(y), dtype=bool)
    border[mesh.border] = True
    red = (inside & (mesh.s <= 1.0)) | border
    theta = np.where(np.isnan(mesh.theta), 0.0, mesh.theta)
    u = LIP_LOOP.u(theta)
    upper = is_upper(theta) | (np.abs(u) > 1 - 1e-9)
    lower = ~is_upper(theta) | (np.abs(u) > 1 - 1e-9)
    outside = ~inside
    front = (z > 8.0) & (mesh.polar < np.deg2rad(137))
    forehead = outside & (y > 76) & (y < 116) & (z > 15)
    bridge = outside & (x < 6) & (y > 12) & (y < 29) & (z > 60)
    temples = outside & (x > 58) & (y > 22) & (y < 90) & (z > 0) & (z < 42)
    regions = {name: np.zeros(len(y), dtype=bool) for name in REGIONS}
    regions["face"] = (outside & front & (y < 112)) | red
    regions["rigid"] = forehead | bridge | temples
    regions["vermilion_upper"] = red & upper
    regions["vermilion_lower"] = red & lower
    regions["mouth_inner"] = inside & (mesh.s > 1.0)
    return regions
