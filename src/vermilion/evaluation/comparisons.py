"""Is one regressor better than another, by more than the interval over clips? (Lips16 6)"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vermilion.evaluation.errors import ClipSums
from vermilion.evaluation.pooled import kinds_of, ratio_of
from vermilion.evaluation.statistics import Resampling

COLUMNS = (
    "question", "measure", "first", "second", "first_value", "second_value", "difference", "low",
    "high", "ratio", "ratio_low", "ratio_high", "frames", "clips", "answer",
)  # fmt: skip
KINDS = ("PS", "MS", "GR")
#: Measure -> the sums whose ratio it is, and whether its root is taken.
_MEASURES = {
    "vertex_error_mean_mm": ("mouth.error", "mouth.weight", False),
    "lip_motion_error_mm": ("vermilion.motion", "vermilion.motion_weight", False),
    "feature_error": ("mouth.feature_square", "mouth.feature_entries", True),
}


@dataclass(frozen=True)
class Question:
    """Two regressors of the same kind that are held against each other.

    Attributes:
        name: what is asked, for a reader.
        first: a variant (`""` is the configured regressor), or another row's name after `=`.
        second: the same of the other.
    """

    name: str
    first: str
    second: str

    def rows(self, kind: str) -> tuple[str, str]:
        """Names of the two rows for PS, MS or GR."""
        return _row(kind, self.first), _row(kind, self.second)


def questions_of(regressor: str) -> list[Question]:
    """What section 6 asks, and whether ours is better than the paper's.

    Args:
        regressor: the configured estimator, `kernel`, `rbf` or `affine`; it has no variant of its name.
    """

    def variant(estimator: str) -> str:
        return "" if estimator == regressor else estimator

    return [
        Question("RBF network against affine map", variant("rbf"), variant("affine")),
        Question("All features against shape coefficients alone", "", "shape-only"),
        Question("All features against contour distances alone", "", "distances-only"),
        Question("Kernel regression against RBF network", variant("kernel"), variant("rbf")),
        Question("The configured regressor against Lips16 to the letter", "", "paper"),
        Question("The configured regressor against the contour baseline", "", "=contour"),
        Question("The configured regressor against the base track", "", "=base"),
        Question("The configured regressor against one that learnt nothing", "", "=null"),
        Question("Against one that learnt nothing, told the neutral", "", "=null/neutral"),
        Question("Both told the neutral", "neutral", "=null/neutral"),
        Question("The generic regressor against one that learnt nothing", "generic", "=null"),
        Question("The neutral known against unknown", "neutral", ""),
        Question("The neutral known against the base track", "neutral", "=base"),
    ]


def rbf_and_affine(regressor: str) -> list[tuple[str, str]]:
    """Rows of the RBF network and of the affine map: of MS, or of GR or PS where MS is not there."""
    question = questions_of(regressor)[0]
    return [question.rows(kind) for kind in ("MS", "GR", "PS")]


def comparisons(
    takes: Sequence[tuple[dict[str, ClipSums], int]],
    questions: Sequence[Question],
    samples: int,
    confidence: float,
    seed: int,
) -> pd.DataFrame:
    """A row a question, kind of regressor and measure, over the takes that have both regressors.

    Both are measured on the same clips of each bootstrap sample, so that the interval is that of
    their difference: what is hard for both does not widen it. `answer` is `better` or `worse` where
    the interval of the difference leaves out 0, `level` where it does not, `unknown` without an
    interval.
    """
    named = [(kinds_of(of_take), frames) for of_take, frames in takes]
    rows = []
    for question in questions:
        for kind in KINDS:
            for measure, (above, below, root) in _MEASURES.items():
                pair = question.rows(kind)
                having = [
                    (of_take, frames)
                    for of_take, frames in named
                    if all(name in of_take and above in of_take[name].sums for name in pair)
                ]
                if not having or pair[0] == pair[1]:
                    continue
                sums = [ClipSums.joined(of_take[name] for of_take, _ in having) for name in pair]
                clips = len(sums[0].sums[above])
                resampling = Resampling.of(clips, samples, seed, confidence)
                values = [ratio_of(each, above, below, resampling.draws) for each in sums]
                if root:
                    values = [(np.sqrt(value), np.sqrt(drawn)) for value, drawn in values]
                (first, first_drawn), (second, second_drawn) = values
                low, high = resampling.interval(first_drawn - second_drawn)
                ratios = resampling.interval(first_drawn / second_drawn)
                frames = sum(frames for _, frames in having)
                rows.append(
                    (question.name, measure, *pair, first, second, first - second, low, high,
                     first / second, *ratios, frames, clips, _answer(low, high))
                )  # fmt: skip
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _row(kind: str, variant: str) -> str:
    if variant.startswith("="):
        return variant[1:]
    return f"{kind}/{variant}" if variant else kind


def _answer(low: float, high: float) -> str:
    if not np.isfinite(low):
        return "unknown"
    return "better" if high < 0 else "worse" if low > 0 else "level"
