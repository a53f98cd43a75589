"""What the comparisons say, in sentences that are composed from their figures."""

from __future__ import annotations

import numpy as np
import pandas as pd

_MOTION, _VERTEX, _LAYERS = "lip_motion_error_mm", "vertex_error_mean_mm", "feature_error"
_WORDS = {"better": "better", "worse": "worse", "level": "level", "unknown": "without interval"}


def statements(
    comparisons: pd.DataFrame, estimators: pd.DataFrame, table1: pd.DataFrame, configured: str
) -> list[tuple[str, list[str]]]:
    """(question, sentences) of every question that was answered, one sentence a kind of regressor.

    Args:
        comparisons, estimators, table1: tables of those modules.
        configured: the estimator of the configuration.
    """
    found = []
    for question, rows in comparisons.groupby("question", sort=False):
        motion = rows[rows["measure"] == _MOTION].to_dict("records")
        vertex = rows[rows["measure"] == _VERTEX]
        sentences = [sentence(row) + vertex_sentence(row, vertex) for row in motion]
        sentences += [
            reason
            for row in motion
            if row["answer"] != "better"
            and (reason := explanation(row, comparisons, estimators, table1, configured))
        ]
        found.append((str(question), sentences))
    return found


def sentence(row: dict) -> str:
    """One comparison of the lip motion in words."""
    change = 100 * (1 - row["ratio"])
    figures = (
        f"{row['first']} {row['first_value']:.2f} mm, {row['second']} {row['second_value']:.2f} mm, "
        f"{abs(change):.0f} % {'less' if change >= 0 else 'more'}"
    )
    if row["answer"] == "unknown":
        return f"{figures}; one clip, so no interval."
    interval = (
        f"difference {row['difference']:+.2f} mm, interval {row['low']:+.2f} to {row['high']:+.2f} "
        f"over {row['clips']} clips"
    )
    verdict = {
        "better": "better, and the interval leaves out 0",
        "worse": "worse, and the interval leaves out 0",
        "level": "not shown to differ: the interval holds 0",
    }[row["answer"]]
    return f"{figures} ({interval}): {verdict}."


def vertex_sentence(row: dict, vertex: pd.DataFrame) -> str:
    """The same comparison of the vertex error over the mouth, the static part included; may be empty."""
    same = vertex[(vertex["first"] == row["first"]) & (vertex["second"] == row["second"])]
    if same.empty:
        return ""
    found = same.iloc[0]
    change = 100 * (1 - found["ratio"])
    return (
        f" Vertex error over the mouth: {found['first_value']:.2f} mm, {found['second_value']:.2f} mm, "
        f"{abs(change):.0f} % {'less' if change >= 0 else 'more'} ({_WORDS[found['answer']]})."
    )


def explanation(
    row: dict,
    comparisons: pd.DataFrame,
    estimators: pd.DataFrame,
    table1: pd.DataFrame,
    configured: str,
) -> str:
    """Why a regressor has no advantage, by the other figures; may be empty.

    Three reasons are possible. The layers do not differ either, because features and layers depend on
    each other nearly linearly, as blend shapes do. Or the layers differ, but the errors of integration
    and rigid alignment hide it. Or cross-validation prefers one side and the held-out frames do not.
    """
    kind = row["first"].split("/")[0]
    parts = []
    layers = comparisons[
        (comparisons["measure"] == _LAYERS)
        & (comparisons["first"] == row["first"])
        & (comparisons["second"] == row["second"])
    ]
    if len(layers):
        change = 100 * (1 - float(layers["ratio"].iloc[0]))
        parts.append(
            f"in the layers themselves its error on held-out frames is {abs(change):.0f} % "
            f"{'less' if change >= 0 else 'more'} ({_WORDS[layers['answer'].iloc[0]]})"
        )
    pair = estimators[estimators["regressor"] == kind].set_index("estimator")["feature_error"]
    of_kind = [row[side].partition("/") for side in ("first", "second")]
    names = [variant or configured for _, _, variant in of_kind]
    # The base track and the contour baseline are no estimators: they have no cross-validation.
    if {name for name, _, _ in of_kind} == {kind} and all(name in pair.index for name in names):
        change = 100 * (1 - pair[names[0]] / pair[names[1]])
        parts.append(
            f"in cross-validation {abs(change):.0f} % {'less' if change >= 0 else 'more'}"
            + (", so that a linear map explains nearly all that these features can predict"
               if "affine" in names and abs(change) < 5 else "")
        )  # fmt: skip
    floor = table1[
        (table1["subject"] == "all") & (table1["take"] == "all") & (table1["regressor"] == "oracle")
    ]
    if len(floor) and np.isfinite(floor["mean_mm"].iloc[0]):
        parts.append(
            f"the true layers themselves leave a vertex error of {floor['mean_mm'].iloc[0]:.2f} mm, the floor of the method"
        )
    return f"Why, for {kind}: " + "; ".join(parts) + "." if parts else ""
