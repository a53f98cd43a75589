"""What is wrong with the surface of corrected lips, frame by frame, without any truth.

- folded triangles: two triangles of one lip fold on each other where the base track's do not
- inner mouth: inside of the mouth seen in front of the vermilion by the camera
- edge roughness: how ragged the inner edge of the lips is in the image, beside that of the base track
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.correction.folds import LipFolds, triangles_of_one_lip
from vermilion.faces.contours import LEFT_CORNER, RIGHT_CORNER
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, triangle_areas, triangle_cross, unique_edges
from vermilion.geometry.raycast import RayCaster

#: The inner edge in the image: its height in so many columns between these shares of the mouth's width.
_COLUMNS, _FROM, _TO = 71, 0.15, 0.85
#: Its roughness is what a parabola over so many columns to either side leaves of it.
_REACH = 12


@dataclass(frozen=True)
class SurfaceTolerances:
    """From where on something of the surface is wrong (`evaluation.measures.surface`).

    Attributes:
        inner_mouth_mm: the inside of the mouth counts where it lies this far before the vermilion, ...
        inner_mouth_share: ... and where it hides more than this share of the vermilion that faces the camera.
        rough_ratio: the inner edge is rough from this multiple of the base track's roughness, ...
        rough_mm: ... unless it is smoother than this.
    """

    inner_mouth_mm: float
    inner_mouth_share: float
    rough_ratio: float
    rough_mm: float


@dataclass(frozen=True)
class SurfaceQuality:
    """Of some frames.

    Attributes:
        tolerances: from where on it is wrong.
        folded: (F,) number of lip triangles that are flipped or folded.
        hidden_share: (F,) share of the vermilion that faces the camera and has inner mouth before it.
        roughness_mm: (F,) of the inner edge.
        base_roughness_mm: (F,) of the base track's.
    """

    tolerances: SurfaceTolerances
    folded: np.ndarray
    hidden_share: np.ndarray
    roughness_mm: np.ndarray
    base_roughness_mm: np.ndarray

    @property
    def flipped(self) -> np.ndarray:
        """(F,) bool: a triangle of the lips is flipped or folded."""
        return self.folded > 0

    @property
    def inner_mouth(self) -> np.ndarray:
        """(F,) bool: inner mouth is seen in front of the vermilion."""
        return self.hidden_share > self.tolerances.inner_mouth_share

    @property
    def roughness_ratio(self) -> np.ndarray:
        """(F,) roughness of the inner edge over that of the base track."""
        return self.roughness_mm / np.maximum(self.base_roughness_mm, 1e-9)

    @property
    def rough(self) -> np.ndarray:
        """(F,) bool: the inner edge is rougher than the base track's, as one sees."""
        limits = self.tolerances
        return (self.roughness_ratio > limits.rough_ratio) & (self.roughness_mm > limits.rough_mm)

    def reasons(self) -> list[str]:
        """What is wrong of each frame, F sentences; empty where nothing is."""
        found = []
        inner_mouth, rough, ratio = self.inner_mouth, self.rough, self.roughness_ratio
        for f, folded in enumerate(self.folded):
            parts = [f"{folded} lip triangles flipped or folded"] if folded else []
            if inner_mouth[f]:
                parts.append(f"inner mouth in front of {self.hidden_share[f]:.1%} of the vermilion")
            if rough[f]:
                parts.append(f"inner edge {ratio[f]:.1f} times as rough as the base track's")
            found.append("; ".join(parts))
        return found


class LipSurface:
    """The lips of a topology; build it once.

    Args:
        face: the model that the mesh is of.
        folds: which finds those of that topology.
        tolerances: from where on something is wrong.
    """

    def __init__(self, face: FaceModel, folds: LipFolds, tolerances: SurfaceTolerances):
        self._triangles, self._folds, self._tolerances = face.triangles, folds, tolerances
        red = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
        self._red = np.flatnonzero(red[face.triangles].all(axis=1))
        inside = face.regions["mouth_inner"] & ~red
        self._inside = inside[face.triangles].all(axis=1)
        sides = lip_sides(face, with_inside=True)
        edges = unique_edges(face.triangles[triangles_of_one_lip(sides, face.triangles)])
        self._edges = [edges[sides[edges[:, 0]] == side] for side in (1, -1)]
        self._corners = face.landmarks[[RIGHT_CORNER, LEFT_CORNER]]
        self._ragged = parabola_residuals(_COLUMNS, _REACH)

    def measure(
        self, corrected_mm: np.ndarray, base_mm: np.ndarray, camera: Camera
    ) -> SurfaceQuality:
        """Of corrected meshes (F, V, 3) and the base track's (F, V, 3), in the camera's world, mm."""
        frames = range(len(corrected_mm))
        folded = [len(self._folds.folded_triangles(corrected_mm[f], base_mm[f])) for f in frames]
        hidden = [self._hidden_share(corrected_mm[f], camera) for f in frames]
        return SurfaceQuality(
            self._tolerances,
            np.array(folded, dtype=int),
            np.array(hidden, dtype=float),
            np.array(
                [self.edge_roughness_mm(corrected_mm[f], camera) for f in frames], dtype=float
            ),
            np.array([self.edge_roughness_mm(base_mm[f], camera) for f in frames], dtype=float),
        )

    def edge_roughness_mm(self, vertices_mm: np.ndarray, camera: Camera) -> float:
        """Root mean square of what parabolas leave of the visible inner edges, mm, of `vertices_mm` (V, 3)."""
        heights = self.visible_edges_mm(vertices_mm, camera) @ self._ragged.T
        return float(np.sqrt(np.nanmean(heights**2))) if np.isfinite(heights).any() else 0.0

    def visible_edges_mm(self, vertices_mm: np.ndarray, camera: Camera) -> np.ndarray:
        """Height of what hides the mouth in each column of the image, of the upper lip and of the lower.

        Args:
            vertices_mm: (V, 3) in the camera's world.

        Returns:
            (2, columns) mm at the mouth's distance, above the line through the corners; NaN where a lip has
            none, and of the lower lip where the upper one hides it: closed lips, the inside of the corners.
        """
        ids = np.unique(np.concatenate([self._corners, *(e.ravel() for e in self._edges)]))
        pixels = np.full((len(vertices_mm), 2), np.nan)
        pixels[ids] = camera.project(vertices_mm[ids])
        right, left = pixels[self._corners]
        width = np.linalg.norm(left - right)
        along = (left - right) / width
        up = np.array([along[1], -along[0]])
        place, height = (pixels - right) @ along / width, (pixels - right) @ up
        columns = np.linspace(_FROM, _TO, _COLUMNS)
        result = np.full((2, _COLUMNS), np.nan)
        for row, (edges, extreme) in enumerate(zip(self._edges, (np.fmin, np.fmax), strict=True)):
            start, end = np.sort(place[edges], axis=1).T
            order = np.argsort(place[edges], axis=1)
            low, high = np.take_along_axis(height[edges], order, axis=1).T
            share = (columns[:, None] - start) / np.maximum(end - start, 1e-9)
            crossing = np.where((share >= 0) & (share <= 1), low + share * (high - low), np.nan)
            result[row] = extreme.reduce(crossing, axis=1, initial=np.nan)
        result[1, result[1] > result[0]] = np.nan
        mm_per_px = (
            np.linalg.norm(vertices_mm[self._corners[1]] - vertices_mm[self._corners[0]]) / width
        )
        return result * mm_per_px

    def _hidden_share(self, vertices_mm: np.ndarray, camera: Camera) -> float:
        """Share of the vermilion that faces the camera and has inner mouth before it."""
        corners = self._triangles[self._red]
        middles = vertices_mm[corners].mean(axis=1)
        towards = middles - camera.centre_mm
        distance = np.linalg.norm(towards, axis=1)
        towards = towards / distance[:, None]
        normals = normalised(triangle_cross(vertices_mm, corners))
        facing = (normals * towards).sum(axis=1) < 0
        # The ray caster has single precision: rays start near the mouth.
        start = max(float(distance.min()) - 100.0, 0.0)
        hits = RayCaster(vertices_mm - camera.centre_mm, self._triangles).cast(
            start * towards, towards
        )
        before = hits.hit & (hits.distance_mm + start < distance - self._tolerances.inner_mouth_mm)
        before &= self._inside[np.maximum(hits.triangle, 0)]
        areas = triangle_areas(vertices_mm, corners) * facing
        return float((areas * before).sum() / max(areas.sum(), 1e-9))


def parabola_residuals(count: int, reach: int) -> np.ndarray:
    """(count, count): what a parabola through the neighbours leaves of each of evenly spaced values.

    A line that bends evenly leaves nothing, one that is ragged leaves its teeth.

    Args:
        count: of the values.
        reach: neighbours to either side.
    """
    result = np.eye(count)
    for k in range(count):
        near = np.arange(max(0, k - reach), min(count, k + reach + 1))
        powers = ((near - k)[:, None] / reach) ** np.arange(3)
        result[k, near] -= np.linalg.pinv(powers)[0]
    return result


def surface_figures(quality: SurfaceQuality, row: int) -> dict[str, float]:
    """Columns of a quality row of one frame."""
    return {
        "folded_triangles": float(quality.folded[row]),
        "inner_mouth_share": float(quality.hidden_share[row]),
        "edge_roughness_ratio": float(quality.roughness_ratio[row]),
    }
