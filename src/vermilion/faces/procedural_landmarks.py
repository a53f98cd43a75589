"""Landmarks and regions of the generated head."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import REGIONS
from vermilion.faces.procedural_head import (
    MOUTH_ANGLE,
    RIM_ANGLE,
    locate,
    skin_point,
)
from vermilion.faces.procedural_head_mesh import HeadMesh
from vermilion.faces.procedural_layout import nearest_ids
from vermilion.faces.procedural_mouth import LIP_LOOP, is_upper

# Jaw, subject's left from the ear to the chin: azimuth and polar angle in degrees.
_JAW = [(86, 87), (84, 96), (81, 105), (77, 114), (70, 121), (56, 125), (38, 127.5), (20, 128.5)]
_CHIN = (0.0, 129.0)
_BROW_MM = [(11, 45), (19, 49), (28, 50.5), (37, 49), (45, 44.5)]  # inner to outer
_BRIDGE_MM = [(0, 33), (0, 22), (0, 10), (0, -6)]
_NOSE_BASE_MM = [(11, -16), (6, -19), (0, -21)]
_OUTER_U = {48: -0.62, 49: -0.25, 50: 0.0, 51: 0.25, 52: 0.62}
_OUTER_LOWER_U = {53: 0.62, 54: 0.28, 55: 0.0, 56: -0.28, 57: -0.62}
_INNER_U = {59: -0.5, 60: 0.0, 61: 0.5}
_INNER_LOWER_U = {63: 0.5, 64: 0.0, 65: -0.5}


def _chart_of(azimuth_deg: np.ndarray, polar_deg: np.ndarray) -> np.ndarray:
    """Inverse of `chart_angles`."""
    rim, mouth = np.tan(RIM_ANGLE / 2), np.tan(MOUTH_ANGLE / 2) / np.tan(RIM_ANGLE / 2)
    z = np.tan(np.deg2rad(polar_deg) / 2) / rim * np.exp(1j * np.deg2rad(azimuth_deg))
    return -1j * (z - mouth) / (1 - mouth * z)


def landmark_targets() -> dict[int, np.ndarray]:
    """Positions (3,) mm on the mean head of the landmarks off the eyes and lips."""
    left = np.array(_JAW, dtype=float)
    jaw = np.concatenate([left * [-1, 1], [_CHIN], left[::-1]])
    points = {k: p for k, p in enumerate(skin_point(_chart_of(jaw[:, 0], jaw[:, 1])))}
    brow = np.array(_BROW_MM, dtype=float)
    base = np.array(_NOSE_BASE_MM, dtype=float)
    frontal = np.concatenate([brow[::-1] * [-1, 1], brow, _BRIDGE_MM, base * [-1, 1], base[1::-1]])
    return points | {17 + k: p for k, p in enumerate(skin_point(locate(frontal)))}


def landmarks(mesh: HeadMesh, skin: np.ndarray) -> np.ndarray:
    """Vertex of each of the 66 landmarks, (66,) int32; `skin` (V,) bool marks outer skin."""
    ids = np.zeros(66, dtype=np.int32)
    targets = landmark_targets()
    candidates = np.flatnonzero(skin)
    nearest = nearest_ids(mesh.point_mm[candidates], np.array(list(targets.values())))
    ids[list(targets)] = candidates[nearest]
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
    forehead = outside & (y > 72) & (y < 116) & (z > 15)
    bridge = outside & (x < 6) & (y > 14) & (y < 34) & (z > 60)
    temples = outside & (x > 58) & (y > 18) & (y < 90) & (z > 0)
    regions = {name: np.zeros(len(y), dtype=bool) for name in REGIONS}
    regions["face"] = (outside & front & (y < 112)) | red
    regions["rigid"] = forehead | bridge | temples
    regions["vermilion_upper"] = red & upper
    regions["vermilion_lower"] = red & lower
    regions["mouth_inner"] = inside & (mesh.s > 1.0)
    return regions
