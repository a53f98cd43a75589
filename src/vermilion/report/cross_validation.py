"""The cross-validation curve as an image."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from vermilion.regression.cross_validation import Curve, Rule
from vermilion.storage.files import atomic_path


def plot_curve(path: str | Path, name: str, curve: Curve, choice: Rule = "simplest") -> None:
    """Held-out error over alpha, one line a beta, the choice marked; PNG."""
    figure, axes = plt.subplots(figsize=(6.4, 4.0), dpi=110, layout="constrained")
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
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})
    plt.close(figure)
