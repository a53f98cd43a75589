"""The headline: motion of the lips first, each regressor beside one that has learnt nothing."""

from __future__ import annotations

import numpy as np
import pandas as pd

from vermilion.config.regressors import in_order, is_variant

#: Column -> (measure, region) of `measures.tsv`.
_FIGURES = {
    "lip_motion_mm": ("lip_motion_error_mm", "vermilion"),
    "lip_motion_ratio": ("lip_motion_ratio", "vermilion"),
    "aperture_mm": ("aperture_error_mm", "mouth"),
    "aperture_ratio": ("aperture_ratio", "mouth"),
    "contour_error_px": ("contour_error_px", "mouth"),
    "vertex_error_mm": ("vertex_error_mean_mm", "mouth"),
    "ratio_to_base": ("ratio_to_base", "mouth"),
    "lip_shape_mm": ("lip_shape_error_mm", "vermilion"),
    "lve_mm2": ("lve_mm2", "vermilion"),
    "flipped_rate": ("flipped_rate", "vermilion"),
    "inner_mouth_rate": ("inner_mouth_rate", "vermilion"),
    "edge_roughness_ratio": ("edge_roughness_ratio", "vermilion"),
}
COLUMNS = ("regressor", *_FIGURES, "frames", "null", "over_null", "answer")
#: What each is held against: the regressor that learnt nothing and was told as much.
_NULL_OF = {
    "PS": ("null/neutral", "null"),
    "MS": ("null/neutral", "null"),
    "GR": ("null",),
    "GR/generic": ("null",),
    "PS/neutral": ("null/neutral",),
    "MS/neutral": ("null/neutral",),
    "GR/neutral": ("null/neutral",),
}


def headline(measures: pd.DataFrame, comparisons: pd.DataFrame) -> pd.DataFrame:
    """All takes together, a row a regressor without variants, motion of the lips first.

    Args:
        measures: rows of `measures.tsv`; comparisons: of `comparisons.tsv`.

    Returns:
        columns of `COLUMNS`. `over_null` is the lip motion error over that of the row `null` on the frames of
        both; `answer` says whether the interval of their difference leaves out 0.
    """
    rows = measures[(measures["subject"] == "all") & (measures["take"] == "all")]
    records = []
    for name in in_order(n for n in rows["regressor"] if n != "H" and not is_variant(n)):
        own = rows[rows["regressor"] == name].set_index(["measure", "region"])
        found = {c: own["value"].get(key, np.nan) for c, key in _FIGURES.items()}
        if name == "base":
            found |= {"lip_motion_ratio": 1.0, "aperture_ratio": 1.0, "ratio_to_base": 1.0}
        against = against_null(name, comparisons, "lip_motion_error_mm")
        records.append(
            {
                "regressor": name,
                **found,
                "frames": int(own["frames"].max()),
                "null": "" if against is None else against["second"],
                "over_null": np.nan if against is None else against["ratio"],
                "answer": "" if against is None else against["answer"],
            }
        )
    return pd.DataFrame(records, columns=list(COLUMNS))


def against_null(name: str, comparisons: pd.DataFrame, measure: str) -> pd.Series | None:
    """The comparison of a regressor with the one that learnt nothing; None where there is none."""
    for null in _NULL_OF.get(name, ()):
        found = comparisons[
            (comparisons["first"] == name)
            & (comparisons["second"] == null)
            & (comparisons["measure"] == measure)
        ]
        if len(found):
            return found.iloc[0]
    return None


def learning_sentences(table: pd.DataFrame, comparisons: pd.DataFrame) -> list[str]:
    """What learning brings over a regressor that learnt nothing, and on which measure: one a regressor.

    Args:
        table: of `headline`.
        comparisons: rows of `comparisons.tsv`.
    """
    found = []
    for name in table["regressor"]:
        motion, vertex = (
            against_null(name, comparisons, measure)
            for measure in ("lip_motion_error_mm", "vertex_error_mean_mm")
        )
        if motion is None:
            continue
        sentence = f"{name}: of the lips' motion {_figures(motion)}"
        if vertex is not None:
            sentence += f"; of the vertex error over the mouth {_figures(vertex)}"
        found.append(f"{sentence}, against {motion['second']}.")
    return found


def _figures(row: pd.Series) -> str:
    change = 100 * (1 - row["ratio"])
    answer = {"level": "not shown to differ", "unknown": "one clip, no interval"}.get(
        row["answer"], row["answer"]
    )
    return (
        f"{abs(change):.0f} % {'less' if change >= 0 else 'more'} is wrong "
        f"({row['first_value']:.2f} for {row['second_value']:.2f} mm: {answer})"
    )


def closing_table(table: pd.DataFrame) -> str:
    """The headline as text for a terminal, the motion of the lips first."""
    columns = {
        "regressor": "", "lip_motion_mm": "lip motion, mm", "lip_motion_ratio": "of base",
        "over_null": "of null", "aperture_mm": "opening, mm", "aperture_ratio": "of base",
        "vertex_error_mm": "vertices, mm", "ratio_to_base": "of base",
    }  # fmt: skip
    shown = table[list(columns)].map(
        lambda value: value if isinstance(value, str) else "" if pd.isna(value) else f"{value:.2f}"
    )
    return shown.to_string(index=False, header=list(columns.values()))
