"""The time line of a corrected take: where it leaves what the regressor was trained on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.imaging.plot import new_figure, plain, save, with_gaps

_LINE, _OUTSIDE, _NOT_CORRECTED = "#2a6f97", "#c8553d", "#dddddd"


def draw_timeline(quality: pd.DataFrame, title: str, out: str | Path) -> None:
    """Novelty with its limit, and the largest correction, over the frames; PNG.

    Without a regressor there is no novelty, and no panel of it.

    Args:
        quality: rows of the apply stage's quality tables in order of time: frame, valid, novelty,
            novelty_limit, largest_correction_mm.
    """
    frames = quality["frame"].to_numpy()
    novelty = quality["novelty"].to_numpy(dtype=float)
    limit = float(quality["novelty_limit"].iloc[0])
    outside = novelty > limit
    learnt = bool(np.isfinite(novelty).any())
    figure = new_figure(8.6, 3.6 if learnt else 2.2)
    axes = np.atleast_1d(figure.subplots(1 + learnt, 1, sharex=True))
    above, below = axes[0], axes[-1]
    said = "flagged" if not learnt else "outside the training's span"
    count = outside.sum() if learnt else (quality["valid"] == 0).sum()
    if learnt:
        above.plot(*with_gaps(frames, novelty), color=_LINE, lw=1.4)
        if np.isfinite(limit):
            above.axhline(limit, color=_OUTSIDE, lw=1.0, ls="--")
        above.plot(frames[outside], novelty[outside], ".", color=_OUTSIDE, ms=6)
        above.set_ylabel("novelty")
    above.set_title(
        f"{title}: {int(count)} of {len(frames)} frames {said}", loc="left", fontsize=10
    )
    moved = quality["largest_correction_mm"].to_numpy(dtype=float)
    below.plot(*with_gaps(frames, moved), color=_LINE, lw=1.4)
    below.set_ylabel("largest\ncorrection, mm")
    below.set_xlabel("frame")
    for axis in axes:
        plain(axis)
        axis.set_ylim(bottom=0)
        for frame in frames[quality["valid"].to_numpy() == 0]:
            axis.axvspan(frame - 0.5, frame + 0.5, color=_NOT_CORRECTED, lw=0)
        for frame in frames[outside]:
            axis.axvspan(frame - 0.5, frame + 0.5, color=_OUTSIDE, alpha=0.12, lw=0)
    save(figure, out)
