"""What is known of each frame, for the time line: drawn, solved, suggested, propagated, bad."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vermilion.app.sketch.frame_solver import OFF_PX, FrameSolver
from vermilion.app.sketch.lip_lines import LipLines
from vermilion.app.sketch.refusal import RefusedRequest
from vermilion.app.sketch.sketch_store import SketchStore
from vermilion.app.sketch.take_data import TakeData
from vermilion.app.sketch.take_files import existing
from vermilion.storage.errors import VermilionError
from vermilion.storage.quality import flagged_frames
from vermilion.storage.sequences import frames_of, read_sequence
from vermilion.storage.tables import read_table


class TakeStatus:
    """Reads the take's tables again when their files have changed."""

    def __init__(self, data: TakeData, store: SketchStore, solver: FrameSolver, lines: LipLines):
        self._data, self._store, self._solver, self._lines = data, store, solver, lines
        self._kept: dict[str, tuple[Any, Any]] = {}

    def report(self) -> dict[str, Any]:
        """States of frames, revisions of sketches, change by propagation; for the page."""
        revisions = self._store.revisions()
        drawn = sorted({frame for of in revisions.values() for frame in of})
        solver = self._solver
        solved = [
            frame
            for frame in drawn
            if solver.is_solved(frame, revisions) or solver.was_refined(frame, revisions)
        ]
        changed = self._once("changed", self._data.files.guided_chunks, self._changed_mm)
        saved = [self._store.saved_at(c, f) for c, of in revisions.items() for f in of]
        made = [path.stat().st_mtime for path in self._data.files.guided_chunks]
        return {
            "revisions": revisions,
            "sketched": drawn,
            "solved": solved,
            "suggested": self._once("suggested", [self._data.files.suggestions], self._suggested),
            "propagated": sorted(changed),
            "changed_mm": changed,
            "stale": bool(made and saved and max(saved) > min(made)),
            "followed": self._once("followed", self._data.files.guided_chunks, self._followed),
            "bad": self._once("bad", existing(self._data.files.quality_pattern), self._bad),
        }

    def _once(self, name: str, paths: list[Path], make: Any) -> Any:
        """`make()`, remembered until one of its files changes."""
        present = [path for path in paths if path.is_file()]
        key = tuple((str(path), path.stat().st_mtime_ns) for path in present)
        if name not in self._kept or self._kept[name][0] != key:
            self._kept[name] = (key, make())
        return self._kept[name][1]

    def _suggested(self) -> list[int]:
        """Frames worth drawing next, best first."""
        path = self._data.files.suggestions
        return read_table(path)["frame"].astype(int).tolist() if path.is_file() else []

    def _changed_mm(self) -> dict[int, float]:
        """Frame -> mean distance over the inner lips that the propagation moved it."""
        inner = self._data.regions.inner_vertices
        changed: dict[int, float] = {}
        for after in self._data.files.guided_chunks:
            before = self._data.files.sequence_pattern.with_name(after.name)
            if not before.is_file():
                continue
            apart = read_sequence(after)[:, inner] - read_sequence(before)[:, inner]
            mean = np.linalg.norm(apart, axis=2).mean(axis=1)
            for frame, value in zip(frames_of([after]), mean, strict=True):
                if np.isfinite(value):
                    changed[int(frame)] = round(float(value), 4)
        return changed

    def _followed(self) -> str:
        """What to do where the propagated take does not follow the strokes; empty where it does."""
        off = []
        for frame in sorted({f for of in self._store.revisions().values() for f in of}):
            for camera, stored in self._store.sketches_of(frame).items():
                if stored.sketch is None:
                    continue
                try:
                    mesh = self._data.propagated(frame)
                    seen_by = self._data.cameras[camera]
                    off.append(self._lines.off_px(stored.sketch, mesh, seen_by))
                except (RefusedRequest, VermilionError):
                    continue
        if not off or np.mean(off) <= OFF_PX:
            return ""
        return (
            f"The propagated contours of the drawn frames stay {np.mean(off):.1f} px off their strokes: "
            "more of the lips is wrong than the inner lips that are predicted. Raise "
            f"guided.regions.inner_mm (now {self._data.files.guided.regions.inner_mm:g})."
        )

    def _bad(self) -> dict[int, str]:
        """Frame -> why it is doubtful: not tracked, or what the propagation said of it."""
        fit = self._data.fit
        bad = {int(f): "not tracked: the neighbours' pose" for f in fit.frames[~fit.valid]}
        rows = flagged_frames(existing(self._data.files.quality_pattern))
        for frame, reason in zip(rows["frame"], rows["reason"], strict=True):
            bad[int(frame)] = str(reason)
        return bad
