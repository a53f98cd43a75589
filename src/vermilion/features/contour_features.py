"""Contours and distances of a frame, from the coarse mesh and the likelihood maps (Lips16 5.1)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vermilion.contours.curves import inward_normals, smoothed_ring
from vermilion.faces.model import FaceModel
from vermilion.features.distances import contour_distances
from vermilion.features.rings import Ring, lip_rings
from vermilion.features.search import SearchSettings, find_inner, find_outer
from vermilion.geometry.camera import Camera
from vermilion.landmarks.scheme import EYE_CORNERS


@dataclass(frozen=True)
class FrameContours:
    """Contours of a frame.

    Attributes:
        distances: (20,) of `distances.NAMES`.
        outer_px, inner_px: (n, 2).
        model_outer_px, model_inner_px: (n, 2) the coarse mesh's own.
        outer_found, inner_found: (n,) bool; elsewhere the model's contour stands in.
        interocular_px: inter-ocular distance in the image.
    """

    distances: np.ndarray
    outer_px: np.ndarray
    inner_px: np.ndarray
    model_outer_px: np.ndarray
    model_inner_px: np.ndarray
    outer_found: np.ndarray
    inner_found: np.ndarray
    interocular_px: float


@dataclass(frozen=True)
class ContourSampler:
    """Finds contours from coarse meshes of one face model; build it once.

    Attributes:
        outer, inner: rings of samples on the model.
        eye_corners: two vertices.
        settings: of the search.
    """

    outer: Ring
    inner: Ring
    eye_corners: np.ndarray
    settings: SearchSettings = field(default_factory=SearchSettings)

    @classmethod
    def of(cls, model: FaceModel, n_samples: int, settings: SearchSettings) -> ContourSampler:
        """On the lips of a face model, `n_samples` (a multiple of 20) a ring."""
        outer, inner = lip_rings(model, n_samples)
        return cls(outer, inner, model.landmarks[EYE_CORNERS], settings)

    def find(
        self,
        vertices_mm: np.ndarray,
        camera: Camera,
        maps: tuple[np.ndarray, np.ndarray] | None,
        pose: tuple[np.ndarray, np.ndarray] | None = None,
        lips_px: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> FrameContours:
        """Contours and distances of a coarse mesh.

        Args:
            vertices_mm: (V, 3) in the world.
            camera: of the images.
            maps: likelihood maps (inner, outer), (h, w) each; None: the model's own contours are
                given, none of them found.
            pose: rotation (3, 3) and translation (3,) mm of `world_from_head`: the search and the
                distances are in the head frame, where a turn of the head is undone (Lips16 7).
                None: they are in the image (Lips16 5.1).
            lips_px: rings (m, 2) of dense landmarks, outer and inner: they tell how thick the lips are, as
                the model's do not where it rolls another lip. None: the model's tell.
        """
        rotation, translation = pose or (np.eye(3), np.zeros(3))

        def to_pixels(points: np.ndarray) -> np.ndarray:
            return points if pose is None else camera.project(points @ rotation.T + translation)

        unit = unit_px = facing_interocular_px(vertices_mm[self.eye_corners], camera)
        model_outer, model_inner = (r.points(vertices_mm) for r in (self.outer, self.inner))
        if pose is None:
            model_outer, model_inner = camera.project(model_outer), camera.project(model_inner)
        else:
            unit = float(np.linalg.norm(np.diff(vertices_mm[self.eye_corners], axis=0)))
            model_outer, model_inner = (
                (points - translation) @ rotation for points in (model_outer, model_inner)
            )

        outer, inner = model_outer, model_inner
        outer_found = inner_found = np.zeros(len(outer), dtype=bool)
        if maps is not None:
            found = find_outer(maps[1], outer, unit, self.settings, to_pixels)
            outer, outer_found = found.points, found.found
            lips, thickness = model_inner - model_outer, None
            if lips_px is not None:
                thickness = lip_thickness(*lips_px, len(outer)) / unit_px
            found = find_inner(maps[0], outer, lips, unit, self.settings, to_pixels, thickness)
            inner, inner_found = found.points, found.found
        return FrameContours(
            contour_distances(outer, inner, unit),
            to_pixels(outer),
            to_pixels(inner),
            to_pixels(model_outer),
            to_pixels(model_inner),
            outer_found,
            inner_found,
            unit_px,
        )


def lip_thickness(outer_px: np.ndarray, inner_px: np.ndarray, n: int) -> np.ndarray:
    """How far (n,) px rings `outer_px`, `inner_px` (m, 2) lie apart, at n samples as evenly spaced as theirs."""
    apart = ((inner_px - outer_px) * inward_normals(smoothed_ring(outer_px, 4))).sum(axis=1)
    places = np.arange(n) * (len(apart) / n)
    return np.interp(places, np.arange(len(apart) + 1), np.append(apart, apart[0]))


def facing_interocular_px(corners_mm: np.ndarray, camera: Camera) -> float:
    """Distance of eye corners `corners_mm` (2, 3), world, as it would look parallel to the image, px.

    Unlike the distance of the projected corners it does not shrink when the head turns.
    """
    half = 0.5 * np.linalg.norm(corners_mm[1] - corners_mm[0]) * camera.rotation[0]
    middle = corners_mm.mean(axis=0)
    ends = camera.project(np.stack([middle - half, middle + half]))
    return float(np.linalg.norm(ends[1] - ends[0]))
