"""Sheets of renders: meshes side by side from front and side (Lips16 figures 9 to 15)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.export.overlay import lip_colours
from vermilion.geometry.camera import Camera, look_at, pinhole
from vermilion.geometry.mesh import incidence, triangle_areas
from vermilion.imaging.draw import colour_map
from vermilion.imaging.shaded_mesh import shade

VIEWS = (("front", (0.0, 0.0, 1.0)), ("side", (1.0, 0.0, 0.12)))
_GREY = (0.72, 0.72, 0.72)
_STRETCH = 0.4


@dataclass(frozen=True)
class Column:
    """One column of a sheet.

    Attributes:
        name: over its images.
        meshes_mm: (n, V, 3) in the head frame (y up, z out of the face), one a frame.
        triangles: (T, 3) to draw; those with a corner that is NaN in a frame are left out.
        colours: (n, V, 3) in [0, 1].
    """

    name: str
    meshes_mm: np.ndarray
    triangles: np.ndarray
    colours: np.ndarray


def render_sheet(
    columns: Sequence[Column],
    frames: Sequence[int],
    centres_mm: np.ndarray,
    width_mm: float,
    size_px: int,
    images: Sequence[np.ndarray] | None = None,
) -> np.ndarray:
    """(h, w, 3) uint8: a row a frame and view, a column a mesh.

    Args:
        frames: numbers of the n frames, for the labels.
        centres_mm: (n, 3) what each frame's views are centred on.
        width_mm: of the part that a view shows.
        images: n images (size_px, size_px, 3) uint8 to the left of the front views, or None.
    """
    rows = []
    for index, frame in enumerate(frames):
        for view, direction in VIEWS:
            camera = view_of(centres_mm[index], np.array(direction), width_mm, size_px)
            cells = []
            if images is not None:
                paper = np.full((size_px, size_px, 3), 255, np.uint8)
                cells.append(images[index] if view == "front" else paper)
            for column in columns:
                text = f"{column.name}, frame {frame}" if view == "front" else ""
                cells.append(caption(render_mesh(column, index, camera), text))
            rows.append(np.hstack(cells))
    return np.vstack(rows)


def render_mesh(column: Column, index: int, camera: Camera) -> np.ndarray:
    """One mesh on white paper, (h, w, 3) uint8."""
    paper = np.full((camera.height_px, camera.width_px, 3), 255, np.uint8)
    mesh = np.asarray(column.meshes_mm[index], dtype=float)
    known = np.isfinite(mesh).all(axis=1)
    triangles = column.triangles[known[column.triangles].all(axis=1)]
    return shade(paper, camera, np.nan_to_num(mesh), triangles, column.colours[index], 1.0)


def error_columns(
    meshes_mm: dict[str, np.ndarray],
    errors_mm: dict[str, np.ndarray],
    triangles: np.ndarray,
    scale_mm: float,
) -> list[Column]:
    """Columns coloured by vertex error; what was not measured is grey (figures 14 and 15).

    By name: `meshes_mm` (n, V, 3) and `errors_mm` (n, V), NaN where not measured; `triangles`
    (T, 3).
    """
    return [
        Column(name, meshes, triangles, _with_grey(colour_map(errors_mm[name], 0.0, scale_mm), errors_mm[name]))
        for name, meshes in meshes_mm.items()
    ]  # fmt: skip


def clay_columns(
    meshes_mm: dict[str, np.ndarray], triangles: np.ndarray, vermilion: np.ndarray
) -> list[Column]:
    """Columns in clay, lips slightly red (figures 10, 12 and 13).

    `meshes_mm` by name (n, V, 3); `triangles` (T, 3); `vermilion` (V,) bool.
    """
    colours = lip_colours(triangles, vermilion)
    return [
        Column(name, meshes, triangles, np.broadcast_to(colours, (len(meshes), *colours.shape)))
        for name, meshes in meshes_mm.items()
    ]


def stretch_columns(
    meshes_mm: dict[str, np.ndarray], neutrals_mm: dict[str, np.ndarray], triangles: np.ndarray
) -> list[Column]:
    """Columns coloured by surface stretch, each against its own neutral (figures 9 and 11).

    By name: `meshes_mm` (n, V, 3) and `neutrals_mm` (V, 3). `triangles` (T, 3).
    """
    return [
        Column(name, meshes, triangles, _stretch_colours(surface_stretch(meshes, neutrals_mm[name], triangles)))
        for name, meshes in meshes_mm.items()
    ]  # fmt: skip


def surface_stretch(
    meshes_mm: np.ndarray, neutral_mm: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Root of the change of area round each vertex, less 1, (n, V); NaN where it is not known.

    `meshes_mm` (n, V, 3), `neutral_mm` (V, 3), `triangles` (T, 3).
    """
    before = triangle_areas(np.asarray(neutral_mm, dtype=float), triangles)
    after = triangle_areas(np.asarray(meshes_mm, dtype=float), triangles)
    known = np.isfinite(before) & np.isfinite(after)
    around = incidence(triangles, len(neutral_mm))
    area = around @ np.where(known, after, 0.0).T
    rest = around @ np.where(known, before, 0.0).T
    ratio = np.divide(area, rest, out=np.full(area.shape, np.nan), where=rest > 0)
    return np.sqrt(ratio).T - 1.0


def stretch_bar(width_px: int) -> np.ndarray:
    """(46, width, 3) uint8: the colours of surface stretch."""
    share = 100 * _STRETCH
    texts = (f"-{share:g} %", "0", f"+{share:g} % and over")
    return colour_bar(width_px, lambda shares: _stretch_colours((2 * shares - 1) * _STRETCH), texts)


def error_bar(width_px: int, scale_mm: float) -> np.ndarray:
    """(46, width, 3) uint8: the colours of 0 to `scale_mm`."""
    texts = ("0", f"{0.5 * scale_mm:g}", f"{scale_mm:g} mm and over")
    return colour_bar(width_px, lambda shares: colour_map(shares, 0, 1), texts)


def colour_bar(
    width_px: int, colours_of: Callable[[np.ndarray], np.ndarray], texts: tuple[str, str, str]
) -> np.ndarray:
    """A ramp of `colours_of` (shares (n,) from 0 to 1 -> (n, 3)) with three labels."""
    bar = np.full((46, width_px, 3), 255, dtype=np.uint8)
    left, length = 12, min(360, width_px - 90)
    ramp = colours_of(np.linspace(0.0, 1.0, length))
    bar[8:22, left : left + length] = np.rint(255 * ramp)
    for share, text in zip((0.0, 0.5, 1.0), texts, strict=True):
        place = (left + round(share * length) - (0 if share == 0 else 8), 38)
        cv2.putText(bar, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (30, 30, 30), 1, cv2.LINE_AA)
    return bar


def view_of(centre_mm: np.ndarray, direction: np.ndarray, width_mm: float, size_px: int) -> Camera:
    """A long lens that looks at `centre_mm` (3,) from `direction` (3,), `width_mm` wide there.

    The view is nearly orthographic.
    """
    far = 1500.0
    eye_mm = centre_mm + far * direction / np.linalg.norm(direction)
    pose = look_at(eye_mm, centre_mm, np.array([0.0, 1.0, 0.0]))
    return pinhole("view", far * size_px / width_mm, size_px, size_px, pose)


def caption(image: np.ndarray, text: str) -> np.ndarray:
    """`image` (h, w, 3) uint8 with dark text at its top."""
    if text:
        image = np.ascontiguousarray(image)
        cv2.putText(
            image, text, (8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (30, 30, 30), 1, cv2.LINE_AA
        )
    return image


def crop(image: np.ndarray, centre_px: np.ndarray, width_px: float, size_px: int) -> np.ndarray:
    """The square of an image round a pixel, (size_px, size_px, 3) uint8; white outside.

    `image` (h, w, 3) uint8, `centre_px` (2,).
    """
    scale = size_px / width_px
    matrix = np.array(
        [
            [scale, 0.0, size_px / 2 - scale * centre_px[0]],
            [0.0, scale, size_px / 2 - scale * centre_px[1]],
        ]
    )
    return cv2.warpAffine(
        np.ascontiguousarray(image), matrix, (size_px, size_px), flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(255, 255, 255),
    )  # fmt: skip


def labels_nearby(
    labels: np.ndarray, points_mm: np.ndarray, to_points_mm: np.ndarray, reach_mm: float = 3.0
) -> np.ndarray:
    """Points whose nearest labelled point has the label and is in reach, (M,) bool.

    `labels` (N,) bool of `points_mm` (N, 3); `to_points_mm` (M, 3).
    """
    known = np.flatnonzero(np.isfinite(points_mm).all(axis=1))
    distance, nearest = cKDTree(points_mm[known]).query(to_points_mm)
    return labels[known[nearest]] & (distance < reach_mm)


def _with_grey(colours: np.ndarray, values: np.ndarray) -> np.ndarray:
    colours[np.isnan(values)] = _GREY
    return colours


def _stretch_colours(stretch: np.ndarray) -> np.ndarray:
    return _with_grey(colour_map(stretch, -_STRETCH, _STRETCH, "coolwarm"), stretch)
