"""One frame in every camera: image, mesh, stereo points, residual, visibility, drift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import Hits, RayCaster, interpolate
from vermilion.imaging.draw import colour_map, paint_mesh
from vermilion.imaging.draw import label as write_label
from vermilion.multiview.drift import Carried
from vermilion.multiview.overlay import show
from vermilion.multiview.stereo import Cloud
from vermilion.multiview.views import Frame, View

_DARK = 24
_LOOP = (255, 90, 60)
#: Spacing of the lines that the mesh carries (mm on the template's neutral).
GRID_MM = 5.0
#: Difference of the hottest colour (local deviations).
DIFFERENCE = 1.5


@dataclass(frozen=True)
class SheetSettings:
    """See `vermilion.config.multiview` for meanings and units; `scale` is that of the drift."""

    image_px: int
    residual_px: float
    cloud_mm: float
    scale: float


@dataclass(frozen=True)
class ShownFrame:
    """A frame to draw.

    Attributes:
        frame: full-size images.
        vertices_mm: (V, 3).
        cameras_seeing: (V,) cameras that measured the vertex; zero where the prior placed it.
        cloud: stereo points.
        carried: camera -> another image carried through the mesh.
    """

    frame: Frame
    vertices_mm: np.ndarray
    cameras_seeing: np.ndarray
    cloud: Cloud
    carried: Mapping[str, Carried]


def columns(settings: SheetSettings, carried_from: str) -> list[str]:
    """What the images of a row show, from left to right."""
    return [
        "image",
        f"mesh, {GRID_MM:g} mm grid",
        f"points, -{settings.cloud_mm:g} to {settings.cloud_mm:g} mm",
        f"residual, 0 to {settings.residual_px:g} px",
        "cameras that measured",
        f"carried from {carried_from}",
        f"difference, 0 to {DIFFERENCE:g}",
    ]


def frame_sheet(
    shown: ShownFrame, model: FaceModel, settings: SheetSettings, carried_from: str = "neutral"
) -> np.ndarray:
    """A row a camera, with those that miss the frame, under a line of headings: (h, w, 3) uint8."""
    mesh = _Mesh.of(shown, model)
    names = sorted({*shown.frame.views, *shown.frame.missing})
    headings = columns(settings, carried_from)
    rows = [np.hstack([_heading(text, settings.image_px) for text in headings])]
    for name in names:
        if name in shown.frame.views:
            cells = _row(mesh, shown, name, settings)
            cells[0] = write_label(cells[0], name)
        else:
            cells = [_heading(name, settings.image_px), _heading("no image", 0)]
            cells += [_heading("", settings.image_px)] * (len(headings) - len(cells))
        rows.append(np.hstack([_boxed(cell, settings.image_px) for cell in cells]))
    return np.vstack(rows)


@dataclass(frozen=True)
class _Mesh:
    """What all cameras share: the mesh, its rays, heights of the points over it."""

    model: FaceModel
    vertices_mm: np.ndarray
    caster: RayCaster
    normals: np.ndarray
    heights_mm: np.ndarray

    @classmethod
    def of(cls, shown: ShownFrame, model: FaceModel) -> _Mesh:
        vertices = np.asarray(shown.vertices_mm, dtype=np.float64)
        normals = vertex_normals(vertices, model.triangles)
        heights = np.zeros(0)
        if len(shown.cloud):
            _, near = cKDTree(vertices).query(shown.cloud.points_mm)
            offset = shown.cloud.points_mm - vertices[near]
            heights = (offset * normals[near]).sum(axis=1)
        return cls(model, vertices, RayCaster(vertices, model.triangles), normals, heights)


def _row(mesh: _Mesh, shown: ShownFrame, name: str, settings: SheetSettings) -> list[np.ndarray]:
    view, carried = shown.frame.views[name], shown.carried.get(name)
    camera, image = _window(view, carried, settings)
    hits = mesh.caster.see(camera)
    dim = image // 3

    def coloured(values: np.ndarray, low: float, high: float, name: str) -> np.ndarray:
        colours = colour_map(values, low, high, name)
        return paint_mesh(dim, camera, hits, mesh.vertices_mm, mesh.model.triangles, colours)

    seeing = shown.cameras_seeing.astype(float)
    seeing = np.where(seeing > 0, seeing, np.nan)
    cells = [
        image,
        _mesh_over(image, camera, hits, mesh),
        _points_over(dim, camera, mesh, shown.cloud, settings.cloud_mm),
        coloured(_residual(mesh, carried, settings), 0, settings.residual_px, "turbo"),
        coloured(seeing, 0, max(len(shown.frame.views), 2), "viridis"),
    ]
    if carried is None or carried.comparison is None:
        return [*cells, _dark(camera), _dark(camera)]
    found = carried.comparison
    outside = ~found.mask[..., None]
    predicted = np.where(outside, _DARK, np.repeat(found.predicted[..., None], 3, axis=2))
    heat = np.rint(255 * colour_map(carried.difference(), 0, DIFFERENCE, "magma"))
    difference = np.where(outside, _DARK + 20, heat)
    return cells + [_resized(part.astype(np.uint8), camera) for part in (predicted, difference)]


def _window(
    view: View, carried: Carried | None, settings: SheetSettings
) -> tuple[Camera, np.ndarray]:
    """The part of an image where the mesh is, at the sheet's size: its camera and pixels."""
    left, top, right, bottom = 0, 0, view.camera.width_px, view.camera.height_px
    if carried is not None and carried.comparison is not None:
        raster = carried.comparison.raster
        small = np.array([raster.left_px, raster.top_px])
        size = np.array([raster.camera.width_px, raster.camera.height_px])
        left, top = np.floor(small / settings.scale).astype(int)
        right, bottom = np.minimum(
            np.ceil((small + size) / settings.scale).astype(int), [right, bottom]
        )
    k = view.camera.calibration
    params = (k[0, 0], k[1, 1], k[0, 2] - left, k[1, 2] - top)
    width, height = int(right - left), int(bottom - top)
    cut = Camera(view.camera.name, "PINHOLE", params, width, height, view.camera.cam_from_world)
    camera = cut.resized(min(1.0, settings.image_px / max(width, height)))
    return camera, _resized(show(view)[top:bottom, left:right], camera)


def _mesh_over(image: np.ndarray, camera: Camera, hits: Hits, mesh: _Mesh) -> np.ndarray:
    """Lines of a grid that the mesh carries, and the borders of the vermilion and the mouth."""
    place = interpolate(hits, mesh.model.triangles, mesh.model.neutral_mm[:, :2])
    square = np.where(hits.hit[..., None], np.floor(place / GRID_MM), np.nan)
    edge = np.zeros(hits.hit.shape, dtype=bool)
    edge[1:] |= (np.abs(np.diff(square, axis=0)) > 0).any(axis=2)
    edge[:, 1:] |= (np.abs(np.diff(square, axis=1)) > 0).any(axis=2)
    tinted = np.where(edge[..., None], 0.45 * image + 0.55 * np.array([90, 255, 140]), image)
    drawn = np.ascontiguousarray(np.rint(tinted).astype(np.uint8))
    for loop in (mesh.model.outer_contour, mesh.model.inner_contour):
        points = mesh.vertices_mm[loop]
        seen = mesh.caster.visible(camera, points, 1.0)
        both = seen & np.roll(seen, -1)
        pixels = np.rint((camera.project(points) - 0.5) * 16).astype(np.int32)
        ends = np.stack([pixels, np.roll(pixels, -1, axis=0)], axis=1)[both]
        cv2.polylines(drawn, list(ends), False, _LOOP, 1, cv2.LINE_AA, 4)
    return drawn


def _points_over(
    image: np.ndarray, camera: Camera, mesh: _Mesh, cloud: Cloud, scale_mm: float
) -> np.ndarray:
    """Points that the camera sees, coloured by their mean height over the mesh (red: outside)."""
    if not len(cloud):
        return image
    pixels = camera.project(cloud.points_mm)
    seen = mesh.caster.visible(camera, cloud.points_mm, 2.0) & camera.in_image(pixels, 1.0)
    column, row = np.floor(pixels[seen]).astype(int).T
    size = camera.width_px * camera.height_px
    at = row * camera.width_px + column
    count = np.bincount(at, minlength=size).reshape(camera.height_px, camera.width_px)
    total = np.bincount(at, mesh.heights_mm[seen], size).reshape(count.shape)
    # Larger dots.
    points, height = (cv2.blur(part.astype(float), (2, 2)) for part in (count, total))
    height = height / np.maximum(points, 1e-9)
    colours = 255 * colour_map(height, -scale_mm, scale_mm, "coolwarm")
    return np.where(points[..., None] > 1e-9, np.rint(colours), image).astype(np.uint8)


def _residual(mesh: _Mesh, carried: Carried | None, settings: SheetSettings) -> np.ndarray:
    """(V,) px of the originals, NaN where this camera measured nothing."""
    if carried is None:
        return np.full(len(mesh.vertices_mm), np.nan)
    length = np.linalg.norm(carried.motion.offset_px, axis=1) / settings.scale
    return np.where(carried.seen & (carried.motion.weight > 0), length, np.nan)


def _resized(image: np.ndarray, camera: Camera) -> np.ndarray:
    size = (camera.width_px, camera.height_px)
    method = cv2.INTER_AREA if size[0] < image.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(image, size, interpolation=method)


def _dark(camera: Camera) -> np.ndarray:
    return np.full((camera.height_px, camera.width_px, 3), _DARK, dtype=np.uint8)


def _heading(text: str, size_px: int) -> np.ndarray:
    """A low dark image with a text."""
    return write_label(np.full((30, max(size_px, 60), 3), _DARK, dtype=np.uint8), text)


def _boxed(image: np.ndarray, width_px: int) -> np.ndarray:
    """In the middle of a dark column; rows of a sheet are as high as their highest image."""
    room = width_px - image.shape[1]
    return np.pad(image, ((1, 1), (room // 2, room - room // 2), (0, 0)), constant_values=_DARK)
