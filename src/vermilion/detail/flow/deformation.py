"""The mesh moved parallel to the image by the flow (Mono13 7.2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import sparse

from vermilion.detail.flow.pose import rigid_motion
from vermilion.geometry.camera import Camera
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian


@dataclass(frozen=True)
class DeformationSettings:
    """How far the mesh follows the flow.

    Attributes:
        mu: trust in the flow against the mesh's shape (Mono13 eq. 14).
        spacing_px: one vertex is chosen for C in each square of this side; 0: all visible ones.
        pose: whether the head is first moved as a whole, as the flow of the rigid face asks.
        depth_sigma_mm: typical error of the head's distance, for that.
    """

    mu: float = 0.5
    spacing_px: float = 4.0
    pose: bool = True
    depth_sigma_mm: float = 3.0


def deform_to_flow(
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    camera: Camera,
    flow_px: np.ndarray,
    mask: np.ndarray,
    visible: np.ndarray,
    rigid: np.ndarray,
    settings: DeformationSettings,
) -> np.ndarray:
    """Follow the flow where it is known, keep the shape elsewhere (Mono13 eq. 14).

    Minimises |L X - L X_b|^2 + mu^2 sum_C |X_i - (X_b,i + W_i)|^2 over the positions X, L the
    cotangent Laplacian of X_b. W is parallel to the image, so that depth stays as it is; X_b is the
    mesh after the rigid motion, where that is asked for.

    Args:
        vertices_mm: (V, 3) in the world.
        flow_px: (h, w, 2) corrective flow in `camera`'s pixels; mask: (h, w) bool, where it is known.
        visible: (V,) bool, vertices that may follow it.
        rigid: (V,) bool, the part of the face that moves with the skull.

    Returns:
        (V, 3) in the world; the input where no vertex is chosen.
    """
    pixels = np.nan_to_num(camera.project(vertices_mm), nan=-1e6)
    places = (pixels - 0.5).astype(np.float32)[None]
    known = cv2.remap(mask.astype(np.float32), places, None, cv2.INTER_LINEAR)[0] > 0.99
    chosen = one_per_cell(pixels, np.flatnonzero(visible & known), settings.spacing_px)
    local = camera.to_camera(np.asarray(vertices_mm, dtype=np.float64))
    if not len(chosen):
        return np.array(vertices_mm, dtype=np.float64)
    flow = cv2.remap(np.ascontiguousarray(flow_px, np.float32), places, None, cv2.INTER_LINEAR)[0]
    target = _normal_plane(camera, pixels[chosen] + flow[chosen])
    if settings.pose:
        firm = rigid[chosen]
        rotation, translation = rigid_motion(
            local[chosen[firm]], target[firm], settings.depth_sigma_mm,
            focal_px=float(camera.calibration[0, 0]),
        )  # fmt: skip
        local = local @ rotation.T + translation
    wanted = target * local[chosen, 2:] - local[chosen, :2]

    laplacian, _ = cotangent_laplacian(local, triangles)
    trust, right = np.zeros(len(local)), np.zeros((len(local), 2))
    trust[chosen] = settings.mu**2
    right[chosen] = settings.mu**2 * wanted
    # Vertices of no triangle have no Laplacian: a trace of inertia keeps them, and the system, firm.
    system = laplacian.T @ laplacian + sparse.diags(trust + 1e-9)
    local[:, :2] += CholeskyFactor(system).solve(right)
    return (local - camera.translation) @ camera.rotation


def one_per_cell(pixels: np.ndarray, candidates: np.ndarray, spacing_px: float) -> np.ndarray:
    """Of the candidates (ids into (V, 2) pixels), in each square of the image the most central."""
    if spacing_px <= 0 or not len(candidates):
        return candidates
    cell = np.floor(pixels[candidates] / spacing_px)
    offset = np.abs(pixels[candidates] - (cell + 0.5) * spacing_px).max(axis=1)
    order = np.lexsort((candidates, offset, cell[:, 0], cell[:, 1]))
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.sort(candidates[order[first]])


def _normal_plane(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """(N, 2) x / z and y / z in the camera frame of pixels (N, 2)."""
    local = camera.rays(pixels)[1] @ camera.rotation.T
    return local[:, :2] / local[:, 2:]
