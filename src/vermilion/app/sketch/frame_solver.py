"""Solve: a frame moved onto its sketches at once, by the same code as the workflow's job."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from vermilion.app.sketch.refusal import RefusedRequest
from vermilion.app.sketch.sketch_store import SketchStore
from vermilion.app.sketch.take_data import TakeData
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.guided.refined_frame import RefinedFrame
from vermilion.guided.refinement import Refined, RefinementSettings, SketchRefiner
from vermilion.guided.silhouette import ContourSurface
from vermilion.storage.errors import VermilionError

#: A contour that stays further off its stroke in the mean did not converge; its ends often stay off.
OFF_PX = 1.0


@dataclass(frozen=True)
class Solved:
    """A solved frame.

    Attributes:
        vertices_mm: (V, 3), world.
        revisions: (camera, revision) of the sketches that it was solved with.
        summary: what the page says of it.
    """

    vertices_mm: np.ndarray
    revisions: tuple[tuple[str, str], ...]
    summary: dict[str, Any]


class FrameSolver:
    """Refines frames of one take, one at a time; factors once."""

    def __init__(self, data: TakeData, surface: ContourSurface, store: SketchStore):
        self._data, self._surface, self._store = data, surface, store
        self._lock = threading.Lock()
        self._refiner: SketchRefiner | None = None
        self._solved: dict[int, Solved] = {}

    def prepare(self) -> SketchRefiner:
        """Factor the topology, once."""
        with self._lock:
            if self._refiner is None:
                guided = self._data.files.guided
                self._refiner = SketchRefiner(
                    self._data.regions,
                    self._surface,
                    crossings=LipCrossings(self._data.face) if guided.contact else None,
                    settings=RefinementSettings(**guided.refinement.model_dump()),
                )
            return self._refiner

    def solve(self, frame: int) -> dict[str, Any]:
        """Refine a frame onto its sketches in all cameras; what came of it, for the page.

        Raises RefusedRequest (404, 422), InputError where a sketch cannot be used.
        """
        base = self._data.base(frame)
        stored = self._store.sketches_of(frame)
        broken = [s.problem for s in stored.values() if s.sketch is None]
        if broken:
            raise RefusedRequest(422, broken[0])
        if not stored:
            raise RefusedRequest(422, f"Frame {frame} has no sketch yet: draw the lips first.")
        views = [(s.sketch, self._data.cameras[name]) for name, s in stored.items() if s.sketch]
        refiner = self.prepare()
        with self._lock:
            start = time.perf_counter()
            refined = refiner.refine(base, views)
            seconds = time.perf_counter() - start
        summary = _summary(frame, refined, seconds)
        revisions = tuple((name, s.revision) for name, s in sorted(stored.items()))
        self._solved[frame] = Solved(refined.vertices_mm, revisions, summary)
        return summary

    def refined(self, frame: int) -> np.ndarray:
        """The refined mesh (V, 3), world, of this session or of the workflow, of the present sketches.

        Raises RefusedRequest (404) where there is none.
        """
        self._data.check_frame(frame)
        revisions = self._store.revisions()
        if self.is_solved(frame, revisions):
            return self._solved[frame].vertices_mm
        if self.was_refined(frame, revisions):
            return RefinedFrame.load(self._data.files.refined(frame)).vertices_mm
        raise RefusedRequest(404, f"Frame {frame} is not solved: press Enter.")

    def is_solved(self, frame: int, revisions: dict[str, dict[int, str]]) -> bool:
        """Whether the frame was solved in this session with the sketches of these revisions."""
        present = tuple((c, of[frame]) for c, of in sorted(revisions.items()) if frame in of)
        return frame in self._solved and self._solved[frame].revisions == present

    def was_refined(self, frame: int, revisions: dict[str, dict[int, str]]) -> bool:
        """Whether the workflow refined the frame after its sketches were saved."""
        refined = self._data.files.refined(frame)
        drawn = [camera for camera, of in revisions.items() if frame in of]
        if not drawn or not refined.is_file():
            return False
        made = refined.stat().st_mtime
        return all(self._store.saved_at(camera, frame) <= made for camera in drawn)

    def summary(self, frame: int) -> dict[str, Any] | None:
        """What came of the last solve of a frame."""
        return self._solved[frame].summary if frame in self._solved else None


def _summary(frame: int, refined: Refined, seconds: float) -> dict[str, Any]:
    off = {
        f"{camera}, {name}": distance
        for camera, curves in refined.distance_px.items()
        for name, distance in curves.items()
    }
    worst = max(off, key=lambda name: off[name].mean())
    largest = max(float(distance.max()) for distance in off.values())
    warning = ""
    if off[worst].mean() > OFF_PX:
        warning = (
            f"The solve did not converge: a contour stays {off[worst].mean():.1f} px off its stroke "
            f"({worst}). Look whether the stroke is the lip that it is named after."
        )
    if not np.isfinite(refined.vertices_mm).all():
        raise VermilionError(f"The solve of frame {frame} diverged: draw the curve again.")
    return {
        "frame": frame, "seconds": seconds, "mean_px": refined.mean_px, "largest_px": largest,
        "depth_mm": refined.depth_mm, "warning": warning,
    }  # fmt: skip
