"""Constraints on the lips of one frame: on the found contours, never one in the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vermilion.correction.constraints import LinearConstraints
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.features.rings import Ring
from vermilion.geometry.camera import Camera
from vermilion.geometry.surface_points import SurfacePoints

#: How far in one lip another lip may lie (mm), and how far apart they are set then.
SLACK_MM, _APART_MM = 0.01, 0.005


@dataclass(frozen=True)
class LipSamples:
    """Samples on both contours of a mesh, the outer ring first.

    Attributes:
        points: m of them, on edges.
        triangles: (T, 3) of the mesh.
        length_mm: (m,) of contour that each stands for, on the person's neutral.
    """

    points: SurfacePoints
    triangles: np.ndarray
    length_mm: np.ndarray

    def with_inner(self, samples: np.ndarray, points: SurfacePoints) -> LipSamples:
        """The same with inner samples (k,) at other points (k): those that form the contour now."""
        rows = len(self.points) // 2 + samples
        triangle, barycentric = self.points.triangle.copy(), self.points.barycentric.copy()
        triangle[rows], barycentric[rows] = points.triangle, points.barycentric
        return replace(self, points=SurfacePoints(triangle, barycentric))

    @classmethod
    def of(
        cls, outer: Ring, inner: Ring, neutral_mm: np.ndarray, triangles: np.ndarray
    ) -> LipSamples:
        """Of both rings of a face `triangles` (T, 3), with lengths on `neutral_mm` (V, 3), head frame."""
        lengths = []
        for ring in (outer, inner):
            points = ring.points(neutral_mm)
            steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
            lengths.append(np.full(len(ring), steps.mean()))
        start, end, fraction = (
            np.concatenate([getattr(ring, name) for ring in (outer, inner)])
            for name in ("start", "end", "fraction")
        )
        samples = SurfacePoints.on_edges(start, end, fraction, triangles)
        return cls(samples, triangles, np.concatenate(lengths))


def contour_constraints(
    samples: LipSamples,
    vertices_mm: np.ndarray,
    rotation: np.ndarray,
    translation_mm: np.ndarray,
    camera: Camera,
    lines: tuple[np.ndarray, np.ndarray, np.ndarray],
    weight: float,
    robust_mm: float,
    now_mm: np.ndarray | None = None,
) -> LinearConstraints:
    """Each sample projects on its line: point to line in the image, depth free, linearised at the mesh.

    Args:
        vertices_mm: (V, 3) head frame.
        rotation, translation_mm: (3, 3) and (3,), its `world_from_head`.
        lines: (m, 2) points, (m, 2) normals, (m,) known, of `ImageContours.lines`.
        weight: of a millimetre of contour.
        robust_mm: a point this far off counts half.
        now_mm: (V, 3) head frame, the mesh that points are off from, an earlier solution; None: `vertices_mm`.
    """
    points_px, normals, known = lines
    world = samples.points.sample(vertices_mm, samples.triangles) @ rotation.T + translation_mm
    across = np.einsum("mk,mkj->mj", normals, camera.pixel_jacobian(world) @ rotation)
    px_per_mm = np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    off_mm = ((points_px - camera.project(world)) * normals).sum(axis=1) / px_per_mm
    left_mm = off_mm
    if now_mm is not None:
        moved = samples.points.sample(now_mm - vertices_mm, samples.triangles)
        left_mm = off_mm - (moved * across).sum(axis=1) / px_per_mm
    counts = weight * samples.length_mm / (1.0 + (left_mm / robust_mm) ** 2)
    made = LinearConstraints(
        samples.points.corners(samples.triangles), samples.points.barycentric,
        across / px_per_mm[:, None], off_mm,
        1.0 / counts, np.zeros(len(off_mm), dtype=bool),
    )  # fmt: skip
    return made[known & np.isfinite(off_mm)]


def separation_constraints(
    crossings: LipCrossings, before_mm: np.ndarray, now_mm: np.ndarray
) -> tuple[LinearConstraints, float]:
    """(one-sided constraints that separate lips which pass through each other now, greatest depth, mm).

    Args:
        before_mm, now_mm: (V, 3) meshes of one frame; constraints are on displacements from before.
    """
    found = crossings.find(now_mm)
    deepest = found.deepest_mm
    found = found[found.depth_mm > SLACK_MM]
    made = LinearConstraints(
        np.concatenate([found.inside[:, None], found.triangle], axis=1),
        np.concatenate([np.ones((len(found.inside), 1)), -found.barycentric], axis=1),
        found.normal, np.zeros(len(found.inside)), np.full(len(found.inside), 1e-5),
        np.ones(len(found.inside), dtype=bool),
    )  # fmt: skip
    # The plane's equation holds at any of its points, so it does at where the edge enters.
    made.target_mm[:] = _APART_MM - made.evaluate(before_mm)
    return made, deepest
