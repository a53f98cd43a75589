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
        """(h, w) bool, texels that some camera saw."""
        return self.weight > 0


@dataclass(frozen=True)
class TexelView:
    """The valid texels of a domain as one camera sees them.

    Attributes:
        colour: (n, 3) float32 linear.
        weight: (n,) float32, as `Texture.weight`.
    """

    colour: np.ndarray
    weight: np.ndarray


def _surface_points(
    domain: LipDomain, vertices_mm: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """World position (mm) and unit normal of the valid texels, both (n, 3)."""
    triangle, barycentric = domain.texels()
    corners = triangles[triangle]
    weights = barycentric[..., None]
    points = (vertices_mm[corners] * weights).sum(axis=1)
    normals = (vertex_normals(vertices_mm, triangles)[corners] * weights).sum(axis=1)
    return points, normalised(normals)


def _view_weight(
    domain: LipDomain,
    caster: RayCaster,
    camera: Camera,
    points_mm: np.ndarray,
    normals: np.ndarray,
    pixels: np.ndarray,
    edge_mm: float,
) -> np.ndarray:
    """How well a camera sees the valid texels, (n,) float32; 0 where hidden or doubtful.

    The weight is the pixels that an area of a texel covers (foreshortened) times the cosine of the
    viewing angle. Texels closer than `edge_mm` (and 1.5 pixels) to an occluding contour or to the
    inside of the mouth count as hidden: the mesh is never exact, and the lens mixes what lies behind
    into them.
    """
    towards = camera.centre_mm - points_mm
    distance = np.linalg.norm(towards, axis=1)
    facing = np.clip((normals * towards).sum(axis=1) / distance, 0.0, 1.0)
    density = (camera.calibration[0, 0] / distance * domain.texel_mm) ** 2
    weight = np.where(caster.visible(camera, points_mm, 0.3), density * facing**2, 0.0)
    if weight.any():
        clear_px = sample(_clearance(domain, caster, camera), pixels)
        edge_px = np.maximum(edge_mm * camera.calibration[0, 0] / distance, 1.5)
        weight = np.where(clear_px >= edge_px, weight, 0.0)
    return np.where(facing > 0.15, weight, 0.0).astype(np.float32)


def _clearance(domain: LipDomain, caster: RayCaster, camera: Camera) -> np.ndarray:
    """Distance (px) of each pixel to the nearest occluding contour or pixel off the domain, (h, w)."""
    hits = caster.see(camera)
    on_domain = hits.hit & domain.in_domain[np.maximum(hits.triangle, 0)]
    depth = np.where(hits.hit, hits.distance_mm, 1e6).astype(np.float32)
    # An occluding contour: depth jumps between neighbours by more than on skin seen at a slant.
    span = cv2.dilate(depth, np.ones((3, 3))) - cv2.erode(depth, np.ones((3, 3)))
    pixel_mm = np.median(depth[hits.hit]) / camera.calibration[0, 0] if hits.hit.any() else 1.0
    smooth = on_domain & (span < 8.0 * pixel_mm)
    padded = np.pad(smooth, 1, mode="edge").astype(np.uint8)
    return cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]


def view_texels(
    domain: LipDomain,
    caster: RayCaster,
    vertices_mm: np.ndarray,
    views: Sequence[tuple[Camera, np.ndarray]],
    edge_mm: float,
) -> list[TexelView]:
    """The texels of a domain as each camera sees them; arguments as for `bake`.

    `vertices_mm` (V, 3) in the world, `views` of (camera, linear RGB (h, w, 3)).
    """
    points, normals = _surface_points(domain, vertices_mm, caster.triangles)
    seen = []
    for camera, linear in views:
        pixels = camera.project(points)
        weight = _view_weight(domain, caster, camera, points, normals, pixels, edge_mm)
        seen.append(TexelView(sample(linear, pixels), weight))
    return seen


def blend(domain: LipDomain, seen: Sequence[TexelView]) -> Texture:
    """One texture of several views of the same texels.

    The first view sets the colour. The others are brought to it by one gain a channel, from the
    texels that both see.
    """
    total = np.zeros_like(seen[0].colour)
    weights = np.zeros_like(seen[0].weight)
    for number, view in enumerate(seen):
        colour = view.colour * _gain(view, seen[0]) if number else view.colour
        # Squared, so that the best view dominates and small misalignments do not blur.
        total += colour * (view.weight**2)[:, None]
        weights += view.weight**2
    rgb = total / np.maximum(weights, 1e-12)[:, None]
    return Texture(domain.image(rgb), domain.image(np.sqrt(weights)))


def bake(
    domain: LipDomain,
    caster: RayCaster,
    vertices_mm: np.ndarray,
    views: Sequence[tuple[Camera, np.ndarray]],
    edge_mm: float = 0.8,
) -> Texture:
    """Blend the colours of the views over the domain.

    Args:
        domain: the lips in texture space.
        caster: of the mesh at the moment of the images.
        vertices_mm: (V, 3) of the same mesh, world.
        views: (camera, linear RGB (h, w, 3)), the one that sets the colour first.
        edge_mm: surface closer than this to an occluding contour is not used.
    """
    return blend(domain, view_texels(domain, caster, vertices_mm, views, edge_mm))


def _gain(view: TexelView, reference: TexelView) -> np.ndarray:
    """Gain a channel, (3,), that brings a view's colours to the reference's; at most 25 %."""
    both = (view.weight > 0) & (reference.weight > 0)
    if both.sum() < 200:
        return np.ones(3, dtype=np.float32)
    ratio = np.median(reference.colour[both], axis=0)
    ratio /= np.maximum(np.median(view.colour[both], axis=0), 1e-4)
    return np.clip(ratio, 0.8, 1.25).astype(np.float32)
