"""The overlay video: original, base track and corrected mesh side by side."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import av
import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import adjacency
from vermilion.imaging.draw import label
from vermilion.imaging.shaded_mesh import ShadedMesh
from vermilion.storage.files import atomic_path

SKIN = (0.80, 0.79, 0.77)
LIPS = (0.86, 0.53, 0.50)


@dataclass(frozen=True)
class Crop:
    """The part of an image that the panels show: x, y of its corner, its size, and its scale."""

    left: int
    top: int
    width: int
    height: int
    scale: float

    def of_image(self, image: np.ndarray) -> np.ndarray:
        """The part of an `image` (h, w, 3) uint8, scaled; grey beyond its border."""
        height, width = image.shape[:2]
        result = np.full((self.height, self.width, 3), 60, dtype=np.uint8)
        x0, y0 = max(self.left, 0), max(self.top, 0)
        x1, y1 = min(self.left + self.width, width), min(self.top + self.height, height)
        if x1 > x0 and y1 > y0:
            part = image[y0:y1, x0:x1]
            result[y0 - self.top : y1 - self.top, x0 - self.left : x1 - self.left] = part
        method = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_CUBIC
        return cv2.resize(result, self.size, interpolation=method)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of a panel, even numbers."""
        return (
            2 * max(1, round(self.width * self.scale / 2)),
            2 * max(1, round(self.height * self.scale / 2)),
        )

    def of_camera(self, camera: Camera) -> Camera:
        """The camera whose whole image is this part."""
        model = camera.colmap()
        params = np.array(camera.params, dtype=float)
        params[list(model.principal_point_idxs())] -= (self.left, self.top)
        cropped = replace(camera, params=tuple(params), width_px=self.width, height_px=self.height)
        return cropped.resized_to(*self.size)


def crop_round(
    points_px: np.ndarray, image_px: tuple[int, int], margin: float, height_px: int
) -> Crop:
    """The crop round projected `points_px` (..., 2), within the image, `height_px` high when shown.

    NaN points do not count. Half a per cent of points on each side may lie outside. `margin` is a
    share of the points' extent; `image_px` is (width, height).
    """
    low, high = _extent(points_px, image_px)
    pad = margin / 2 * (high - low)
    low = np.clip(np.floor(low - pad), 0, np.array(image_px) - 8).astype(int)
    high = np.clip(np.ceil(high + pad), low + 8, image_px).astype(int)
    width, height = (int(size) for size in high - low)
    return Crop(int(low[0]), int(low[1]), width, height, height_px / height)


def strips_following(
    points_px: np.ndarray, margin: float, size_px: tuple[int, int], smooth_frames: float = 4.0
) -> list[Crop]:
    """Crops of one scale that follow `points_px` (F, N, 2) smoothly and fill `size_px` when shown.

    `size_px` is (width, height). Frames without finite points take the centre of their neighbours.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames without a finite point
        low, high = np.nanmin(points_px, axis=1), np.nanmax(points_px, axis=1)
    known = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1)
    if not known.any():
        return [Crop(0, 0, *size_px, 1.0)] * len(points_px)
    extent = (1 + margin) * np.median((high - low)[known], axis=0)
    scale = float(min(size_px[0] / extent[0], size_px[1] / extent[1]))
    frames = np.arange(len(points_px))
    centre = np.stack(
        [np.interp(frames, frames[known], (low + high)[known, axis] / 2) for axis in (0, 1)], axis=1
    )
    centre = gaussian_filter1d(centre, smooth_frames, axis=0, mode="nearest")
    width, height = round(size_px[0] / scale), round(size_px[1] / scale)
    corners = np.rint(centre - [width / 2, height / 2]).astype(int)
    return [Crop(int(left), int(top), width, height, scale) for left, top in corners]


def _extent(points_px: np.ndarray, image_px: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Corner with the least and with the greatest coordinates; the image's without points."""
    points = points_px.reshape(-1, 2)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return np.zeros(2), np.array(image_px, dtype=float)
    return np.quantile(points, 0.005, axis=0), np.quantile(points, 0.995, axis=0)


def lip_colours(triangles: np.ndarray, vermilion: np.ndarray) -> np.ndarray:
    """(V, 3) colours in [0, 1]: light skin, lips slightly red; `triangles` (T, 3), `vermilion` (V,) bool.

    The border is softened over one ring of vertices.
    """
    neighbours = adjacency(triangles, len(vermilion))
    share = vermilion.astype(float)
    share = 0.5 * share + 0.5 * (neighbours @ share) / np.maximum(
        neighbours @ np.ones(len(share)), 1
    )
    return np.array(SKIN) + share[:, None] * (np.array(LIPS) - SKIN)


def overlay_image(
    image: np.ndarray,
    camera: Camera,
    crops: Sequence[Crop],
    meshes: Sequence[tuple[str, np.ndarray | None]],
    triangles: np.ndarray,
    colours: np.ndarray,
    opacity: float,
    caption: str,
) -> np.ndarray:
    """One frame of the video: a column for the original and one a mesh, a row a crop.

    Args:
        image: (h, w, 3) uint8 sRGB, the whole frame.
        crops: of one panel width; the first row carries the labels.
        meshes: (label, (V, 3) world mm) pairs; None where the frame has no mesh.
        triangles: (T, 3) to draw; colours: (V, 3) in [0, 1].
        caption: written into the first panel (take, frame).
    """
    rows: list[np.ndarray] = []
    drawn = [
        ShadedMesh(np.asarray(vertices, dtype=float), triangles, colours)
        if vertices is not None and np.isfinite(vertices).all()
        else None
        for _, vertices in meshes
    ]
    for crop in crops:
        original, near = crop.of_image(image), crop.of_camera(camera)
        rays = near.rays(near.pixel_grid())
        panels, names = [original], [caption]
        for (name, _), mesh in zip(meshes, drawn, strict=True):
            if mesh is not None:
                names.append(name)
                panels.append(mesh.over(original, near, rays, opacity))
            else:
                names.append(f"{name}: not tracked")
                panels.append(original // 2)
        if not rows:
            panels = [label(*pair) for pair in zip(panels, names, strict=True)]
        rows.append(np.hstack(panels))
    width = min(row.shape[1] for row in rows)
    return np.vstack([row[:, :width] for row in rows])


def join_videos(path: str | Path, parts: Sequence[str | Path]) -> None:
    """Put H.264 files of one size and frame rate after one another without encoding again."""
    with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mp4") as target:
        stream, offset = None, 0
        for part in parts:
            with av.open(str(part)) as source:
                given = source.streams.video[0]
                if stream is None:
                    stream = target.add_stream_from_template(given)
                    stream.time_base = given.time_base
                end = 0
                for packet in source.demux(given):
                    if packet.dts is None or packet.pts is None:
                        continue
                    packet.pts += offset
                    packet.dts += offset
                    packet.stream = stream
                    end = max(end, packet.pts + (packet.duration or 0))
                    target.mux(packet)
                offset = end
