"""Relief of the frames of a chunk, and the meshes that follow from it and its neighbours' relief."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.detail.relief.combine import combine_positions_and_normals
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.relief import ReliefSettings, solve_relief
from vermilion.detail.relief.skin_observation import FaceImage, SkinObservation
from vermilion.detail.relief.tilts import average_tilts, tangents, tilted_normals, tilts_of
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import incidence, triangle_normals, vertex_normals
from vermilion.imaging.frames import open_frames
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.storage.sequences import locate, read_sequence
from vermilion.tracking.result import TrackedTake


@dataclass(frozen=True)
class ReliefScene:
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
    def open(cls, topology, inputs, source, place, span, cfg) -> ReliefScene:
        """Of a job's files: `fit`, `meshes` (chunks) and what `open_frames` opens.

        Args:
            place: subject and take; span: first and last frame whose meshes are read.
        """
        camera, frames = TrackedTake.load(inputs.fit).camera, open_frames(source, *place)
        places = locate(inputs.meshes, range(span[0], span[1] + 1))

        def read_mesh(frame):
            path, row = places[frame]
            return read_sequence(path)[row]

        def read_image(frame):
            return frames.read(camera.name, frame)

        return cls(topology, camera, read_image, read_mesh, cfg["detail.relief.face_px"])

    def fine(self, frame: int) -> np.ndarray:
        """Smooth fine mesh (V', 3)."""
        return self.topology.refine(self.read_mesh(frame))

    def observe(self, frame: int, fine_mm: np.ndarray) -> SkinObservation:
        """Raises InputError without an image, ValueError where the face is not in it."""
        image, skin = self.read_image(frame), fine_mm[self.topology.skin_ids]
        return FaceImage.of(image, self.camera, skin, self.face_px).observe(fine_mm, self.topology)


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


def relief_of_frames(
    scene: ReliefScene, frames: Sequence[int], light: ClipLight, settings: ReliefSettings
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
            observed = scene.observe(frame, fine)
        except (InputError, ValueError) as error:  # no image, or the face is not in it
            reasons[row] = f"no relief: {error}"
            continue
        skin = fine[topology.skin_ids]
        found = solve_relief(skin, scene.camera.rotation, observed, light, topology, settings)
        smooth = vertex_normals(skin, topology.skin)
        shaped = vertex_normals(skin + found[:, None] * smooth, topology.skin)
        along[row] = found
        tilts[row, :, :2] = tilts_of(smooth, tangents(skin, smooth, topology), shaped)
        tilts[row, :, 2] = (spread @ observed.trust) / count
    return ReliefChunk(tilts, along, np.array(reasons))


class ReliefReader:
    """Relief of any frame of a take from its chunks, a few of which are kept open."""

    def __init__(self, paths: Sequence[str | Path], frames: Sequence[int]):
        """`paths` of chunks `<first>-<last>.npz`; `frames` that may be asked for."""
        self._places, self._open = locate(paths, frames), {}

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


def mesh_with_relief(
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
    tilts = average_tilts(reader.tilts, frame, span, window)
    wanted = tilted_normals(smooth, tangents(skin, smooth, topology), tilts)
    along = combine_positions_and_normals(
        skin, smooth, wanted, topology, position_weight, reader.along_mm(frame)
    )
    return topology.displaced(fine_mm, smooth, along)


def shading_errors(
    topology: FineTopology,
    light: ClipLight,
    observed: SkinObservation,
    fine_mm: np.ndarray,
    camera: Camera,
) -> np.ndarray:
    """Absolute difference (Q,) of the image to the shaded mesh, display values; NaN unseen."""
    normals = triangle_normals(fine_mm[topology.skin_ids], topology.skin) @ camera.rotation.T
    error = np.abs(observed.colours - light.values(normals)).mean(axis=1)
    return np.where(observed.trust * (light.seen > 0) > 0, error, np.nan)


def mean_error(errors: np.ndarray, trust: np.ndarray) -> float:
    """Mean of errors (Q,) by trust (Q,) over what is seen; NaN if nothing is."""
    seen = np.isfinite(errors) & (trust > 0)
    return float(np.average(errors[seen], weights=trust[seen])) if seen.any() else float("nan")
