"""Plots of the report: curves over time, table 1, RBF network against affine map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.config.regressors import in_order, is_variant, kind_of
from vermilion.imaging.plot import new_figure, plain, save, with_gaps
from vermilion.report.table1 import place_of

_INK = "#222222"
COLOURS = {
    "base": "#8c8c8c", "oracle": "#2b2b2b", "contour": "#b08d57", "PS": "#c8553d",
    "MS": "#2a6f97", "GR": "#4f8a3c", "H": "#7b5ea7", "truth": _INK,
}  # fmt: skip


def colour_of(regressor: str) -> str:
    """Colour of a regressor's line, the same in all figures."""
    return COLOURS.get(kind_of(regressor).split("/")[0], "#999999")


def line_style(regressor: str) -> str:
    """Dotted for truth, dashed for a variant."""
    return ":" if regressor == "truth" else "--" if "/" in regressor else "-"


def plot_curves(table: pd.DataFrame, title: str, out: str | Path) -> None:
    """Errors over time as PNG: mouth, vermilion, and the gap between the lips.

    Args:
        table: columns frame, regressor, vermilion_mm, mouth_mm, aperture_mm; the rows of regressor
            `truth` have the true aperture alone.
    """
    figure = new_figure(8.6, 6.6)
    axes = figure.subplots(3, 1, sharex=True)
    panels = (
        ("mouth_mm", "mouth, mm"),
        ("vermilion_mm", "vermilion, mm"),
        ("aperture_mm", "gap, mm"),
    )
    for axis, (column, text) in zip(axes, panels, strict=True):
        for regressor in [*in_order(r for r in table["regressor"] if r != "truth"), "truth"]:
            rows = table[table["regressor"] == regressor]
            axis.plot(
                *with_gaps(rows["frame"].to_numpy(), rows[column].to_numpy(dtype=float)),
                line_style(regressor), color=colour_of(regressor), lw=1.4, label=regressor,
            )  # fmt: skip
        axis.set_ylabel(text)
        plain(axis)
        axis.set_ylim(bottom=0)
    axes[0].set_title(title, loc="left", fontsize=10)
    axes[-1].set_xlabel("frame")
    handles, labels = axes[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=8, frameon=False, fontsize=8)
    save(figure, out)


def plot_table1(table: pd.DataFrame, out: str | Path) -> None:
    """Table 1 as an image: mean error of each regressor with its interval, a group a take.

    Variants are shown of all takes together alone.
    """
    whole = (table["subject"] == "all") & (table["take"] == "all")
    table = table[whole | ~table["regressor"].map(is_variant)]
    groups = list(table.groupby(["subject", "take"], sort=False))
    figure = new_figure(8.6, 0.9 + 0.26 * (len(table) + 1.5 * len(groups)))
    axis = figure.subplots()
    places, names, y = [], [], 0.0
    for (subject, take), rows in groups:
        axis.text(
            0, y, place_of(subject, take), fontsize=8.5, fontweight="bold", va="center", color=_INK
        )
        y += 1
        for row in rows.itertuples():
            axis.barh(y, row.mean_mm, 0.72, color=colour_of(row.regressor))
            if np.isfinite(row.low_mm):
                for colour, width in (("white", 2.4), (_INK, 1.1)):
                    axis.plot([row.low_mm, row.high_mm], [y, y], color=colour, lw=width)
            ratio = "" if row.regressor == "base" else f"  ({row.ratio_to_base:.2f} of base)"
            text = f"{row.mean_mm:.2f} ± {row.std_mm:.2f} mm{ratio}"
            edge = max(row.mean_mm, row.high_mm if np.isfinite(row.high_mm) else 0.0)
            axis.text(edge, y, "  " + text, fontsize=7.5, va="center", color=_INK)
            places.append(y)
            names.append(row.regressor)
            y += 1
        y += 0.5
    axis.set_yticks(places, names, fontsize=8)
    axis.invert_yaxis()
    axis.set_xlim(0, 1.5 * np.nanmax([1e-3, *table["mean_mm"], *table["high_mm"]]))
    axis.set_xlabel("mean vertex error over the mouth mask, mm (line: interval over clips)")
    plain(axis)
    axis.grid(False)
    save(figure, out)


def plot_figure16(
    takes: dict[str, pd.DataFrame], pairs: Sequence[tuple[str, str]], out: str | Path
) -> None:
    """Lips16 figure 16 as PNG: two regressors' error over the mouth, and in feature space, over time.

    Args:
        takes: `subject/take` -> columns frame, regressor, mouth_mm, feature_error.
        pairs: kinds of regressors (RBF network, affine map) in order of preference: of each take the
            first pair that it has is drawn.
    """
    panels = (("mouth_mm", "mouth, mm"), ("feature_error", "feature space"))
    figure = new_figure(8.6, 4.6)
    axes = figure.subplots(2, 1, sharex=True)
    colours, start, drawn = ("#2a6f97", "#c8553d"), 0, set()
    for name, table in takes.items():
        kinds = table["regressor"].map(kind_of)
        pair = next((p for p in pairs if set(p) <= set(kinds)), None)
        if pair is None:
            continue
        frames = table.loc[kinds == pair[0], "frame"].to_numpy()
        place = start + np.arange(len(frames))
        for axis, (column, _) in zip(axes, panels, strict=True):
            for regressor, colour, text in zip(
                pair, colours, ("RBF network", "affine map"), strict=True
            ):
                values = table.loc[kinds == regressor, column].to_numpy(dtype=float)
                label = text if text not in drawn and np.isfinite(values).any() else None
                drawn |= {text} if label else set()
                axis.plot(place, values, color=colour, lw=1.3, label=label)
        axes[0].text(place[0], 1.0, f" {name}, {pair[0].split('/')[0]}", fontsize=7, va="bottom",
                     color=_INK, transform=axes[0].get_xaxis_transform())  # fmt: skip
        for axis in axes:
            axis.axvline(place[-1] + 1, color="#d0cbc5", lw=0.8)
        start = place[-1] + 3
    for axis, (_, text) in zip(axes, panels, strict=True):
        axis.set_ylabel(text)
        plain(axis)
        axis.set_ylim(bottom=0)
    if not drawn:
        axes[0].text(0.5, 0.5, "evaluation.variants lacks `rbf` or `affine`", ha="center",
                     transform=axes[0].transAxes, color=_INK)  # fmt: skip
    axes[-1].set_xlabel(
        "held-out frames, take after take; the layers are known of tattoo takes alone"
    )
    handles, labels = axes[0].get_legend_handles_labels()
    if handles:
        figure.legend(
            handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=8
        )
    save(figure, out)
