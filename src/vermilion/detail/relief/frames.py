"""Relief of the frames of a chunk, and the meshes that follow from it and its neighbours' relief."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.detail.relief.combine import combine
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.relief import ReliefSettings, solve_relief
from vermilion.detail.relief.sight import FaceImage, Sight
from vermilion.detail.relief.tilts import averaged, tangents, tilted, tilts_of
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import incidence, triangle_normals, vertex_normals
from vermilion.imaging.frames import open_frames
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence, rows_of_frames
from vermilion.tracking.result import TrackedTake


@dataclass(frozen=True)
class Scene:
    """What is needed to look at a frame.

    Attributes:
        topology, camera: of the take.
        read_image: frame -> linear (h, w, 3), or InputError.
        read_mesh: frame -> (V, 3) mm in the world, before the refinement.
        face_px: a larger face is reduced to this.
    """

    topology: FineTopology
    camera: Camera
    read_image: Callable[[int], np.ndarray]
    read_mesh: Callable[[int], np.ndarray]
    face_px: int

    @classmethod
    def open(cls, topology, inputs, source, place, span, cfg) -> Scene:
        """Of a job's files: `fit`, `meshes` (chunks) and what `open_frames` opens.

        Args:
            place: subject and take; span: first and last frame whose meshes are read.
        """
        camera, frames = TrackedTake.load(inputs.fit).camera, open_frames(source, *place)
        places = rows_of_frames(inputs.meshes, range(span[0], span[1] + 1))

        def read_mesh(frame):
            path, row = places[frame]
            return read_sequence(path)[row]

        def read_image(frame):
            return frames.read(camera.name, frame)

        return cls(topology, camera, read_image, read_mesh, cfg["detail.relief.face_px"])

    def fine(self, frame: int) -> np.ndarray:
        """Smooth fine mesh (V', 3)."""
        return self.topology.refine(self.read_mesh(frame))

    def sight(self, frame: int, fine_mm: np.ndarray) -> Sight:
        """Raises InputError without an image, ValueError where the face is not in it."""
        image, skin = self.read_image(frame), fine_mm[self.topology.skin_ids]
        return FaceImage.of(image, self.camera, skin, self.face_px).sight(fine_mm, self.topology)


@dataclass(frozen=True)
class ReliefChunk:
    """Relief of F frames.

    Attributes:
        tilts: (F, S, 3) float32: two tilts of the normal against the smooth mesh, and their trust.
        along_mm: (F, S) float32 displacements along the smooth normals.
        reasons: (F,) text, empty where the frame has a relief.
    """

    tilts: np.ndarray
    along_mm: np.ndarray
    reasons: np.ndarray

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, tilts=self.tilts, along_mm=self.along_mm, reasons=self.reasons)

    @classmethod
    def load(cls, path: str | Path) -> ReliefChunk:
        """Read what `save` wrote."""
        return cls(**read_arrays(path, "relief", ["tilts", "along_mm", "reasons"]))


def relief_of(
    scene: Scene, frames: Sequence[int], light: ClipLight, settings: ReliefSettings
) -> ReliefChunk:
    """Relief of frames one by one; none, without trust, where a frame cannot be seen."""
    topology = scene.topology
    n = len(topology.skin_ids)
    spread = incidence(topology.skin, n)
    count = np.maximum(np.asarray(spread.sum(axis=1)).ravel(), 1)
    tilts, along = np.zeros((len(frames), n, 3), np.float32), np.zeros((len(frames), n), np.float32)
    reasons = [""] * len(frames)
    for row, frame in enumerate(progress(list(frames), "relief")):
        fine = scene.fine(frame)
        try:
            sight = scene.sight(frame, fine)
        except (InputError, ValueError) as error:  # no image, or the face is not in it
            reasons[row] = f"no relief: {error}"
            continue
        skin = fine[topology.skin_ids]
        found = solve_relief(skin, scene.camera.rotation, sight, light, topology, settings)
        smooth = vertex_normals(skin, topology.skin)
        shaped = vertex_normals(skin + found[:, None] * smooth, topology.skin)
        along[row] = found
        tilts[row, :, :2] = tilts_of(smooth, tangents(skin, smooth, topology), shaped)
        tilts[row, :, 2] = (spread @ sight.trust) / count
    return ReliefChunk(tilts, along, np.array(reasons))


class ReliefReader:
    """Relief of any frame of a take from its chunks, a few of which are kept open."""

    def __init__(self, paths: Sequence[str | Path], frames: Sequence[int]):
        """`paths` of chunks `<first>-<last>.npz`; `frames` that may be asked for."""
        self._places, self._open = rows_of_frames(paths, frames), {}

    def _at(self, frame: int):
        path, row = self._places[frame]
        if path not in self._open:
            self._open[path] = ReliefChunk.load(path)
        return self._open[path], row

    def tilts(self, frame: int) -> np.ndarray:
        """(S, 3) tilts and trust."""
        chunk, row = self._at(frame)
        return chunk.tilts[row]

    def along_mm(self, frame: int) -> np.ndarray:
        """(S,) displacements."""
        chunk, row = self._at(frame)
        return chunk.along_mm[row]

    def reason(self, frame: int) -> str:
        """Why a frame has no relief of its own, or empty."""
        chunk, row = self._at(frame)
        return str(chunk.reasons[row])


def refined(
    topology: FineTopology,
    fine_mm: np.ndarray,
    reader: ReliefReader,
    frame: int,
    span: tuple[int, int],
    window: int,
    position_weight: float,
) -> np.ndarray:
    """Fine mesh (V', 3) with the relief of a frame, its normals averaged over a window of frames."""
    skin = fine_mm[topology.skin_ids]
    smooth = vertex_normals(skin, topology.skin)
    tilts = averaged(reader.tilts, frame, span, window)
    wanted = tilted(smooth, tangents(skin, smooth, topology), tilts)
    along = combine(skin, smooth, wanted, topology, position_weight, reader.along_mm(frame))
    return topology.displaced(fine_mm, smooth, along)


def errors_of(
    topology: FineTopology, light: ClipLight, sight: Sight, fine_mm: np.ndarray, camera: Camera
) -> np.ndarray:
    """Absolute difference (Q,) of the image to the shaded mesh, display values; NaN unseen."""
    normals = triangle_normals(fine_mm[topology.skin_ids], topology.skin) @ camera.rotation.T
    error = np.abs(sight.colours - light.values(normals)).mean(axis=1)
    return np.where(sight.trust * (light.seen > 0) > 0, error, np.nan)


def residual_of(errors: np.ndarray, trust: np.ndarray) -> float:
    """Mean of errors (Q,) by trust (Q,) over what is seen; NaN if nothing is."""
    seen = np.isfinite(errors) & (trust > 0)
    return float(np.average(errors[seen], weights=trust[seen])) if seen.any() else float("nan")
