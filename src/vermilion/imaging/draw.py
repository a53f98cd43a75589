"""Overlays: meshes, points and polylines over images (sRGB, 8 bit)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import Hits, RayCaster, interpolate
from vermilion.imaging.display import srgb8
from vermilion.imaging.frames import FrameSource
from vermilion.storage.errors import InputError

_SHIFT = 4  # sub-pixel bits of OpenCV's drawing


def to_display(linear: np.ndarray) -> np.ndarray:
    """`linear` RGB (h, w, 3) as sRGB uint8."""
    return srgb8(linear)


def shown_frame(
    source: FrameSource, camera: str, frame: int, size_px: tuple[int, int] = (320, 240)
) -> np.ndarray:
    """A frame as sRGB (h, w, 3) uint8; black of some (width, height) where it cannot be read."""
    try:
        return to_display(source.read(camera, frame))
    except InputError:
        return np.zeros((size_px[1], size_px[0], 3), dtype=np.uint8)


def draw_points(
    image: np.ndarray, points_px: np.ndarray, colour: Sequence[int], radius_px: int = 2
) -> np.ndarray:
    """A copy of `image` (h, w, 3) uint8 with discs at `points_px` (N, 2); NaN is left out."""
    image = np.ascontiguousarray(image).copy()
    for x, y in _fixed(points_px):
        cv2.circle(image, (x, y), radius_px << _SHIFT, tuple(colour), -1, cv2.LINE_AA, _SHIFT)
    return image


def draw_polyline(
    image: np.ndarray, points_px: np.ndarray, colour: Sequence[int], closed: bool = True
) -> np.ndarray:
    """A copy of `image` (h, w, 3) uint8 with a line through `points_px` (N, 2); NaN is left out."""
    image = np.ascontiguousarray(image).copy()
    points = _fixed(points_px).reshape(-1, 1, 2)
    if len(points):
        cv2.polylines(image, [points], closed, tuple(colour), 1, cv2.LINE_AA, _SHIFT)
    return image


def draw_mesh(
    image: np.ndarray,
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    colours: np.ndarray | None = None,
    opacity: float = 1.0,
) -> np.ndarray:
    """A shaded mesh over an image, seen from `camera` with a headlight.

    Args:
        image: (h, w, 3) uint8.
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        colours: (V, 3) in [0, 1]; light grey by default.
        opacity: of the mesh, 0 to 1.

    Returns:
        (h, w, 3) uint8.
    """
    hits = RayCaster(vertices_mm, triangles).see(camera)
    return paint_mesh(image, camera, hits, vertices_mm, triangles, colours, opacity)


def paint_mesh(
    image: np.ndarray,
    camera: Camera,
    hits: Hits,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    colours: np.ndarray | None = None,
    opacity: float = 1.0,
) -> np.ndarray:
    """`draw_mesh` with what the camera sees of the mesh already known.

    Args:
        image: (h, w, 3) uint8.
        hits: what each pixel of the camera sees.
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        colours: (V, 3) in [0, 1]; light grey by default.

    Returns:
        (h, w, 3) uint8.
    """
    normals = interpolate(hits, triangles, vertex_normals(vertices_mm, triangles))
    _, directions = camera.rays(camera.pixel_grid())
    facing = np.abs((normals * directions).sum(axis=-1))
    if colours is None:
        colours = np.full((len(vertices_mm), 3), 0.8)
    albedo = interpolate(hits, triangles, np.asarray(colours, dtype=np.float64))
    shaded = np.clip(albedo * (0.25 + 0.75 * facing)[..., None], 0, 1) * 255
    mask = hits.hit[..., None] * opacity
    return np.rint(image * (1 - mask) + shaded * mask).astype(np.uint8)


def colour_map(
    values: np.ndarray | float, low: float, high: float, name: str = "turbo"
) -> np.ndarray:
    """`values` (...,) as RGB (..., 3) in [0, 1]; NaN is grey."""
    import matplotlib  # slow to import, and most drawings have no colour map

    scaled = (np.asarray(values, dtype=float) - low) / (high - low)
    rgb = matplotlib.colormaps[name](np.clip(np.nan_to_num(scaled), 0, 1))[..., :3]
    return np.where(np.isnan(scaled)[..., None], 0.5, rgb)


def label(image: np.ndarray, text: str) -> np.ndarray:
    """A copy of `image` (h, w, 3) uint8 with a line of text in its top left corner."""
    image = np.ascontiguousarray(image).copy()
    size = max(0.4, image.shape[1] / 1200)
    place = (6, round(24 * size) + 4)
    # The outline is the text itself, shifted: a thicker one is another font, whose letters are wider.
    around = [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]
    for colour, shifts in (((0, 0, 0), around), ((255, 255, 255), [(0, 0)])):
        for x, y in shifts:
            shifted = (place[0] + x, place[1] + y)
            cv2.putText(
                image, text, shifted, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA
            )
    return image


def resized_to_height(image: np.ndarray, height_px: int) -> np.ndarray:
    """`image` (h, w, 3) uint8 at another height, its pixels averaged."""
    width = max(1, round(image.shape[1] * height_px / image.shape[0]))
    return cv2.resize(image, (width, height_px), interpolation=cv2.INTER_AREA)


def tile(images: Sequence[np.ndarray], columns: int) -> np.ndarray:
    """`images` (h, w, 3) uint8 of any sizes side by side, scaled to the first one's height."""
    height = images[0].shape[0]
    scaled = [
        p
        if p.shape[0] == height
        else cv2.resize(p, (round(p.shape[1] * height / p.shape[0]), height))
        for p in images
    ]
    rows = [np.hstack(scaled[i : i + columns]) for i in range(0, len(scaled), columns)]
    width = max(row.shape[1] for row in rows)
    rows = [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0))) for row in rows]
    return np.vstack(rows)


def sheet(images: Sequence[np.ndarray], columns: int = 3) -> np.ndarray:
    """A contact sheet (H, W, 3) uint8 of `images` (h, w, 3); a grey field where there are none."""
    return tile(images, columns) if images else np.full((64, 256, 3), 90, dtype=np.uint8)


def portrait(
    camera: Camera,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    title: str,
    colours: np.ndarray | None = None,
) -> np.ndarray:
    """A mesh on a plain ground with its name, (h, w, 3) uint8.

    Args:
        camera: what it is seen from, of the image's size.
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        colours: (V, 3) in [0, 1]; light grey by default.
    """
    ground = np.full((camera.height_px, camera.width_px, 3), 40, dtype=np.uint8)
    return label(draw_mesh(ground, camera, vertices_mm, triangles, colours), title)


def _fixed(points_px: np.ndarray) -> np.ndarray:
    """Finite pixels as OpenCV's fixed-point integers; its pixel centres are whole numbers."""
    points = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
    points = points[np.isfinite(points).all(axis=1)]
    return np.rint((points - 0.5) * (1 << _SHIFT)).astype(np.int32)
