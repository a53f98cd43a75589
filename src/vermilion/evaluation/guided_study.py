"""What propagation leaves when few true frames train and all others are predicted (Guided18 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vermilion.evaluation.measures import COLUMNS
from vermilion.evaluation.statistics import Resampling
from vermilion.geometry.alignment import align_frames
from vermilion.guided.gradients import NeutralTriangles
from vermilion.guided.propagation import LipPropagator
from vermilion.guided.regions import GuidedRegions
from vermilion.guided.suggestion import (
    extreme_frames,
    mouth_deformation,
    random_frames,
    suggest_frames,
    uniform_frames,
)

REGION = "inner_lips"
#: measure -> unit
MEASURES = {"guided_ratio": "1", "guided_error_mm": "mm", "guided_gradient_error": "1"}


@dataclass(frozen=True)
class StudyPlan:
    """Which frames are corrected.

    Attributes:
        counts: numbers of corrected frames; those that the take does not have are left out.
        choices: suggested, uniform, extremes, random.
        draws: number of random choices.
        seed: of random choices.
    """

    counts: Sequence[int]
    choices: Sequence[str]
    draws: int
    seed: int


@dataclass(frozen=True)
class Left:
    """What the propagation from some frames leaves of all frames.

    Attributes:
        vertices_mm: (F, V, 3) predicted, in the poses of the take.
        error_mm: (F,) mean distance from the truth over the free vertices of the inner lips.
        gradient_error: (F,) |x* - x| of the predicted triangles' gradients (figure 11).
        others: (F,) bool: frames that did not train.
    """

    vertices_mm: np.ndarray
    error_mm: np.ndarray
    gradient_error: np.ndarray
    others: np.ndarray


class PropagationStudy:
    """One true take: propagation from any chosen frames, and what it leaves.

    Attributes:
        take_mm: (F, V, 3), any rigid poses.
        regions: of the topology.
        propagator: of the topology.
        deformation: (F, D) of `mouth_deformation`, from which frames are chosen.
        size_mm: (F,) mean distance of the inner lips' free vertices from the neutral, aligned.
    """

    def __init__(
        self,
        take_mm: np.ndarray,
        neutral_mm: np.ndarray,
        regions: GuidedRegions,
        stable: np.ndarray,
    ):
        """Prepare a take.

        Args:
            take_mm: (F, V, 3) true meshes, finite.
            neutral_mm: (V, 3) of the person.
            regions: of the topology.
            stable: (s,) vertices that hold the alignment.
        """
        self.take_mm, self.regions = take_mm, regions
        self.propagator = LipPropagator(neutral_mm, regions, stable)
        self.deformation = mouth_deformation(take_mm, neutral_mm, regions, stable)
        weights = np.zeros(len(neutral_mm))
        weights[stable] = 1.0
        motions = align_frames(take_mm, neutral_mm, weights)
        moved = motions.apply(take_mm[:, regions.free]) - neutral_mm[regions.free]
        self.size_mm = np.linalg.norm(moved, axis=2).mean(axis=1)
        self._gradients = NeutralTriangles(neutral_mm, regions.triangles[regions.predicted])

    def left(self, frames: np.ndarray, with_neutral: bool = True) -> Left:
        """Train on some frames (k,) and predict all."""
        self.propagator.fit(self.take_mm[frames], with_neutral=with_neutral)
        found = self.propagator.correct(self.take_mm).vertices_mm
        free = self.regions.free
        error = np.linalg.norm(found[:, free] - self.take_mm[:, free], axis=2).mean(axis=1)
        gradient = [
            np.linalg.norm(np.subtract(*self._gradients.gradients(np.stack(pair))))
            for pair in zip(found, self.take_mm, strict=True)
        ]
        others = np.ones(len(found), dtype=bool)
        others[frames] = False
        return Left(found, error, np.array(gradient), others)

    def predicted(self, frames: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Meshes (n, V, 3) of some rows (n,) when some frames (k,) train."""
        self.propagator.fit(self.take_mm[frames])
        return self.propagator.correct(self.take_mm[rows]).vertices_mm

    def ratio(self, left: Left) -> float:
        """Share of the inner lips' deformation that is left, over the frames that did not train."""
        return float(left.error_mm[left.others].sum() / self.size_mm[left.others].sum())

    def choose(self, choice: str, count: int, seed: int) -> np.ndarray:
        """Frames (count,) by a choice: suggested, uniform, extremes or random."""
        if choice == "suggested":
            return suggest_frames(self.deformation, count)
        if choice == "uniform":
            return uniform_frames(len(self.take_mm), count)
        if choice == "extremes":
            return extreme_frames(self.deformation, count)
        return random_frames(len(self.take_mm), count, seed)


def study_rows(
    study: PropagationStudy,
    clips: np.ndarray,
    place: tuple[str, str],
    plan: StudyPlan,
    resampling: Resampling,
) -> pd.DataFrame:
    """Rows of `measures.tsv`: each measure by the number of frames and how they are chosen.

    Intervals are over clips; those of random choices are over the draws, whose median is the value.

    Args:
        study: of the take.
        clips: (F,) number of the clip of each frame.
        place: subject and take.
        plan: numbers of corrected frames and how they are chosen.
        resampling: of the clips.
    """
    rows = []
    for choice, count in ((c, k) for c in plan.choices for k in plan.counts if k < len(clips)):
        draws = range(plan.draws if choice == "random" else 1)
        chosen = [study.choose(choice, count, plan.seed + draw) for draw in draws]
        sums = np.stack([_sums_by_clip(study, study.left(frames), clips) for frames in chosen])
        whole = sums.sum(axis=-1)
        values = whole[:, :, 0] / whole[:, :, 1]
        drawn = sums[0] @ resampling.draws.T
        for m, (measure, unit) in enumerate(MEASURES.items()):
            with np.errstate(invalid="ignore", divide="ignore"):
                low, high = resampling.interval(drawn[m, 0] / drawn[m, 1])
            if choice == "random":
                tail = (1 - resampling.confidence) / 2
                low, high = np.quantile(values[:, m], [tail, 1 - tail])
            rows.append(
                (
                    measure, REGION, *place, f"guided/{count}/{choice}",
                    float(np.median(values[:, m])), unit, low, high, len(clips) - len(chosen[0]),
                )
            )  # fmt: skip
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _sums_by_clip(study: PropagationStudy, left: Left, clips: np.ndarray) -> np.ndarray:
    """Numerator and denominator of each measure by clip, (3, 2, C), over frames that did not train."""

    def by_clip(values: np.ndarray) -> np.ndarray:
        return np.bincount(clips, values * left.others, minlength=int(clips.max()) + 1)

    frames, error = by_clip(np.ones(len(clips))), by_clip(left.error_mm)
    return np.array(
        [(error, by_clip(study.size_mm)), (error, frames), (by_clip(left.gradient_error), frames)]
    )
