"""Curves and bars in one style, as PNG whose bytes depend on the figure alone."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vermilion.storage.files import atomic_path


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that arranges its axes by itself."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    matplotlib.rcParams["font.size"] = 8.5
    return figure


def plain(axis) -> None:
    """Two spines and horizontal lines only."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="y", color="#e6e6e6", lw=0.7)
    axis.set_axisbelow(True)


def with_gaps(frames: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`frames` (F,) and `values` (F,), each (F + jumps,) with a NaN where frame numbers jump.

    So no line is drawn across.
    """
    jumps = np.flatnonzero(np.diff(frames) > 1) + 1
    return np.insert(frames.astype(float), jumps, np.nan), np.insert(values, jumps, np.nan)


def png(figure: Figure) -> bytes:
    """The figure as a PNG file."""
    stream = io.BytesIO()
    figure.savefig(stream, dpi=120, format="png", metadata={"Software": None})
    return stream.getvalue()


def save(figure: Figure, out: str | Path) -> None:
    """Write the figure as a PNG file."""
    with atomic_path(out) as temporary:
        temporary.write_bytes(png(figure))
