"""A mesh sequence with all that a file of another program says of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.geometry.polygons import Polygons


@dataclass(frozen=True)
class HeadFrame:
    """Pose of the head in every frame: world = rotation @ head + translation.

    Attributes:
        rotation: (F, 3, 3) world from head.
        translation_mm: (F, 3).
    """

    rotation: np.ndarray
    translation_mm: np.ndarray

    def to_head(self, row: int, vertices_mm: np.ndarray) -> np.ndarray:
        """The `vertices_mm` (V, 3) of frame `row`, world, in the head frame."""
        return (vertices_mm - self.translation_mm[row]) @ self.rotation[row]

    def to_world(self, row: int, vertices_mm: np.ndarray) -> np.ndarray:
        """The `vertices_mm` (V, 3) of the head frame in the world of frame `row`."""
        return vertices_mm @ self.rotation[row].T + self.translation_mm[row]


@dataclass(frozen=True)
class NamedShapes:
    """Blend shapes and their weights.

    Attributes:
        names: K names.
        shapes_mm: (K, V, 3) displacements at weight 1, head frame; of a `ShapeBasis` what gives them one by one.
        weights: (F, K).
    """

    names: tuple[str, ...]
    shapes_mm: Any
    weights: np.ndarray


@dataclass(frozen=True)
class Animation:
    """What is exported of a take.

    Attributes:
        frames: (F,) increasing frame numbers.
        fps: frames a second.
        vertices_mm: (F, V, 3) world, or what gives a frame's by its row; memory-mapped where it is long.
            A frame that is not finite has no mesh, and is left out of the files.
        polygons: of the V vertices.
        neutral_mm: (V, 3) the person's neutral, head frame.
        head: pose of the head in every frame.
        shapes: of the base track: what the named blend shapes contribute.
        unit_mm: length of a unit in the files.
        uv: (V, 2), v up; None: the mesh has none.
        uv_corners: (N,) row of `uv`, then (M, 2), of each corner of the polygons, where the mesh has seams;
            None: each vertex has its own.
        camera: of the plate; None: no camera is written.
        albedo: texture file, relative to the exported files; None: none.
        plate: pattern of undistorted image files, relative, with `{frame}`; None: none.
        up: axis of the files that points up, `y` or `z`; None: y, and a world whose y points down is
            turned.
    """

    frames: np.ndarray
    fps: float
    vertices_mm: Any
    polygons: Polygons
    neutral_mm: np.ndarray
    head: HeadFrame
    shapes: NamedShapes
    unit_mm: float
    uv: np.ndarray | None = None
    camera: Camera | None = None
    albedo: str | None = None
    plate: str | None = None
    up: str | None = None
    uv_corners: np.ndarray | None = None

    @cached_property
    def rows(self) -> list[int]:
        """Rows of the frames that have a mesh."""
        return [row for row in range(len(self.frames)) if np.isfinite(self.vertices_mm[row]).all()]

    @property
    def turned_upright(self) -> bool:
        """Whether the world's y points down (an uncalibrated video's world is its camera)."""
        downwards = self.camera is not None and bool(self.camera.rotation[1, 1] > 0)
        return self.up is None and downwards

    def cut_at_seams(self) -> SeamCut:
        """The mesh with a vertex for each of its texture coordinates, for formats that have no seams."""
        count = len(self.neutral_mm)
        if self.uv is None or self.uv_corners is None:
            return SeamCut(np.arange(count), self.polygons, self.uv)
        pairs = np.stack([self.polygons.corners, self.uv_corners], axis=1).astype(np.int64)
        found, same = np.unique(pairs, axis=0, return_inverse=True)
        # The first of a vertex keeps its number, the others follow the last.
        is_first = np.append(True, found[1:, 0] != found[:-1, 0])
        number = np.where(is_first, found[:, 0], count + np.cumsum(~is_first) - 1)
        source = np.concatenate([np.arange(count), found[~is_first, 0]])
        uv = np.zeros((len(source), 2))
        uv[number] = self.uv[found[:, 1]]
        corners = number[same.reshape(-1)].astype(np.int32)
        return SeamCut(source, Polygons(self.polygons.counts, corners), uv)


@dataclass(frozen=True)
class SeamCut:
    """A mesh that is cut at the seams of its texture.

    Attributes:
        source: (W,) vertex of the whole mesh that each is; the first V are its own, in order.
        polygons: of the W vertices.
        uv: (W, 2), v up; None: the mesh has none.
    """

    source: np.ndarray
    polygons: Polygons
    uv: np.ndarray | None
