"""Lips16 tables 2 and 3, and its comparison of estimators with the best parameters of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from vermilion.baselines.null import NAME as NULL
from vermilion.config.regressors import split_name
from vermilion.evaluation.comparisons import KINDS

#: Variant -> what the tables call it.
FEATURES = {
    "shape-only": "shape coefficients",
    "distances-only": "contour distances",
    "": "combined",
}
ESTIMATORS = ("rbf", "affine", "kernel")
#: What the tables call the features and the estimator of `null`.
NOTHING = "none"


def table2(curves: Sequence[pd.DataFrame], measures: pd.DataFrame) -> pd.DataFrame:
    """Influence of the features on the cross-validation error, PS and GR over all people.

    Args:
        curves: the cross-validation curve of each regressor, a row a grid point.
        measures: every measure; the row of `null` is its error on held-out frames, as nothing is
            cross-validated that learns nothing.

    Returns:
        columns features, regressor, feature_error, deviation (over folds), frames.
    """
    table = _cross_validated(curves, FEATURES, "features")
    return _with_null(table, "features", measures).drop(columns=["alpha", "beta"])


def table3(table1: pd.DataFrame) -> pd.DataFrame:
    """Influence of the features on the tracking error of all takes together.

    Args:
        table1: with the variants.

    Returns:
        columns features, regressor, mean_mm, low_mm, high_mm, std_mm, ratio_to_base, frames.
    """
    return _tracked(table1, FEATURES, "features")


def estimators(
    curves: Sequence[pd.DataFrame], measures: pd.DataFrame, table1: pd.DataFrame, configured: str
) -> pd.DataFrame:
    """Every estimator with its best parameters: cross-validation and tracking error.

    Args:
        curves, measures: as `table2` takes them.
        table1: with the variants.
        configured: the estimator of the configuration, which has no variant of its name.

    Returns:
        columns estimator, regressor, alpha, beta, feature_error, deviation, mean_mm, low_mm, high_mm,
        std_mm. Of PS and GR, alpha and beta are the medians over the people.
    """
    names = {"" if name == configured else name: name for name in ESTIMATORS}
    validated = _cross_validated(curves, names, "estimator")
    validated = _with_null(validated, "estimator", measures).drop(columns="frames")
    tracked = _tracked(table1, names, "estimator").drop(columns=["ratio_to_base", "frames"])
    return validated.merge(tracked, on=["estimator", "regressor"], how="left")


def _cross_validated(
    curves: Sequence[pd.DataFrame], names: dict[str, str], heading: str
) -> pd.DataFrame:
    chosen = [curve[curve["chosen"] == 1].iloc[0] for curve in curves]
    rows = []
    for kind in KINDS:
        for variant, name in names.items():
            own = pd.DataFrame(
                [row for row in chosen if split_name(row["regressor"])[::2] == (kind, variant)]
            )
            if own.empty:
                continue
            weight = own["frames"].astype(float)
            folds = own["feature_error_se"] * np.sqrt(own["folds"].astype(float))
            rows.append(
                {
                    heading: name,
                    "regressor": kind,
                    "alpha": float(own["alpha"].median()),
                    "beta": float(own["beta"].median()),
                    "feature_error": float(
                        np.sqrt(np.average(own["feature_error"] ** 2, weights=weight))
                    ),
                    "deviation": float(np.average(folds, weights=weight)),
                    "frames": int(weight.sum()),
                }
            )
    columns = [heading, "regressor", "alpha", "beta", "feature_error", "deviation", "frames"]
    return pd.DataFrame(rows, columns=columns)


def _with_null(table: pd.DataFrame, heading: str, measures: pd.DataFrame) -> pd.DataFrame:
    """The table with a row for `null`, where its error on true layers was measured."""
    of_null = (measures["regressor"] == NULL) & (measures["measure"] == "feature_error")
    found = measures[of_null & (measures["subject"] == "all") & (measures["take"] == "all")]
    if table.empty or found.empty:
        return table
    row = found.iloc[0]
    table.loc[len(table)] = {
        heading: NOTHING, "regressor": NULL, "alpha": np.nan, "beta": np.nan,
        "feature_error": float(row["value"]), "deviation": np.nan, "frames": int(row["frames"]),
    }  # fmt: skip
    return table


def _tracked(table1: pd.DataFrame, names: dict[str, str], heading: str) -> pd.DataFrame:
    columns = ["mean_mm", "low_mm", "high_mm", "std_mm", "ratio_to_base", "frames"]
    together = table1[(table1["subject"] == "all") & (table1["take"] == "all")]
    rows = together.set_index("regressor")
    found = []
    for kind in KINDS:
        for variant, name in names.items():
            row = f"{kind}/{variant}" if variant else kind
            if row in rows.index:
                found.append({heading: name, "regressor": kind} | rows.loc[row, columns].to_dict())
    table = pd.DataFrame(found, columns=[heading, "regressor", *columns])
    # A regressor without variants shows no influence of features.
    several = table.groupby("regressor")[heading].transform("nunique") > 1
    table = table[several].reset_index(drop=True)
    if len(table) and NULL in rows.index:
        nothing = {heading: NOTHING, "regressor": NULL}
        table.loc[len(table)] = nothing | rows.loc[NULL, columns].to_dict()
    return table
