"""Photo-consistency between cameras: the surface of one frame to a small part of a pixel.

The mesh predicts one camera's image from another's; the flow to the real image, taken along
the ray of the first camera, says how far the surface lies in front of or behind the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.multiview.photometric import FlowMatcher, measure_motion, rasterise, sight
from vermilion.multiview.solver import ThinPlate, solve_displacement
from vermilion.multiview.views import Frame


@dataclass(frozen=True)
class PairedImages:
    """Images of one moment that are compared on a surface.

    Attributes:
        frame: with its images.
        pairs: of cameras.
        matcher: of images.
        sigma_px: expected error of a measurement.
        max_offset_mm: farther offsets do not count.
    """

    frame: Frame
    pairs: Sequence[tuple[str, str]]
    matcher: FlowMatcher
    sigma_px: float
    max_offset_mm: float


def normal_offsets(
    images: PairedImages, vertices_mm: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the real surface from each vertex along its normal, from all pairs.

    Args:
        images: that are compared.
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).

    Returns:
        (offset (V,) mm, information (V,) 1/mm^2, zero where no pair sees the vertex).
    """
    views, sigma_px = images.frame.views, images.sigma_px
    caster = RayCaster(vertices_mm, triangles)
    normals = vertex_normals(vertices_mm, triangles)
    sights = {n: sight(caster, view.camera, vertices_mm, normals) for n, view in views.items()}
    rasters = {n: rasterise(caster, view.camera, sights[n]) for n, view in views.items()}
    offsets, weights = [], []
    for source, target in (way for a, b in images.pairs for way in ((a, b), (b, a))):
        motion = measure_motion(
            images.matcher,
            rasters[target],
            sights[target],
            views[target],
            views[source],
            sights[source],
        )
        origin = views[source].camera.centre_mm
        ray = vertices_mm - origin
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        slope = np.einsum("vij,vj->vi", views[target].camera.pixel_jacobian(vertices_mm), ray)
        square = np.maximum((slope * slope).sum(axis=1), 1e-9)
        along = (slope * motion.offset_px).sum(axis=1) / square
        across = motion.offset_px - along[:, None] * slope
        off_line = np.linalg.norm(across, axis=1)
        cosine = (ray * normals).sum(axis=1)
        offset = along * cosine
        weight = motion.weight * square / np.maximum(cosine**2, 0.04) / sigma_px**2
        weight *= np.exp(-0.5 * (off_line / (4 * sigma_px)) ** 2)
        weight[np.abs(offset) > images.max_offset_mm] = 0
        offsets.append(offset)
        weights.append(weight)
    return robust_mean(np.array(offsets), np.array(weights))


def robust_mean(
    values: np.ndarray, weights: np.ndarray, rounds: int = 5
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (V,) and its information (V,) of values (N, V), weights (N, V), with Cauchy weights."""
    total = weights.sum(axis=0)
    w = weights
    for _ in range(rounds):
        mean = (w * values).sum(axis=0) / np.maximum(w.sum(axis=0), 1e-12)
        away = (values - mean) ** 2 * weights
        w = weights / (1 + away / 4.0)
    return mean, np.where(total > 0, w.sum(axis=0), 0.0)


def polish(
    images: PairedImages,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    lengths_mm: Sequence[float],
) -> tuple[np.ndarray, np.ndarray]:
    """Move the mesh onto the photo-consistent surface, one round a stiffness.

    Args:
        images: that are compared.
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        lengths_mm: stiffness of each round (see `solver`).

    Returns:
        (vertices (V, 3) mm, information (V,) of the last round).
    """
    current = vertices_mm
    information = np.zeros(len(vertices_mm))
    for length in lengths_mm:
        offset, information = normal_offsets(images, current, triangles)
        plate = ThinPlate.of(current, triangles)
        normals = vertex_normals(current, triangles)
        weight = np.minimum(information / max(np.median(information[information > 0]), 1e-9), 10)
        blocks = weight[:, None, None] * (normals[:, :, None] * normals[:, None, :])
        blocks = blocks + (1e-3 * np.minimum(weight, 1))[:, None, None] * np.eye(3)
        right = (weight * offset)[:, None] * normals
        current = current + solve_displacement(plate, blocks, right, length)
    return current, information
