"""A take of a finished run, as benchmarks read it.

Paths are those of `workflow/rules/paths.smk`.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, read_cameras
from vermilion.imaging.frames import FrameSource, open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.multiview.files import read_neutral
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import Identity, TrackedTake


def take_folder(folder: Path, take: str) -> Path:
    """The folder of a take (subject/take) in `folder`, or `folder` where it is the take's own."""
    return folder / take if (folder / take).exists() else folder


@dataclass(frozen=True)
class FinishedRun:
    """A take (`subject/take`) of a results folder, its capture, and the folder of its truth."""

    results: Path
    take: str
    capture: Path
    truth: Path

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> FinishedRun:
        """The run that `common.add_run_arguments` describes.

        Raises:
            InputError: the results folder has no such take.
        """
        results, take = arguments.results, arguments.take
        if not (results / "takes" / take).is_dir():
            raise InputError(
                "no such take",
                "--results RESULTS --take SUBJECT/TAKE of a finished run",
                "Run the workflow first, or correct the options.",
                path=results / "takes" / take,
            )
        truth = getattr(arguments, "truth", None) or results / "truth"
        capture = arguments.capture or results / "captures"
        return cls(results, take, take_folder(capture, take), take_folder(truth, take))

    @property
    def folder(self) -> Path:
        """What the stages wrote for the take."""
        return self.results / "takes" / self.take

    @property
    def subject_folder(self) -> Path:
        """What the stages wrote for its subject."""
        return self.results / "subjects" / self.take.split("/")[0]

    def model(self, name: str) -> FaceModel:
        """The face model in one of its topologies: `studio`, `template` or `tracker`."""
        return FaceModel.load(self.results / "face_model" / f"{name}.npz")

    def tracker_model(self) -> FaceModel:
        """The subject's own model (`tracking.scans`), else the general one."""
        own = self.subject_folder / "tracker.npz"
        return FaceModel.load(own) if own.exists() else self.model("tracker")

    def identity(self) -> Identity:
        """Who the subject is."""
        return Identity.load(self.subject_folder / "identity.npz")

    def fit(self) -> TrackedTake:
        """Poses and weights of the take."""
        return TrackedTake.load(self.folder / "tracking" / "fit.npz")

    def coarse_mm(self) -> np.ndarray:
        """**C**, (F, V, 3), world frame, mm."""
        return read_sequence(sorted((self.folder / "tracking" / "C").glob("*.npy")))

    def neutral_mm(self, model: FaceModel) -> np.ndarray:
        """The registered neutral (V, 3) of a multi-view take, world frame, mm."""
        return read_neutral(self.folder / "multiview" / "neutral.npz", model.n_vertices)

    def landmarks(self, *, raw: bool = False) -> LandmarkTrack:
        """Landmarks of the take; `raw` those before the correction, where there was one."""
        folder = self.folder / "landmarks"
        detected = sorted((folder / "raw").glob("0*.npz")) if raw else []
        return LandmarkTrack.load(detected or sorted(folder.glob("0*.npz")))

    def cameras(self) -> dict[str, Camera]:
        """The run's cameras by name, else those of the capture."""
        own = self.folder / "cameras"
        return read_cameras(own if own.is_dir() else self.capture / "cameras")

    def images(self, *, inpainted: bool = False) -> FrameSource:
        """Images of the capture; `inpainted` those of the run, where it has some."""
        chunks = sorted((self.folder / "inpaint").glob("0*")) if inpainted else []
        return open_frames(chunks or self.capture, *self.take.split("/"))

    def true_mm(self) -> np.ndarray:
        """True meshes (F, V', 3), world frame, mm, mapped from the file."""
        return np.load(self.truth / "vertices_mm.npy", mmap_mode="r")

    def true_triangles(self) -> np.ndarray:
        """Their triangles (T', 3)."""
        return np.load(self.truth / "triangles.npy")
