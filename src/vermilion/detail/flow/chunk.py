"""Correction of the frames of a chunk; the result of a frame does not depend on the chunk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vermilion.detail.flow.frame import CorrectedFrame, FlowCorrection
from vermilion.storage.errors import InputError
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow


@dataclass(frozen=True)
class CorrectedChunk:
    """Meshes and figures of some frames.

    Attributes:
        frames: (F,) int numbers.
        vertices_mm: (F, V, 3), world; the coarse mesh where a frame could not be corrected.
        before, after, flow_px: (F,) as in `CorrectedFrame`; NaN where not corrected.
        reasons: F texts, empty where corrected.
    """

    frames: np.ndarray
    vertices_mm: np.ndarray
    before: np.ndarray
    after: np.ndarray
    flow_px: np.ndarray
    reasons: tuple[str, ...]

    def quality(self) -> list[QualityRow]:
        """A row a frame, with a warning where the photometric residual rose."""
        rows = []
        for frame, before, after, flow, reason in zip(
            self.frames, self.before, self.after, self.flow_px, self.reasons, strict=True
        ):
            worse = "" if reason or not after > before else "the flow explains the image worse"
            figures = {"residual_before": before, "residual_after": after, "flow_px": flow}
            rows.append(QualityRow(int(frame), not reason, reason or worse, figures))
        return rows


def correct_frames(
    correction_of: Callable[[int], FlowCorrection],
    frames: Sequence[int],
    near: Callable[[int], list[int]],
    read_image: Callable[[int], np.ndarray],
    read_mesh: Callable[[int], np.ndarray],
) -> CorrectedChunk:
    """Correct frames one by one.

    Args:
        correction_of: frame -> correction of its piece of the take, or InputError where it was not tracked.
        frames: numbers of the frames.
        near: frame -> itself, the next and the one before; itself in place of one that is not there
            (`neighbouring_frames`).
        read_image: frame -> image (h, w, 3), linear RGB, or InputError.
        read_mesh: frame -> coarse mesh (V, 3) mm, world.
    """
    image_of = lru_cache(maxsize=4)(read_image)
    results = []
    for frame in progress(list(frames), "corrective flow"):
        try:
            correction, three = correction_of(frame), near(frame)
            images = [image_of(f) for f in three]
            found = correction.correct(images, np.stack([read_mesh(f) for f in three]))
            results.append((found, ""))
        except InputError as error:
            results.append((_uncorrected(read_mesh(frame)), f"not corrected: {error}"))
        except ValueError as error:  # the face left the image
            results.append((_uncorrected(read_mesh(frame)), f"not corrected: {error}"))
    done = [result for result, _ in results]
    return CorrectedChunk(
        np.asarray(frames),
        np.stack([result.vertices_mm for result in done]),
        np.array([result.before for result in done]),
        np.array([result.after for result in done]),
        np.array([result.flow_px for result in done]),
        tuple(reason for _, reason in results),
    )


def neighbouring_frames(
    frame: int, frames: np.ndarray, valid: np.ndarray, piece: np.ndarray
) -> list[int]:
    """A frame, the next and the one before; itself in place of one that no image of its shot can be compared with.

    Args:
        frame: number of a frame.
        frames: (F,) numbers of the take's frames.
        valid: (F,) bool, frames that were tracked.
        piece: (F,) int piece between cuts of each frame.
    """
    rows = {int(number): row for row, number in enumerate(frames)}

    def usable(other: int) -> bool:
        row = rows.get(other)
        return row is not None and bool(valid[row]) and piece[row] == piece[rows[frame]]

    return [frame, *(f if usable(f) else frame for f in (frame + 1, frame - 1))]


def _uncorrected(vertices_mm: np.ndarray) -> CorrectedFrame:
    nan = float("nan")
    return CorrectedFrame(np.asarray(vertices_mm, dtype=np.float64), nan, nan, nan)
