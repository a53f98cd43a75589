"""Sketch-based refinement of one frame (Guided18 section 5, eq. 1).

E = lambda_pos E_pos + lambda_silh E_silh + lambda_reg E_reg, solved five times. Each iteration starts
from the mesh of the one before: E_pos and E_reg keep that mesh's positions and Laplacian, so that it
deforms slowly, and silhouettes are found anew. For the displacements x of an iteration

    E = sum_i lambda_pos,i |x_i|^2 + lambda_reg |L x|^2 + lambda_silh sum_p |r_p - (v_p + x_p)|^2 ,

and only the last term changes: the matrix of the first two is factored once a topology, the rays are
constraints beside it (`ConstrainedEnergy`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.correction.constraints import LinearConstraints
from vermilion.correction.lip_constraints import SLACK_MM, separation_constraints
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import adjacency
from vermilion.geometry.sparse import CholeskyFactor
from vermilion.guided.constrained_energy import ConstrainedEnergy
from vermilion.guided.curves import mouth_axes, press_together, resampled
from vermilion.guided.regions import GuidedRegions, movable_vertices
from vermilion.guided.silhouette import ContourSurface, Segments, inner_silhouettes, outer_contours
from vermilion.guided.sketch import Sketch
from vermilion.storage.errors import InputError

_SEPARATION_ROUNDS = 3
_SEPARATION_ROUNDS_LAST = 8


@dataclass(frozen=True)
class RefinementSettings:
    """Weights of eq. 1; the defaults are the paper's.

    Attributes:
        position: lambda_pos of a vertex.
        still: lambda_pos of a vertex that should not move.
        silhouette: lambda_silh of a pixel of a contour.
        regularity: lambda_reg.
        iterations: solves.
        near_share: weight of a pixel of a curve that is only near.
        samples: points of a curve; where it is longer in pixels, each stands for several.
    """

    position: float = 0.1
    still: float = 1.0
    silhouette: float = 1.0
    regularity: float = 3.0
    iterations: int = 5
    near_share: float = 0.1
    samples: int = 40


@dataclass(frozen=True)
class Refined:
    """A refined frame.

    Attributes:
        vertices_mm: (V, 3).
        distance_px: camera name -> curve name -> (n,) distance of the contour of the result from
            samples of the sketch.
        depth_mm: how deep one lip lies in the other; 0 without contact.
    """

    vertices_mm: np.ndarray
    distance_px: dict[str, dict[str, np.ndarray]]
    depth_mm: float

    @property
    def mean_px(self) -> float:
        """Mean distance of all samples of all curves."""
        every = [d for curves in self.distance_px.values() for d in curves.values()]
        return float(np.concatenate(every).mean())


@dataclass(frozen=True)
class SketchView:
    """A sketch, the camera that took the image, and its curves made ready.

    Attributes:
        camera: of the image, world as the meshes.
        up: (2,) across the mouth in the image.
        samples: curve name -> (n, 2) px, lips that press already together.
        weights: curve name -> weight of each sample.
    """

    camera: Camera
    up: np.ndarray
    samples: dict[str, np.ndarray]
    weights: dict[str, float]

    @classmethod
    def of(cls, sketch: Sketch, camera: Camera, settings: RefinementSettings) -> SketchView:
        """Raises InputError where the sketch is not one of the camera's image."""
        size = (camera.width_px, camera.height_px)
        if tuple(sketch.image_size_px) != size:
            raise InputError(
                f"a sketch on an image of {sketch.image_size_px[0]} x {sketch.image_size_px[1]}",
                f"{size[0]} x {size[1]}, as the camera has",
                "Draw on the camera's own image, not on a resized one.",
                camera=camera.name,
                frame=sketch.frame,
            )
        along, up = mouth_axes([curve.points_px for curve in sketch.curves.values()])
        samples, weights = {}, {}
        for name, curve in sketch.curves.items():
            samples[name], step = resampled(curve.points_px, 1.0, settings.samples)
            share = 1.0 if curve.kind == "sure" else settings.near_share
            weights[name] = settings.silhouette * share * max(step, 1e-3)
        for part in ("inner", "outer"):
            names = f"upper_{part}", f"lower_{part}"
            if all(name in samples for name in names):
                upper, lower = (samples[name] for name in names)
                samples[names[0]], samples[names[1]], *_ = press_together(upper, lower, along, up)
        return cls(camera, up, samples, weights)

    def contours(self, vertices_mm: np.ndarray, surface: ContourSurface) -> dict[str, Segments]:
        """Curve name -> where that contour of a mesh vertices_mm (V, 3) is now.

        Raises InputError where the camera sees no such contour.
        """
        inner = inner_silhouettes(vertices_mm, surface, self.camera, self.up)
        outer = outer_contours(vertices_mm, surface, self.camera)
        names = ("upper_inner", "lower_inner", "upper_outer", "lower_outer")
        found = dict(zip(names, (*inner, *outer), strict=True))
        for name in self.samples:
            if len(found[name]) == 0:
                raise InputError(
                    f"no contour {name} on the mesh in this camera",
                    "lips turned towards the camera, and outer contours only with a face model",
                    "Draw in a camera that faces the mouth, or leave this curve out.",
                    camera=self.camera.name,
                )
        return {name: found[name] for name in self.samples}


class SketchRefiner:
    """Refines frames of one topology; factors on construction.

    Attributes:
        movable: (N,) vertices that may move: the mouth region without its rim. The rest of the face
            stays as it is, to the last bit.
    """

    def __init__(
        self,
        regions: GuidedRegions,
        surface: ContourSurface,
        crossings: LipCrossings | None = None,
        settings: RefinementSettings | None = None,
    ):
        """Prepare a topology.

        Args:
            surface: where contours are looked for (`ContourSurface.of_face`, `.of_regions`).
            crossings: the lips, to separate where one would pass through the other; None: the paper.
        """
        self.settings = settings or RefinementSettings()
        self.movable = movable_vertices(regions)
        self._surface, self._crossings = surface, crossings
        position = np.full(regions.n_vertices, self.settings.position)
        position[regions.followers] = self.settings.still  # hidden inside the mouth
        matrix = keeping_matrix(regions, self.movable, position, self.settings.regularity)
        self._energy = ConstrainedEnergy(CholeskyFactor(matrix), self.movable, regions.n_vertices)

    def refine(self, vertices_mm: np.ndarray, views: Sequence[tuple[Sketch, Camera]]) -> Refined:
        """Move the lips of a mesh (V, 3) onto the sketches of one frame, of one camera or several.

        Args:
            vertices_mm: (V, 3) in the world of the cameras.
            views: sketches and the cameras of their images.

        Raises:
            InputError: no sketch, a sketch of another image, a mesh that is not finite, or a camera
                that does not see the contour.
        """
        ready = [SketchView.of(sketch, camera, self.settings) for sketch, camera in views]
        if not ready:
            raise InputError("no sketch", "one or more of the frame", "Draw the lips first.")
        current = np.array(vertices_mm, dtype=np.float64)
        if not np.isfinite(current[self.movable]).all():
            raise InputError(
                "a mesh that is not finite round the mouth",
                "finite vertices",
                "Choose another frame; this one was not reconstructed.",
            )
        for iteration in range(self.settings.iterations):
            rays = _joined([self._view_constraints(current, view) for view in ready])
            last = iteration == self.settings.iterations - 1
            rounds = _SEPARATION_ROUNDS_LAST if last else _SEPARATION_ROUNDS
            current = self._solved(current, rays, rounds)
        distance = {view.camera.name: self._distances(current, view) for view in ready}
        depth = self._crossings.find(current).deepest_mm if self._crossings else 0.0
        return Refined(current, distance, depth)

    def _view_constraints(self, vertices_mm: np.ndarray, view: SketchView) -> LinearConstraints:
        found = []
        for name, segments in view.contours(vertices_mm, self._surface).items():
            points, _ = segments.nearest(view.samples[name])
            at_mm = points.sample(vertices_mm, self._surface.triangles)
            corners = points.corners(self._surface.triangles)
            rays = (view.camera, view.samples[name], view.weights[name])
            found.append(ray_constraints(corners, points.barycentric, at_mm, *rays))
        return _joined(found)

    def _solved(self, start: np.ndarray, rays: LinearConstraints, rounds: int) -> np.ndarray:
        """One solve from `start`, and more where lips would pass through each other."""
        moved = start.copy()
        moved[self.movable] += self._energy.minimise(rays)
        if self._crossings is None:
            return moved
        constraints = rays
        for _ in range(rounds):
            separation, deepest = separation_constraints(self._crossings, start, moved)
            if deepest <= SLACK_MM:
                break
            constraints = constraints + separation
            moved = start.copy()
            moved[self.movable] += self._energy.minimise(constraints)
        return moved

    def _distances(self, vertices_mm: np.ndarray, view: SketchView) -> dict[str, np.ndarray]:
        found = view.contours(vertices_mm, self._surface)
        return {name: found[name].nearest(view.samples[name])[1] for name in found}


def ray_constraints(
    vertices: np.ndarray,
    coefficients: np.ndarray,
    points_mm: np.ndarray,
    camera: Camera,
    pixels: np.ndarray,
    weight: float,
) -> LinearConstraints:
    """Two constraints a pixel that bring a point of the mesh onto the pixel's ray; depth is free.

    Args:
        vertices, coefficients: (P, k) ids and weights of the vertices that carry each point.
        points_mm: (P, 3) where the points are now, world.
        camera: of the image.
        pixels: (P, 2) px.
        weight: of a pixel.
    """
    origins, rays = camera.rays(pixels)
    helper = np.where(np.abs(rays[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(rays, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    directions = np.concatenate([first, np.cross(rays, first)])
    off = np.tile(origins - points_mm, (2, 1))
    count = len(directions)
    return LinearConstraints(
        np.tile(vertices, (2, 1)), np.tile(coefficients, (2, 1)), directions,
        (off * directions).sum(axis=1), np.full(count, 1.0 / weight), np.zeros(count, dtype=bool),
    )  # fmt: skip


def keeping_matrix(
    regions: GuidedRegions, movable: np.ndarray, position: np.ndarray, regularity: float
) -> sparse.csr_matrix:
    """Matrix (N, N) of sum_i lambda_i |x_i|^2 + lambda_reg |L x|^2 over the movable vertices (N,).

    `position` (V,) has the lambda_i.

    L = D - A, the symmetric Laplacian of Sorkine et al. 2004; rows of vertices that stay count,
    too, so that the rim shows no crease.
    """
    near = adjacency(regions.triangles, regions.n_vertices)
    laplacian = sparse.diags_array(np.asarray(near.sum(axis=1)).ravel()) - near
    columns = sparse.csr_matrix(laplacian)[:, movable]
    keeping = sparse.diags_array(position[movable]) + regularity * (columns.T @ columns)
    return sparse.csr_matrix(keeping)


def _joined(parts: list[LinearConstraints]) -> LinearConstraints:
    total = parts[0]
    for more in parts[1:]:
        total = total + more
    return total
