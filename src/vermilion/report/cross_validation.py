"""The cross-validation curve as an image."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from vermilion.imaging.plot import new_figure, save
from vermilion.regression.cross_validation import Curve, Rule


def plot_curve(path: str | Path, name: str, curve: Curve, choice: Rule = "simplest") -> None:
    """Held-out error over alpha, one line a beta, the choice marked; PNG."""
    figure = new_figure(6.4, 4.0)
    axes = figure.add_subplot()
    mean, deviation = curve.mean, curve.standard_error
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(curve.betas)))
    for beta, error, spread, colour in zip(curve.betas, mean, deviation, colours, strict=True):
        text = "affine" if np.isnan(beta) else f"beta {beta:g}"
        axes.errorbar(curve.alphas, error, spread, label=text, color=colour, capsize=2, lw=1.2)
    row, column = curve.choose(choice)
    alpha, error = curve.alphas[column], mean[row, column]
    axes.plot([alpha], [error], "o", ms=10, mfc="none", mec="crimson", label=f"chosen: {error:.3f}")
    axes.set(
        xscale="log",
        xlabel="ridge parameter alpha",
        ylabel="error of held-out clips\n(RMS of layer entries)",
        title=f"{name}: {len(curve.frames)} folds, {int(curve.frames.sum())} frames",
    )
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)
