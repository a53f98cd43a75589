"""Images of the image fit: the estimated appearance, and the errors that remain."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.appearance.harmonics import irradiance
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.imaging.draw import colour_map, label, tile, to_display
from vermilion.tracking.image_fit.take import TakeStart
from vermilion.tracking.overlay import crop_to_points

_WORST = 40.0  # display values at the hottest colour


def samples_to_vertices(
    values: np.ndarray,
    trust: np.ndarray,
    samples: SurfacePoints,
    triangles: np.ndarray,
    count: int,
) -> np.ndarray:
    """Weighted means (V, C) at the vertices of values at the samples; the overall mean where unseen.

    Args:
        values: (N, C) at the samples.
        trust: (N,) weights of the samples.
        samples: N points of the mesh.
        triangles: (T, 3) of the mesh.
        count: vertices of the mesh.
    """
    at = samples.matrix(triangles, count)
    weight = at.T @ trust
    total = (trust[:, None] * values).sum(axis=0) / max(trust.sum(), 1e-9)
    mean = (at.T @ (trust[:, None] * values)) / np.maximum(weight, 1e-9)[:, None]
    return np.where(weight[:, None] > 1e-6, mean, total)


def appearance_image(
    image: np.ndarray, start: TakeStart, x: np.ndarray, appearance: Appearance
) -> np.ndarray:
    """Image, model, albedo and light side by side, (h, w, 3) uint8.

    Args:
        image: (h, w, 3) linear RGB.
        start: the take.
        x: (6 + K,) rotation vector, translation, weights of the image's frame.
        appearance: of the take.
    """
    camera, triangles = start.camera, start.model.triangles
    local = start.vertices(x)
    world = (local - camera.translation) @ camera.rotation
    hits = RayCaster(world, triangles).see(camera)
    normals = interpolate(hits, triangles, vertex_normals(local, triangles))
    light = irradiance(normalised(normals), appearance.light)
    vertices = samples_to_vertices(
        appearance.albedo[0], np.minimum(appearance.seen, 1.0), appearance.samples, triangles,
        len(local),
    )  # fmt: skip
    albedo = interpolate(hits, triangles, vertices)
    place, original = camera.project(world), to_display(image)
    panels = [label(crop_to_points(original, place), "image")]
    for name, colours in (("model", albedo * light), ("albedo", albedo), ("light", 0.5 * light)):
        shown = np.where(hits.hit[..., None], to_display(colours), original)
        panels.append(label(crop_to_points(shown, place), name))
    return np.hstack(panels)


def residual_sheet(
    rows: Sequence[tuple[str, np.ndarray, Sequence[tuple]]], camera: Camera
) -> np.ndarray:
    """Error of every sample as a colour: a row a frame, a column a step, (h, w, 3) uint8.

    Args:
        rows: (name, image (h, w, 3) linear, [(label, errors (N, 3), trust (N,), place (N, 2))]);
            places in pixels from the principal point of the ideal pinhole camera.
        camera: of the images.
    """
    if not rows:
        return np.zeros((64, 256, 3), dtype=np.uint8)
    k = camera.calibration
    squeeze = np.array([1.0, k[1, 1] / k[0, 0]])
    panels = []
    for name, image, results in rows:
        original = to_display(image)
        points = results[0][3] * squeeze + k[:2, 2]
        panels.append(label(crop_to_points(original, points), name))
        for text, errors, trust, place in results:
            panels.append(
                label(
                    _error_image(original, points, errors, trust, place * squeeze + k[:2, 2]),
                    text,
                )
            )
    return tile(panels, 1 + len(rows[0][2]))


def _error_image(original, points, errors, trust, place):
    seen = np.flatnonzero(trust > 0)
    colours = np.rint(255 * colour_map(np.abs(errors[seen]).mean(axis=1), 0.0, _WORST))
    extent = points.max(axis=0) - points.min(axis=0)
    radius = max(1, int(0.35 * np.sqrt(extent.prod() / len(points)) + 1))
    shown = original.copy()
    for (column, row), colour in zip(place[seen], colours.astype(int).tolist(), strict=True):
        cv2.circle(shown, (int(column), int(row)), radius, colour, -1)
    return crop_to_points(shown, points)
