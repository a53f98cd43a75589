"""The sections of the report that answer Lips16 section 6: comparisons, tables 2 and 3, kinds."""

from __future__ import annotations

import numpy as np
import pandas as pd

from vermilion.baselines.null import NAME as NULL
from vermilion.config.regressors import is_variant
from vermilion.evaluation.mouth_kinds import KINDS
from vermilion.report import page
from vermilion.report.statements import statements

_LACKING = (
    '<p class="none">Nothing was trained for this: <code>evaluation.variants</code> names what is '
    "made beside the configured regressors.</p>"
)


def comparison_section(
    comparisons: pd.DataFrame, estimators: pd.DataFrame, table1: pd.DataFrame, configured: str
) -> str:
    """What is better than what, by more than the interval over clips, or not."""
    found = statements(comparisons, estimators, table1, configured)
    if not found:
        return _LACKING
    note = (
        "<p>Mean vertex error over the mouth mask of held-out frames, and of the motion alone: without each "
        "vertex's mean offset over a take, which is of the person and the size. Both sides are measured on the same "
        "clips, and the interval is that of their difference. The figures are in "
        "<code>comparisons.tsv</code>.</p>"
    )
    return note + "".join(
        f"<h3>{page.text(question)}</h3><ul>"
        + "".join(f"<li>{page.text(sentence)}</li>" for sentence in sentences)
        + "</ul>"
        for question, sentences in found
    )


def feature_section(table2: pd.DataFrame, table3: pd.DataFrame) -> str:
    """Lips16 tables 2 and 3."""
    if table2["features"].nunique() < 2:
        return _LACKING
    errors = {
        "regressor": "regressor", "features": "features", "feature_error": "feature error",
        "deviation": "deviation over folds", "frames": "frames",
    }  # fmt: skip
    tracking = {
        "regressor": "regressor", "features": "features", "mean_mm": "mean, mm", "low_mm": "low",
        "high_mm": "high", "std_mm": "deviation, mm", "ratio_to_base": "of base", "frames": "frames",
    }  # fmt: skip
    several = table2.groupby("regressor")["features"].transform("nunique") > 1
    several |= table2["regressor"] == NULL
    return (
        "<h3>Table 2: cross-validation error</h3>"
        + page.table(_digits(table2[several], ["feature_error", "deviation"]), errors, "regressor")
        + "<p>Lips16, on its data: 0.14, 0.17 and 0.13 for shape coefficients, distances, both. "
        "<code>null</code> has learnt nothing; its error is that of the held-out frames.</p>"
        "<h3>Table 3: tracking error</h3>"
        + page.table(table3, tracking, "regressor")
        + "<p>Lips16, on its data: 3.2, 3.3 and 3.0 mm.</p>"
    )


def estimator_section(estimators: pd.DataFrame) -> str:
    """Estimators with their best parameters."""
    several = estimators.groupby("regressor")["estimator"].transform("nunique") > 1
    if not several.any():
        return _LACKING
    headings = {
        "regressor": "regressor", "estimator": "estimator", "alpha": "alpha", "beta": "beta",
        "feature_error": "cross-validation error", "deviation": "deviation over folds",
        "mean_mm": "tracking error, mm", "low_mm": "low", "high_mm": "high", "std_mm": "deviation, mm",
    }  # fmt: skip
    note = (
        "<p>Each with the parameters that cross-validation chose, over clips, for GR over people where at "
        "least three train (of PS and GR: the median over "
        "the people). Lips16, on its data: 0.13 for the RBF network, 0.14 for the affine map.</p>"
    )
    several |= estimators["regressor"] == NULL
    shown = _digits(estimators[several], ["alpha", "beta", "feature_error", "deviation"])
    return note + page.table(shown, headings, "regressor")


def kinds_section(table: pd.DataFrame) -> str:
    """Errors by kind of mouth shape."""
    rows = table[table["region"] == "mouth"].reset_index(drop=True)
    if rows.empty:
        return ""
    headings = {
        "kind": "kind", "regressor": "regressor", "mean_mm": "mean, mm", "low_mm": "low",
        "high_mm": "high", "ratio_to_base": "of base", "ratio_low": "low", "ratio_high": "high",
        "frames": "frames", "clips": "clips",
    }  # fmt: skip
    order = rows["kind"].map({kind: k for k, kind in enumerate(KINDS)})
    rows = rows.iloc[np.argsort(order, kind="stable")]
    rows = rows[~rows["regressor"].map(is_variant)]
    note = (
        "<p>Mean vertex error over the mouth mask by kind of mouth shape, all takes together. The vermilion "
        "alone, and variants, are in <code>kinds.tsv</code>.</p>"
    )
    return note + page.table(rows, headings, "kind")


def _digits(rows: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """The rows with some columns as text of three significant digits."""
    texts = {c: ["" if pd.isna(v) else f"{v:.3g}" for v in rows[c]] for c in columns}
    return rows.assign(**texts).reset_index(drop=True)
