"""The frames of a chunk with their images: fitted one by one, each independent of the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.imaging.frames import FrameSource
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.tracking.image_fit.frame_fit import FrameProblem, FrameView
from vermilion.tracking.image_fit.take import StartFiles, TakeStart


class ChunkFiles(StartFiles, Protocol):
    """Input files of a chunk."""

    appearance: str


@dataclass(frozen=True)
class FrameChunk:
    """F frames of a take with its appearance and their images.

    Attributes:
        start: the frames before the image fit.
        valid: (F,) bool; the other frames are not looked at.
        appearance: of the take's longest piece between cuts.
        face: the person at the appearance's samples.
        read: row -> image (h, w, 3), linear RGB, or InputError.
        pixel_mm: pixel size of the finest images that are compared, at the face.
        piece: (F,) int piece between cuts of each frame; None: all in one.
    """

    start: TakeStart
    valid: np.ndarray
    appearance: Appearance
    face: SampledFace
    read: Callable[[int], np.ndarray]
    pixel_mm: float
    piece: np.ndarray | None = None

    @classmethod
    def load(
        cls,
        inputs: ChunkFiles,
        source: FrameSource,
        cfg: Mapping[str, dict[str, Any]],
        frames: Sequence[int],
    ) -> FrameChunk:
        """Read some frames of a take; `cfg` as in `TakeStart.load`, and the appearance's section."""
        fit, rows, start = TakeStart.load(inputs, cfg, frames)
        appearance = Appearance.load(inputs.appearance)

        def read(row: int) -> np.ndarray:
            return source.read(fit.camera.name, int(frames[row]))

        pixel_mm = cfg["tracking.image_fit.appearance"]["pixel_mm"]
        face = start.face(appearance.samples)
        return cls(start, fit.valid[rows], appearance, face, read, pixel_mm, fit.pieces[rows])

    def views(self, levels: int, name: str) -> Iterator[tuple[int, FrameView]]:
        """Row and data of every valid frame, with an image pyramid of `levels`.

        Frames whose image cannot be read are left out: the capture stage has flagged them. Progress
        is reported under `name`.
        """
        for row in progress(np.flatnonzero(self.valid).tolist(), name):
            try:
                image = self.read(row)
            except InputError:
                continue
            yield row, self.start.view(row, image, self.face, self.pixel_mm, levels)


def fit_frames(
    chunk: FrameChunk, problem: FrameProblem | Mapping[int, FrameProblem]
) -> dict[str, np.ndarray]:
    """Fit pose and expression to the image of each frame.

    Each piece between cuts has its own light and albedo, and so its own `problem`; one is that of all.

    Frames that are not valid, or whose image cannot be read, keep the landmark fit.

    Returns:
        `x` (F, P), `matrix` (F, P, P), `right` (F, P) of `FrameFit`; `refined` (F,) bool. P = 6 + K.
    """
    n_frames, n_params = chunk.start.x.shape
    result = {
        "x": chunk.start.x.copy(),
        "matrix": np.zeros((n_frames, n_params, n_params)),
        "right": np.zeros((n_frames, n_params)),
        "refined": np.zeros(n_frames, dtype=bool),
    }
    any_problem = problem if isinstance(problem, FrameProblem) else next(iter(problem.values()))
    for row, view in chunk.views(len(any_problem.settings.iterations), "image fit"):
        own = any_problem
        if not isinstance(problem, FrameProblem) and chunk.piece is not None:
            own = problem.get(int(chunk.piece[row]), any_problem)
        found = own.solve(view)
        result["x"][row], result["matrix"][row] = found.x, found.matrix
        result["right"][row], result["refined"][row] = found.right, True
    return result
