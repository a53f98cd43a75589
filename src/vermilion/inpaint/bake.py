"""Texture of the lips from one or several calibrated images of a mesh (Lips16 3.2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import sample


@dataclass(frozen=True)
class Texture:
    """Colours over a domain.

    Attributes:
        rgb: (h, w, 3) float32 linear; zero where `weight` is.
        weight: (h, w) float32, how well it was seen: pixels an area of a texel, times facing.
    """

    rgb: np.ndarray
    weight: np.ndarray

    @property
    def seen(self) -> np.ndarray:
        return self.weight > 0


def surface_points(
    domain: LipDomain, vertices_mm: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """World position and unit normal of the valid texels, both (n, 3)."""
    triangle, barycentric = domain.texels()
    corners = triangles[triangle]
    weights = barycentric[..., None]
    points = (vertices_mm[corners] * weights).sum(axis=1)
    normals = (vertex_normals(vertices_mm, triangles)[corners] * weights).sum(axis=1)
    return points, normalised(normals)


def view_weight(
    domain: LipDomain,
    caster: RayCaster,
    camera: Camera,
    points_mm: np.ndarray,
    normals: np.ndarray,
    edge_mm: float,
) -> np.ndarray:
    """How well a camera sees the valid texels, (n,) float32; 0 where hidden or doubtful.

    Pixels an area of a texel (foreshortened) times the cosine of the viewing angle. Texels closer
    than `edge_mm` (and 1.5 pixels) to an occluding contour or to the mouth's inside count as hidden,
    because the mesh is never exact and the lens mixes what lies behind into them.
    """
    towards = camera.centre_mm - points_mm
    distance = np.linalg.norm(towards, axis=1)
    facing = np.clip((normals * towards).sum(axis=1) / distance, 0.0, 1.0)
    pixels = camera.project(points_mm)
    density = (camera.calibration[0, 0] / distance * domain.texel_mm) ** 2
    weight = np.where(caster.visible(camera, points_mm, 0.3), density * facing**2, 0.0)
    if weight.any():
        clear_px = sample(_clearance(domain, caster, camera), pixels)
        edge_px = np.maximum(edge_mm * camera.calibration[0, 0] / distance, 1.5)
        weight = np.where(clear_px >= edge_px, weight, 0.0)
    return np.where(facing > 0.15, weight, 0.0).astype(np.float32)


def _clearance(domain: LipDomain, caster: RayCaster, camera: Camera) -> np.ndarray:
    """Pixels' distance to the nearest occluding contour or pixel without the domain, (h, w)."""
    hits = caster.see(camera)
    on_domain = hits.hit & domain.in_domain[np.maximum(hits.triangle, 0)]
    depth = np.where(hits.hit, hits.distance_mm, 1e6).astype(np.float32)
    # A jump of depth between neighbours steeper than a skin that faces away: a contour.
    span = cv2.dilate(depth, np.ones((3, 3))) - cv2.erode(depth, np.ones((3, 3)))
    pixel_mm = np.median(depth[hits.hit]) / camera.calibration[0, 0] if hits.hit.any() else 1.0
    smooth = on_domain & (span < 8.0 * pixel_mm)
    padded = np.pad(smooth, 1, mode="edge").astype(np.uint8)
    return cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]


def bake(
    domain: LipDomain,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    views: Sequence[tuple[Camera, np.ndarray]],
    edge_mm: float = 0.8,
) -> Texture:
    """Blend the views' colours over the domain.

    Args:
        vertices_mm: (V, 3) the mesh at the moment of the images.
        triangles: (T, 3).
        views: (camera, linear RGB (h, w, 3)); the first one sets the colour, the others are
            brought to it by one gain a channel where both see the skin.
        edge_mm: surface closer than this to an occluding contour is not used.
    """
    caster = RayCaster(vertices_mm, triangles)
    points, normals = surface_points(domain, vertices_mm, triangles)
    total = np.zeros((len(points), 3), dtype=np.float32)
    weights = np.zeros(len(points), dtype=np.float32)
    reference: tuple[np.ndarray, np.ndarray] | None = None
    for camera, linear in views:
        weight = view_weight(domain, caster, camera, points, normals, edge_mm)
        colour = sample(linear, camera.project(points))
        if reference is None:
            reference = (colour, weight)
        else:
            colour = colour * _gain(colour, weight, *reference)
        # Squared, so that the best view dominates and small misalignments do not blur.
        total += colour * (weight**2)[:, None]
        weights += weight**2
    rgb = total / np.maximum(weights, 1e-12)[:, None]
    return Texture(domain.image(rgb), domain.image(np.sqrt(weights)))


def _gain(
    colour: np.ndarray, weight: np.ndarray, reference: np.ndarray, reference_weight: np.ndarray
) -> np.ndarray:
    """Gain a channel, (3,), that brings a view's colours to the reference's; at most 25 %."""
    both = (weight > 0) & (reference_weight > 0)
    if both.sum() < 200:
        return np.ones(3, dtype=np.float32)
    ratio = np.median(reference[both], axis=0) / np.maximum(np.median(colour[both], axis=0), 1e-4)
    return np.clip(ratio, 0.8, 1.25).astype(np.float32)
