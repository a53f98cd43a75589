"""A corrected sequence on the user's own head: its vertex order, polygons and texture coordinates.

The head keeps its shape and takes the motion of the sequence, by deformation transfer (Sumner and
Popovic 2004), or takes the person's shape as well. It stands where the sequence's head stands, in its
size, so that it lies on the plate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vermilion.export.animation import Animation, NamedShapes
from vermilion.export.bound_surface import BoundSurface
from vermilion.export.head_binding import HeadBinding
from vermilion.export.head_file import HeadFile
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import Similarity, similarity_alignment
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import connected_parts, unique_edges
from vermilion.landmarks.scheme import JAW
from vermilion.scan.transfer import DeformationTransfer

Shape = Literal["own", "person"]
# Constants, not keys, since they tell parts of a head apart, whose sizes people share. Measured on `python -m
# benchmarks own_head`, whose head has teeth, tongue and eyeballs.
#: Parts that hang on no skin follow it where nearly all of their vertices are nearer: brows, lashes. Half or double the
#: distance, 75 or 99 %: nothing; eyeballs and teeth lie deeper than lashes are long.
_WORN_MM, _WORN_SHARE = 5.0, 90.0
#: Lower teeth and tongue move as the skin round the chin does with the shapes of the jaw alone. Teeth are 0.18 mm off, 0.11
#: with half the radius, 0.29 with half as much again. Not smaller, as few vertices would tell the turn of a jaw without shapes.
_CHIN_MM, _JAW = 22.0, "jaw"


class HeadTransfer:
    """Their head, driven by a sequence of the topology of `face`."""

    def __init__(
        self,
        head: HeadFile,
        binding: HeadBinding,
        face: FaceModel,
        neutral_mm: np.ndarray,
        shapes: NamedShapes,
        shape: Shape = "own",
    ):
        """Prepare a person's head.

        Args:
            head: the file.
            binding: our model laid over it.
            face: the sequence's model, V vertices, with the expressions of the binding.
            neutral_mm: (V, 3) the person's neutral, head frame.
            shapes: the person's named shapes, as the sequence has them.
            shape: whose shape the head has.
        """
        posed = neutral_mm + np.tensordot(binding.weights, shapes.shapes_mm, axes=1)
        steady = face.regions["rigid"] | face.regions["face"]
        move = similarity_alignment(binding.registered_mm[steady], posed[steady])
        #: Length of a unit of the file as the sequence has it, mm.
        self.unit_mm = binding.unit_mm * move.scale
        labels = replace(binding.model, neutral_mm=move.apply(binding.model.neutral_mm))
        driver = replace(face, neutral_mm=move.apply(binding.registered_mm))
        self.labels, self._head, self._driver = labels, head, driver
        self._surface = BoundSurface(labels, driver)
        self._motion = None
        if shape == "own":
            self._motion = DeformationTransfer(
                posed, driver.neutral_mm, face.triangles, face.regions["rigid"]
            )
        self._place = head.place
        if np.array_equal(labels.triangles, head.polygons.triangles):
            self._place = np.arange(len(head.vertices))
        self._jaw, self._still = _parts(labels, driver)
        self._chin = _chin(driver)
        self._jaw_shapes = np.array([name.startswith(_JAW) for name in shapes.names], dtype=bool)
        self._jaw_mm = shapes.shapes_mm[self._jaw_shapes][:, self._chin]
        #: (W, 3) the head of the file in the head frame of the sequence, mm.
        self.rest_mm = self._of_file(labels.neutral_mm)
        none = np.zeros(len(shapes.names))
        person = self.pose(neutral_mm, none)
        self.neutral_mm = self.rest_mm if shape == "own" else person
        named = [
            self.pose(neutral_mm + moved, weights) - person
            for moved, weights in zip(shapes.shapes_mm, np.eye(len(none)), strict=True)
        ]
        self.shapes_mm = np.array(named, dtype=np.float32).reshape(-1, len(self.rest_mm), 3)

    def pose(self, local_mm: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """The head (W, 3) for a mesh of the sequence, both in the head frame.

        Args:
            local_mm: (V, 3).
            weights: (K,) of the named shapes: those of the jaw move the lower teeth.
        """
        return self._of_file(self._welded_pose(local_mm, weights))

    def _welded_pose(self, local_mm: np.ndarray, weights: np.ndarray) -> np.ndarray:
        local_mm = np.asarray(local_mm, dtype=np.float64)
        driven = local_mm if self._motion is None else self._motion.transfer(local_mm[None])[0]
        posed = self._surface.follow(driven, self._surface.gaps_mm(local_mm))
        posed[self._still] = self.labels.neutral_mm[self._still]
        if self._jaw.any():
            rest = self._driver.neutral_mm[self._chin]
            moved = driven[self._chin]
            if len(self._jaw_mm):
                moved = rest + np.tensordot(weights[self._jaw_shapes], self._jaw_mm, axes=1)
            jaw = similarity_alignment(rest, moved, scale=1.0)
            posed[self._jaw] = jaw.apply(self.labels.neutral_mm[self._jaw])
        return posed

    def vertices_mm(self, coarse: Animation, row: int) -> np.ndarray:
        """Vertices (W, 3) of frame `row` of the sequence, world; NaN where it has no mesh."""
        local = _local(coarse, row)
        if not np.isfinite(local).all():
            return np.full((len(self._place), 3), np.nan)
        return coarse.head.to_world(row, self.pose(local, coarse.shapes.weights[row]))

    def gaps_mm(self, coarse: Animation, row: int) -> tuple[np.ndarray, np.ndarray]:
        """Heights (K,) of the opening along the lips in frame `row`: of the sequence, of the head."""
        local = _local(coarse, row)
        posed = self._welded_pose(local, coarse.shapes.weights[row])
        return self._surface.gaps_mm(local), self._surface.own_gaps_mm(posed)

    def animation(self, coarse: Animation, vertices_mm: np.ndarray) -> Animation:
        """The sequence with this mesh, whose vertices_mm are (F, W, 3), world."""
        uv, corners = self._head.uv, self._head.uv_corners
        if uv is None:  # our own texture coordinates, carried over
            uv, corners = self._of_file(self.labels.uv), None
        return replace(
            coarse, vertices_mm=vertices_mm, polygons=self._head.polygons, uv=uv, uv_corners=corners,
            neutral_mm=self.neutral_mm, shapes=replace(coarse.shapes, shapes_mm=self.shapes_mm),
        )  # fmt: skip

    @property
    def head_from_file(self) -> Similarity:
        """From the unit and frame of the file to the head frame, mm."""
        used = self._place >= 0
        return similarity_alignment(self._head.vertices[used], self.rest_mm[used])

    @property
    def lips(self) -> np.ndarray:
        """(W,) bool, the vermilion."""
        return self.region("vermilion_upper") | self.region("vermilion_lower")

    def region(self, name: str) -> np.ndarray:
        """(W,) bool, a region of `FaceModel` on the head's vertices."""
        return self.labels.regions[name][self._place] & (self._place >= 0)

    def carried(self, values: np.ndarray) -> np.ndarray:
        """The `values` (V, c) of the sequence's vertices at the nearest vertices of the head, (W, c)."""
        surface = Surface(self._driver.neutral_mm, self._driver.triangles)
        at = surface.closest(self.rest_mm)
        return at.sample(np.asarray(values, dtype=np.float64), self._driver.triangles)

    def _of_file(self, values: np.ndarray) -> np.ndarray:
        """Values (Y, c) of the welded vertices at the file's (W, c); of unused vertices those at rest."""
        result = np.asarray(values, dtype=np.float64)[self._place]
        unused = self._place < 0
        if unused.any():
            result[unused] = 0.0
        return result


@dataclass(frozen=True)
class _Part:
    """A part of the head that hangs on no skin.

    Attributes:
        vertices: (n,) ids.
        worn: whether it lies on the skin.
        below: whether it belongs to the lower jaw.
    """

    vertices: np.ndarray
    worn: bool
    below: bool


def _parts(labels: FaceModel, driver: FaceModel) -> tuple[np.ndarray, np.ndarray]:
    """(Y,) bool: vertices that move with the jaw, and those that stay in the head."""
    jaw = np.zeros(labels.n_vertices, dtype=bool)
    still = jaw.copy()
    for part in _loose(labels, driver):
        if not part.worn:
            (jaw if part.below else still)[part.vertices] = True
    return jaw, still


def _loose(labels: FaceModel, driver: FaceModel) -> list[_Part]:
    number = connected_parts(unique_edges(labels.triangles), labels.n_vertices)
    skin = int(np.bincount(number[labels.landmarks]).argmax())
    away = Surface(driver.neutral_mm, driver.triangles).closest(labels.neutral_mm).distance_mm
    assert away is not None
    mouth = float(labels.neutral_mm[labels.inner_contour, 1].mean())
    parts = []
    for k in np.setdiff1d(np.unique(number), [skin]):
        vertices = np.flatnonzero(number == k)
        middle = float(labels.neutral_mm[vertices, 1].mean())
        of_mouth = bool(labels.regions["teeth"][vertices].any())
        worn = not of_mouth and float(np.percentile(away[vertices], _WORN_SHARE)) < _WORN_MM
        parts.append(_Part(vertices, worn, of_mouth and middle < mouth))
    return parts


def _chin(model: FaceModel) -> np.ndarray:
    """(V,) bool, the skin round the chin."""
    chin = model.neutral_mm[model.landmarks[JAW[len(JAW) // 2]]]
    lips = model.regions["vermilion_lower"] | model.regions["vermilion_upper"]
    near = np.linalg.norm(model.neutral_mm - chin, axis=1) < _CHIN_MM
    return near & ~lips & ~model.regions["mouth_inner"]


def _local(coarse: Animation, row: int) -> np.ndarray:
    """Vertices (V, 3) of a frame in the head frame."""
    return coarse.head.to_head(row, np.asarray(coarse.vertices_mm[row], dtype=np.float64))
