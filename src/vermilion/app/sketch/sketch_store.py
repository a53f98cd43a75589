"""The sketches of a take: read, checked, saved whole or not at all, and never over another's change."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vermilion.app.sketch.refusal import RefusedRequest
from vermilion.guided.sketch import Sketch, read_sketch, sketch_of_json, sketch_path, write_sketch
from vermilion.storage.errors import InputError

#: Revision of a sketch that does not exist.
NOTHING = "none"


@dataclass(frozen=True)
class StoredSketch:
    """A sketch as it lies on disk.

    Attributes:
        sketch: None where there is none, or none that can be read.
        revision: of the file's content; `NOTHING` without a file.
        problem: why the file cannot be read.
    """

    sketch: Sketch | None
    revision: str
    problem: str = ""


class SketchStore:
    """Sketches of one take by camera and frame.

    A writer says which revision it saw: where the file has changed since, by another tab or by hand,
    nothing is written.
    """

    def __init__(self, labels: Path, sizes_px: Mapping[str, tuple[int, int]], frames: range):
        """`sizes_px`: camera -> (width, height) of its images."""
        self._labels, self._sizes, self._frames = labels, dict(sizes_px), frames
        self._lock = threading.Lock()

    def read(self, camera: str, frame: int) -> StoredSketch:
        """What lies on disk. Raises RefusedRequest (404) outside the take."""
        path = self._path(camera, frame)
        revision = _revision(path)
        if revision == NOTHING:
            return StoredSketch(None, NOTHING)
        try:
            return StoredSketch(read_sketch(path), revision)
        except InputError as error:
            return StoredSketch(None, revision, str(error))

    def write(self, camera: str, frame: int, content: Any, revision: str) -> str:
        """Save a sketch, or remove it where `content` is None; returns the new revision.

        Args:
            camera, frame: of the image.
            content: parsed JSON of a sketch.
            revision: that the writer saw.

        Raises:
            RefusedRequest: 404 outside the take, 409 where the file has changed, 422 for a sketch of
                another image.
            InputError: no sketch.
        """
        path = self._path(camera, frame)
        sketch = None if content is None else self._checked(content, camera, frame)
        with self._lock:
            if _revision(path) != revision:
                raise RefusedRequest(
                    409,
                    f"The sketch of frame {frame} was changed in another tab or by hand; its newer "
                    "version is shown now. Draw your stroke again if it is still wanted.",
                )
            if sketch is None:
                path.unlink(missing_ok=True)
            else:
                write_sketch(path, sketch)
            return _revision(path)

    def revisions(self) -> dict[str, dict[int, str]]:
        """Camera -> frame -> revision of all sketches of the take."""
        found: dict[str, dict[int, str]] = {}
        for camera in self._sizes:
            folder = sketch_path(self._labels, camera, 0).parent
            for path in sorted(folder.glob("[0-9]*.json")) if folder.is_dir() else []:
                if path.stem.isdigit() and int(path.stem) in self._frames:
                    found.setdefault(camera, {})[int(path.stem)] = _revision(path)
        return found

    def saved_at(self, camera: str, frame: int) -> float:
        """When a sketch was saved, in seconds of the clock; 0 where there is none."""
        try:
            return self._path(camera, frame).stat().st_mtime
        except OSError:
            return 0.0

    def sketches_of(self, frame: int) -> dict[str, StoredSketch]:
        """Camera -> sketch, of the cameras in which a frame was drawn."""
        found = {camera: self.read(camera, frame) for camera in self._sizes}
        return {camera: stored for camera, stored in found.items() if stored.revision != NOTHING}

    def _checked(self, content: Any, camera: str, frame: int) -> Sketch:
        sketch = sketch_of_json(content)
        said = (sketch.camera, sketch.frame, tuple(sketch.image_size_px))
        if said != (camera, frame, self._sizes[camera]):
            raise RefusedRequest(
                422,
                f"The sketch says camera {said[0]:.60}, frame {said[1]}, image {said[2]}; expected "
                f"camera {camera}, frame {frame}, image {self._sizes[camera]}.",
            )
        return sketch

    def _path(self, camera: str, frame: int) -> Path:
        if camera not in self._sizes:
            raise RefusedRequest(404, f"The take has no camera {camera:.60}.")
        if frame not in self._frames:
            first, last = self._frames[0], self._frames[-1]
            raise RefusedRequest(404, f"The take has no frame {frame}; it has {first} to {last}.")
        path = sketch_path(self._labels, camera, frame)
        if not path.resolve().is_relative_to(self._labels.resolve()):
            raise RefusedRequest(403, f"The sketches of camera {camera} lie outside the take.")
        return path


def _revision(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    except OSError:
        return NOTHING
