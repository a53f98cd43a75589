"""The mesh moved parallel to the image by the flow (Mono13 7.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.detail.flow.pose import rigid_motion
from vermilion.geometry.camera import Camera
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.imaging.sampling import sample_bilinear


@dataclass(frozen=True)
class DeformationSettings:
    """How far the mesh follows the flow.

    Attributes:
        mu: weight of the flow against the mesh's shape (Mono13 eq. 14).
        spacing_px: side of the squares in each of which one vertex follows the flow; 0: all do.
        pose: whether the flow of the rigid face first moves the head as a whole.
        depth_sigma_mm: typical error of the head's distance, for `pose`.
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

    Minimises |L X - L X_b|^2 + mu^2 sum_C |X_i - (X_b,i + W_i)|^2 over the positions X. L is the
    cotangent Laplacian of X_b. W is parallel to the image, so depth does not change. X_b is the mesh
    after the rigid motion (`settings.pose`).

    Args:
        vertices_mm: (V, 3), world.
        triangles: (T, 3).
        camera: of the flow.
        flow_px: (h, w, 2) corrective flow.
        mask: (h, w) bool, where the flow is known.
        visible: (V,) bool, vertices that may follow the flow.
        rigid: (V,) bool, the part of the face that moves with the skull.
        settings: how far the mesh follows the flow.

    Returns:
        (V, 3) mm, world; the input where no vertex is chosen.
    """
    pixels = np.nan_to_num(camera.project(vertices_mm), nan=-1e6)
    known = sample_bilinear(mask.astype(np.float32), pixels, "zero") > 0.99
    chosen = one_per_cell(pixels, np.flatnonzero(visible & known), settings.spacing_px)
    local = camera.to_camera(np.asarray(vertices_mm, dtype=np.float64))
    if not len(chosen):
        return np.array(vertices_mm, dtype=np.float64)
    flow = sample_bilinear(np.asarray(flow_px, np.float32), pixels, "zero")
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
    # Vertices of no triangle have no Laplacian: a small diagonal keeps the system regular.
    system = laplacian.T @ laplacian + sparse.diags(trust + 1e-9)
    local[:, :2] += CholeskyFactor(system).solve(right)
    return (local - camera.translation) @ camera.rotation


def one_per_cell(pixels: np.ndarray, candidates: np.ndarray, spacing_px: float) -> np.ndarray:
    """The most central candidate in each square of the image, sorted ids (C,).

    Args:
        pixels: (V, 2) of all vertices.
        candidates: (N,) int ids of vertices.
        spacing_px: side of a square; 0 keeps all candidates.
    """
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
