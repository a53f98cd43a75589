"""Lips16 table 1: mean and deviation of the vertex error of every regressor."""

from __future__ import annotations

import pandas as pd

from vermilion.config.regressors import in_order


def place_of(subject: str, take: str) -> str:
    """Which frames a row is about, as a reader says it."""
    if subject != "all":
        return f"{subject}/{take}"
    return "all takes" if take == "all" else f"all {take} takes"


def table1(measures: pd.DataFrame, region: str = "mouth") -> pd.DataFrame:
    """Rows of table 1 in millimetres, one a take and regressor, and `all` for the takes together.

    Args:
        measures: rows of `measures.tsv`.

    Returns:
        columns subject, take, regressor, mean_mm, low_mm, high_mm, std_mm, ratio_to_base, ratio_low,
        ratio_high, base_mm, frames. `base_mm` is the base track on the regressor's own frames.
    """
    rows = measures[(measures["region"] == region) & (measures["regressor"] != "H")]
    records = []
    for (subject, take), of_take in rows.groupby(["subject", "take"], sort=False):
        for regressor in in_order(of_take["regressor"]):
            figures = of_take[of_take["regressor"] == regressor].set_index("measure")
            if "vertex_error_mean_mm" not in figures.index:
                continue
            mean = figures.loc["vertex_error_mean_mm"]
            value = figures["value"]
            ratio = figures.loc["ratio_to_base"] if "ratio_to_base" in figures.index else {}
            share = 1.0 if regressor == "base" else ratio.get("value")
            records.append(
                {
                    "subject": subject,
                    "take": take,
                    "regressor": regressor,
                    "mean_mm": mean["value"],
                    "low_mm": mean["low"],
                    "high_mm": mean["high"],
                    "std_mm": value.get("vertex_error_std_mm"),
                    "ratio_to_base": share,
                    "ratio_low": ratio.get("low"),
                    "ratio_high": ratio.get("high"),
                    "base_mm": mean["value"] / share if share else None,
                    "frames": int(mean["frames"]),
                }
            )
    columns = [
        "subject", "take", "regressor", "mean_mm", "low_mm", "high_mm", "std_mm",
        "ratio_to_base", "ratio_low", "ratio_high", "base_mm", "frames",
    ]  # fmt: skip
    table = pd.DataFrame(records, columns=columns)
    # The takes together come first.
    together = table["subject"] == "all"
    return pd.concat([table[together], table[~together]], ignore_index=True)
