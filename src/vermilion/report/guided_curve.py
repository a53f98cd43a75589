"""Figure 11 of Guided18: what is left against the number of corrected frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.imaging.plot import new_figure, plain, save

_COLOURS = {
    "suggested": "#c8553d", "uniform": "#2a6f97", "extremes": "#b08d57", "random": "#8c8c8c",
}  # fmt: skip
_PANELS = (
    ("guided_ratio", "share of the inner lips'\ndeformation that is left"),
    ("guided_gradient_error", "mean of |x* - x|\nof the gradients"),
)


def draw_guided_curve(measures: pd.DataFrame, title: str, out: str | Path) -> None:
    """Both measures over the number of corrected frames, a line a choice; PNG.

    Args:
        measures: rows of `measures.tsv` whose regressors are `guided/<k>/<choice>`.
        title: of the figure.
        out: file.
    """
    split = measures["regressor"].str.split("/", expand=True)
    table = measures.assign(count=split[1].astype(int), choice=split[2])
    figure = new_figure(8.6, 3.6)
    axes = np.atleast_1d(figure.subplots(1, len(_PANELS)))
    for axis, (measure, label) in zip(axes, _PANELS, strict=True):
        for choice, rows in table[table["measure"] == measure].groupby("choice", sort=False):
            rows, colour = rows.sort_values("count"), _COLOURS[str(choice)]
            axis.plot(rows["count"], rows["value"], "o-", color=colour, ms=3, lw=1.4, label=choice)
            axis.fill_between(
                rows["count"], rows["low"], rows["high"], color=colour, alpha=0.12, lw=0
            )
        axis.set_xlabel("corrected frames")
        axis.set_ylabel(label)
        axis.set_ylim(bottom=0)
        plain(axis)
    axes[0].set_title(title, loc="left", fontsize=10)
    axes[-1].legend(frameon=False, fontsize=8)
    save(figure, out)
