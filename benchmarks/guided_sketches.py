"""Guided correction as users do it: C of a finished run, a few frames sketched, the rest measured.

Sketches are drawn from the true contours with a hand's error (1 px at a mouth of 120 px, smooth along the stroke;
inner and outer contours). Chosen frames are refined, train, and correct the take. Figure: motion error of the inner
lips over the other frames (each vertex's mean offset over all frames removed, head frame, after one rigid alignment
a frame), as a share of that of C. Bars: 10 sketched frames 45 %, with two cameras a frame 35 %, no frame within
0.3 mm gets worse by over 0.1 mm, 5 suggested reach the median of 10 random. Beside it true meshes of the same frames.

Needs the truth of a face model's studio topology (`--truth`).
"""

from __future__ import annotations

import argparse
from functools import cache

import numpy as np

from benchmarks.common import add_run_arguments
from benchmarks.drawn_sketch import Hand, drawn_sketch
from benchmarks.finished_run import FinishedRun
from vermilion.faces.lips import lip_sides_by_distance, triangle_sides
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, vertex_normals
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.guided.propagation import LipPropagator
from vermilion.guided.refinement import SketchRefiner
from vermilion.guided.regions import regions_of_face
from vermilion.guided.silhouette import ContourSurface
from vermilion.guided.suggestion import (
    extreme_frames,
    mouth_deformation,
    random_frames,
    suggest_frames,
    uniform_frames,
)
from vermilion.studio.surface import surface_of

#: jawOpen of a tracker's neutral.
SLIGHT_OPEN = 0.09


def true_points(tracker: FaceModel, studio: FaceModel) -> tuple[SurfacePoints, np.ndarray]:
    """Where each of the tracker's V vertices lies on the studio's surface, and its triangles (T, 3)."""
    jaw = studio.expressions_mm[studio.expression_names.index("jawOpen")]
    rest = studio.neutral_mm + SLIGHT_OPEN * jaw
    skin = studio.regions["face"] | studio.regions["mouth_inner"]
    triangles = studio.triangles[skin[studio.triangles].all(axis=1)]
    mesh = Mesh(tracker.neutral_mm, tracker.triangles)
    sides = lip_sides_by_distance(mesh, tracker.regions)
    of_studio = lip_sides_by_distance(Mesh(rest, triangles), studio.regions)
    normals = vertex_normals(tracker.neutral_mm, tracker.triangles)
    found = Surface(rest, triangles).closest(
        tracker.neutral_mm, normals, 0.3, sides, triangle_sides(triangles, of_studio)
    )
    return found, triangles


class SketchTrial:
    """C of a take with its truth in C's topology and pose, and sketches of any frame."""

    def __init__(self, run: FinishedRun, outer: bool):
        self.face, self.studio = run.model("tracker"), run.model("studio")
        where, triangles = true_points(self.face, self.studio)
        vertices = np.asarray(run.true_mm()).astype(np.float64)
        base = np.asarray(run.coarse_mm()).astype(np.float64)
        true = where.sample(vertices, triangles)
        self.stable = np.flatnonzero(self.face.regions["rigid"])
        self.regions = regions_of_face(self.face)
        self.neutral = run.identity().neutral_mm
        self.cameras = run.cameras()
        if len(self.cameras) > 1:
            # A rig's cameras are true: C goes where the head truly is.
            self.base, self.true, self.drawn = self._posed(base, true), true, vertices
        else:
            self.cameras = {run.fit().camera.name: run.fit().camera}
            self.base, self.true = base, self._posed(true, base)
            moved = [self._motion(a, b) for a, b in zip(true, base, strict=True)]
            self.drawn = np.stack([m.apply(v) for m, v in zip(moved, vertices, strict=True)])
        self.deformation = mouth_deformation(self.base, self.neutral, self.regions, self.stable)
        self.refiner = SketchRefiner(self.regions, ContourSurface.of_face(self.face, self.regions))
        self._surface, self._hand = surface_of(self.studio), Hand(outer=outer)
        self._before = self.motion_error(self.base)

    @cache  # noqa: B019  one trial a run
    def refined(self, frame: int, cameras: tuple[str, ...]) -> np.ndarray:
        """The frame's mesh (V, 3) after sketches in some cameras; none: the truth."""
        if not cameras:
            return self.true[frame]
        views = [
            (
                drawn_sketch(
                    self.studio, self._surface, self.drawn[frame], self.cameras[name], frame,
                    self._hand,
                ),
                self.cameras[name],
            )
            for name in cameras
        ]  # fmt: skip
        return self.refiner.refine(self.base[frame], views).vertices_mm

    def motion_error(self, meshes: np.ndarray) -> np.ndarray:
        """(F,) mm of meshes (F, V, 3): inner lips, mean offset removed, head frame."""
        free = self.regions.free
        offset = self._posed(meshes, self.true)[:, free] - self.true[:, free]
        turns = [self._motion(mesh, self.neutral).rotation for mesh in self.true]
        offset = offset @ np.swapaxes(np.stack(turns), 1, 2)
        return np.linalg.norm(offset - offset.mean(axis=0), axis=2).mean(axis=1)

    def left(
        self, frames: np.ndarray, cameras: tuple[str, ...], whole: bool
    ) -> tuple[float, float]:
        """(share left over the other frames, mm by which a frame that was right got worse)."""
        corrected = np.stack([self.refined(int(frame), cameras) for frame in frames])
        propagator = LipPropagator(self.neutral, self.regions, self.stable)
        propagator.fit(corrected, self.base[frames], whole=whole)
        after = self.motion_error(propagator.correct(self.base).vertices_mm)
        others = np.ones(len(after), dtype=bool)
        others[frames] = False
        good = others & (self._before < 0.3)
        worse = (after - self._before)[good].max(initial=0.0)
        return after[others].sum() / self._before[others].sum(), float(worse)

    def _motion(self, mesh: np.ndarray, target: np.ndarray):
        return similarity_alignment(mesh[self.stable], target[self.stable], scale=1.0)

    def _posed(self, meshes: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Meshes (F, V, 3) moved rigidly onto others by the vertices that expressions do not move."""
        pairs = zip(meshes, targets, strict=True)
        return np.stack([self._motion(mesh, target).apply(mesh) for mesh, target in pairs])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which run, which cameras."""
    add_run_arguments(parser, truth=True)
    parser.add_argument(
        "--cameras", nargs="+", default=["face2", "face2,lip2", "lip0,lip2"],
        help="sets of cameras, names joined by commas (%(default)s)",
    )  # fmt: skip
    parser.add_argument("--draws", type=int, default=20, help="random choices (%(default)s)")
    parser.add_argument("--inner-only", action="store_true", help="no outer contours")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    trial = SketchTrial(FinishedRun.of(arguments), outer=not arguments.inner_only)
    count, error = len(trial.base), trial.motion_error(trial.base)
    print(f"{count} frames, motion error of the inner lips of C {error.mean():.2f} mm, "
          f"{(error < 0.3).sum()} frames within 0.3 mm")  # fmt: skip
    print("share left in the other frames (%); worst frame that was right (mm)")
    sets = [(), *(tuple(names.split(",")) for names in arguments.cameras)]
    for cameras in sets:
        for whole in (False, True):
            cells = []
            for k in (3, 5, 10):
                chosen = {
                    "suggested": suggest_frames(trial.deformation, k),
                    "uniform": uniform_frames(count, k),
                    "extremes": extreme_frames(trial.deformation, k),
                }
                for name, frames in chosen.items():
                    share, worse = trial.left(frames, cameras, whole)
                    cells.append(f"{name} {100 * share:.0f} ({worse:.2f})")
                draws = [random_frames(count, k, seed) for seed in range(arguments.draws)]
                shares = [trial.left(frames, cameras, whole)[0] for frames in draws]
                cells.append(f"random {100 * np.median(shares):.0f} | ")
            label = "+".join(cameras) or "true meshes"
            print(f"{label:14s} {'mouth' if whole else 'change':6s} | k = 3, 5, 10 | "
                  + ", ".join(cells), flush=True)  # fmt: skip
