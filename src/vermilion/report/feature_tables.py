"""Lips16 tables 2 and 3, and its comparison of estimators with the best parameters of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from vermilion.config.regressors import split_name
from vermilion.evaluation.comparisons import KINDS

#: Variant -> what the tables call it.
FEATURES = {
    "shape-only": "shape coefficients",
    "distances-only": "contour distances",
    "": "combined",
}
ESTIMATORS = ("rbf", "affine", "kernel")


def table2(curves: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Influence of the features on the cross-validation error, PS and GR over all people.

    Args:
        curves: the cross-validation curve of each regressor, a row a grid point.

    Returns:
        columns features, regressor, feature_error, deviation (over folds), frames.
    """
    return _cross_validated(curves, FEATURES, "features")


def table3(table1: pd.DataFrame) -> pd.DataFrame:
    """Influence of the features on the tracking error of all takes together.

    Args:
        table1: with the variants.

    Returns:
        columns features, regressor, mean_mm, low_mm, high_mm, std_mm, ratio_to_base, frames.
    """
    return _tracked(table1, FEATURES, "features")


def estimators(
    curves: Sequence[pd.DataFrame], table1: pd.DataFrame, configured: str
) -> pd.DataFrame:
    """Every estimator with its best parameters: cross-validation and tracking error.

    Args:
        configured: the estimator of the configuration, which has no variant of its name.

    Returns:
        columns estimator, regressor, alpha, beta, feature_error, deviation, mean_mm, low_mm, high_mm,
        std_mm. Of PS and GR, alpha and beta are the medians over the people.
    """
    names = {"" if name == configured else name: name for name in ESTIMATORS}
    validated = _cross_validated(curves, names, "estimator").drop(columns="frames")
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
    table = pd.DataFrame(rows, columns=columns)
    return table if heading == "estimator" else table.drop(columns=["alpha", "beta"])


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
    return table[several].reset_index(drop=True)
