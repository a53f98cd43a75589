"""Relief of the frames of a chunk, and their meshes with normals averaged over neighbours."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vermilion.detail.relief.combine import combine_positions_and_normals
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.relief import ReliefSettings, solve_relief
from vermilion.detail.relief.skin_observation import FaceImage, SkinObservation
from vermilion.detail.relief.tilts import average_tilts, tangents, tilted_normals, tilts_of
from vermilion.detail.relief.topology import FineTopology
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import incidence, triangle_normals, vertex_normals
from vermilion.imaging.frames import FrameSource
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence, rows_of_frames
from vermilion.tracking.result import TrackedTake


class ReliefFiles(Protocol):
    """Input files of a relief job."""

    fit: str
    meshes: Sequence[str]


@dataclass(frozen=True)
class ReliefScene:
    """Images and coarse meshes of a take.

    Attributes:
        topology: of the fine meshes.
        camera: of the images.
        read_image: frame -> image (h, w, 3), linear RGB, or InputError, also where it was not tracked.
        read_mesh: frame -> coarse mesh (V, 3) mm, world.
        face_px: longest side of the face in the images that are compared.
    """

    topology: FineTopology
    camera: Camera
    read_image: Callable[[int], np.ndarray]
    read_mesh: Callable[[int], np.ndarray]
    face_px: int

    @classmethod
    def open(
        cls,
        model: FaceModel,
        inputs: ReliefFiles,
        source: FrameSource,
        span: tuple[int, int],
        cfg: Mapping[str, Any],
    ) -> ReliefScene:
        """Images of a source, and coarse meshes of the frames from `span[0]` to `span[1]`.

        `cfg` has `detail.relief.levels`, `.spacing_mm` and `.face_px`.
        """
        levels, spacing_mm, face_px = (
            cfg[f"detail.relief.{name}"] for name in ("levels", "spacing_mm", "face_px")
        )
        topology = FineTopology.of(model, levels, spacing_mm)
        fit = TrackedTake.load(inputs.fit)
        camera, tracked = fit.camera, set(fit.frames[fit.valid].tolist())
        places = rows_of_frames(inputs.meshes, range(span[0], span[1] + 1))

        def read_mesh(frame: int) -> np.ndarray:
            path, row = places[frame]
            return read_sequence(path)[row]

        def read_image(frame: int) -> np.ndarray:
            if frame not in tracked:  # its mesh is its neighbours', its image tells nothing of it
                raise InputError(
                    "no track", "the face", "See the quality of the track.", frame=frame
                )
            return source.read(camera.name, frame)

        return cls(topology, camera, read_image, read_mesh, face_px)

    def fine(self, frame: int) -> np.ndarray:
        """Smooth fine mesh (V', 3) mm of a frame, world."""
        return self.topology.refine(self.read_mesh(frame))

    def centres(self, frame: int) -> np.ndarray:
        """Centres (Q, 3) mm of the skin's triangles in the smooth fine mesh of a frame, world."""
        return self.fine(frame)[self.topology.skin_ids][self.topology.skin].mean(axis=1)

    def observe(self, frame: int, fine_mm: np.ndarray) -> SkinObservation:
        """Colours of the skin of a fine mesh `fine_mm` (V', 3) in a frame's image.

        Raises:
            InputError: there is no image.
            ValueError: the face is not in the image.
        """
        image, skin = self.read_image(frame), fine_mm[self.topology.skin_ids]
        return FaceImage.of(image, self.camera, skin, self.face_px).observe(fine_mm, self.topology)

    def observe_relief(
        self, frame: int, light: ClipLight, settings: ReliefSettings
    ) -> SkinObservation:
        """The skin in a frame's image with the normals of its relief under a light; raises as `observe`."""
        fine = self.fine(frame)
        observed, skin = self.observe(frame, fine), fine[self.topology.skin_ids]
        rotation = self.camera.rotation
        along = solve_relief(skin, rotation, observed, light, self.topology, settings)
        return self.raised(observed, skin, along)

    def raised(
        self, observed: SkinObservation, skin_mm: np.ndarray, along_mm: np.ndarray
    ) -> SkinObservation:
        """`observed` with the normals of the smooth skin (S, 3), world, moved along its own by (S,) mm."""
        moved = skin_mm + along_mm[:, None] * vertex_normals(skin_mm, self.topology.skin)
        normals = triangle_normals(moved, self.topology.skin) @ self.camera.rotation.T
        return replace(observed, normals=normals)


@dataclass(frozen=True)
class ReliefChunk:
    """Relief of F frames.

    Attributes:
        tilts: (F, S, 3) float32: two tilts of the normal against the smooth mesh, and their trust.
        along_mm: (F, S) float32 displacements along the smooth normals.
        reasons: (F,) text why a frame has no relief; empty where it has one.
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
    """Relief of frames one by one; zero, with zero trust, where a frame cannot be read."""
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
    """Relief of any frame of a take; chunks stay in memory once read."""

    def __init__(self, paths: Sequence[str | Path], frames: Sequence[int]):
        """`paths` of chunks `<first>-<last>.npz`; `frames` that may be asked for."""
        self._places = rows_of_frames(paths, frames)
        self._open: dict[str | Path, ReliefChunk] = {}

    def _at(self, frame: int) -> tuple[ReliefChunk, int]:
        path, row = self._places[frame]
        if path not in self._open:
            self._open[path] = ReliefChunk.load(path)
        return self._open[path], row

    def tilts(self, frame: int) -> np.ndarray:
        """Two tilts and trust (S, 3) of a frame."""
        chunk, row = self._at(frame)
        return chunk.tilts[row]

    def along_mm(self, frame: int) -> np.ndarray:
        """Displacements (S,) along the smooth normals of a frame."""
        chunk, row = self._at(frame)
        return chunk.along_mm[row]

    def reason(self, frame: int) -> str:
        """Why a frame has no relief of its own; empty where it has one."""
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
    """Fine mesh (V', 3) mm with the relief of a frame, its normals averaged over time.

    Args:
        topology: of the fine mesh.
        fine_mm: (V', 3) smooth fine mesh of the frame.
        reader: relief of the take.
        frame: number of the frame.
        span: first and last frame of the take.
        window: frames to average over, odd.
        position_weight: weight of positions against normals, 1 / mm.
    """
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
    """Absolute difference (Q,) of image and shaded mesh, display values; NaN where not seen.

    Args:
        topology: of the fine mesh.
        light: of the take.
        observed: image at the skin's triangles.
        fine_mm: (V', 3) mesh to compare, world.
        camera: of the image.
    """
    normals = triangle_normals(fine_mm[topology.skin_ids], topology.skin) @ camera.rotation.T
    error = np.abs(observed.colours - light.reaching(observed).values(normals)).mean(axis=1)
    return np.where(observed.trust * (light.seen > 0) > 0, error, np.nan)


def mean_error(errors: np.ndarray, trust: np.ndarray) -> float:
    """Mean of `errors` (Q,) weighted by `trust` (Q,) over the seen triangles; NaN if there are none."""
    seen = np.isfinite(errors) & (trust > 0)
    return float(np.average(errors[seen], weights=trust[seen])) if seen.any() else float("nan")
