"""Draws docs/figures/contour_distances.png: the twenty relative contour distances."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from vermilion.features.distances import HEIGHTS, LIPS

N = 80


def lips() -> tuple[np.ndarray, np.ndarray]:
    """A drawn mouth, outer and inner rings (N, 2)."""
    across = np.concatenate([np.linspace(-1, 1, N // 2 + 1), np.linspace(1, -1, N // 2 + 1)[1:-1]])
    upper = np.arange(N) <= N // 2
    bow = (1 - across**2) * (0.42 - 0.07 * np.exp(-((across / 0.13) ** 2)))
    outer = np.stack([across, np.where(upper, bow, -0.5 * (1 - across**2) ** 0.8)], axis=1)
    inside = np.clip(1 - (across / 0.85) ** 2, 0, None)
    inner = np.stack([across, np.where(upper, 0.16, -0.2) * inside], axis=1)
    return outer, inner


def main() -> None:
    outer, inner = lips()
    figure, axes = plt.subplots(1, 2, figsize=(9, 3), dpi=80)
    for axis in axes:
        for ring, colour in ((outer, "#2a9d4a"), (inner, "#d03a34")):
            axis.plot(*np.vstack([ring, ring[:1]]).T, color=colour, lw=1.8)
        axis.set_aspect("equal")
        axis.axis("off")
    tenth = N // 20
    axes[0].plot(*outer[[0, N // 2]].T, color="#333333", lw=1)
    axes[0].text(0.55, 0.01, "outer_width", fontsize=7)
    for j in HEIGHTS:
        ends = outer[[j * tenth, N - j * tenth]]
        axes[0].plot(*ends.T, "o-", color="#3577c8", lw=1, ms=3)
        axes[0].text(*(ends[0] + [0, 0.04]), str(j), fontsize=8, ha="center")
    axes[0].set_title("10 on the outer contour: outer_width, outer_height_1..9", fontsize=9)
    for j in LIPS:
        for k, side in ((j * tenth, 1), (N - j * tenth, -1)):
            axes[1].plot(*np.stack([outer[k], inner[k]]).T, "o-", color="#3577c8", lw=1, ms=3)
            place = outer[k] + [0, 0.04 if side > 0 else -0.1]
            axes[1].text(*place, str(j), fontsize=8, ha="center")
    axes[1].set_title("10 between the contours: upper_lip_j, lower_lip_j", fontsize=9)
    figure.tight_layout()
    figure.savefig(Path(__file__).with_suffix(".png"), metadata={"Software": None})


if __name__ == "__main__":
    main()
