"""Curves of a take over time, with its flagged frames and anchors."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from vermilion.imaging.plot import new_figure, plain, with_gaps

_FLAG, _INK = "#d23c2a", "#444444"
_COLOURS = ("#c8553d", "#2a6f97", "#8c8c8c")
#: Label of the axis -> (column, name in the legend) of its lines.
PANELS = {
    "drift, mm": (
        ("drift_mm_vermilion", "vermilion, median"),
        ("drift_mm_skin", "skin, median"),
        ("drift_p95_mm_vermilion", "vermilion, 95th percentile"),
    ),
    "texture\ndifference": (
        ("difference_vermilion", "vermilion"),
        ("difference_skin", "skin"),
    ),
    "residual, px": (("residual_px", ""),),
    "distance to\npoints, mm": (("cloud_distance_mm", ""),),
    "visible\nvertices": (("visible_vertices", ""),),
    "measured, %": (("measured_percent", ""),),
    "vertices in\ncontact": (("contact_vertices", ""),),
    "contact, mm": (("contact_deepest_mm", "deepest before"), ("contact_left_mm", "left after")),
    "similarity\nto the neutral": (("similarity", ""),),
}


def curves_figure(frames: pd.DataFrame, neutral: int) -> Figure:
    """A panel a figure of the take; `frames` as in `multiview_page.TakeFindings`."""
    panels = {
        label: [(column, name) for column, name in lines if column in frames]
        for label, lines in PANELS.items()
    }
    panels = {label: lines for label, lines in panels.items() if lines}
    figure = new_figure(9.6, 1.15 * len(panels) + 0.4)
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    numbers = frames["frame"].to_numpy()
    for axis, (label, lines) in zip(axes, panels.items(), strict=True):
        for (column, name), colour in zip(lines, _COLOURS, strict=False):
            values = frames[column].to_numpy(dtype=float)
            # a frame without neighbours, or a take of few frames, shows as dots
            marker = "." if len(numbers) <= 120 or column == "similarity" else ""
            axis.plot(
                *with_gaps(numbers, values), color=colour, lw=1.1, marker=marker, ms=3, label=name
            )
        _mark(axis, numbers[frames["valid"].to_numpy() == 0], _FLAG, "-")
        _mark(axis, numbers[frames["anchor"].to_numpy(dtype=bool)], _INK, "--")
        _mark(axis, np.array([neutral]), _INK, ":")
        axis.set_ylabel(label)
        plain(axis)
        if any(name for _, name in lines):
            axis.legend(
                loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, fontsize=7,
                borderaxespad=0,
            )  # fmt: skip
        if label != "similarity\nto the neutral":
            axis.set_ylim(bottom=0)
    axes[-1].set_xlabel("frame")
    figure.align_ylabels(axes)
    return figure


def _mark(axis, numbers: np.ndarray, colour: str, style: str) -> None:
    """Vertical lines, however many, in one stroke."""
    place = axis.get_xaxis_transform()
    axis.vlines(
        numbers, 0, 1, transform=place, color=colour, linestyle=style, lw=0.8, alpha=0.6, zorder=0
    )
