"""The cross-validation curve as an image: SVG, as matplotlib takes longer to start than most regressors to train."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np

from vermilion.regression.cross_validation import Curve, Rule
from vermilion.storage.files import write_text

_WIDTH, _HEIGHT = 704, 440
_LEFT, _RIGHT, _TOP, _BOTTOM = 100, 690, 40, 385
#: Viridis, without its brightest part: dark for the first beta.
_COLOURS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [122, 209, 81]])


def plot_curve(path: str | Path, name: str, curve: Curve, choice: Rule = "simplest") -> None:
    """Held-out error over alpha, one line a beta, the choice marked; SVG."""
    mean, spread = curve.mean, curve.standard_error
    low, high = float((mean - spread).min()), float((mean + spread).max())
    margin = 0.05 * (high - low) or 0.05
    low, high = low - margin, high + margin
    x = _places(np.log10(curve.alphas), _LEFT + 27, _RIGHT - 18)
    y = _BOTTOM - (np.stack([mean, mean - spread, mean + spread]) - low) * (
        (_BOTTOM - _TOP) / (high - low)
    )
    row, column = curve.choose(choice)
    title = f"{name}: {len(curve.frames)} folds, {int(curve.frames.sum())} frames"
    labels = ["affine" if np.isnan(beta) else f"beta {beta:g}" for beta in curve.betas]
    colours = _colours(len(labels))
    parts = [*_frame(title), *_alpha_ticks(curve.alphas, x), *_error_ticks(low, high)]
    for beta, colour in enumerate(colours):
        parts += _line(x, y[:, beta], colour)
    parts += _legend([*labels, f"chosen: {mean[row, column]:.3f}"], [*colours, ""])
    parts.append(_ring(x[column], y[0, row, column]))
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{_HEIGHT}" '
        f'viewBox="0 0 {_WIDTH} {_HEIGHT}" font-family="sans-serif" font-size="13">'
    )
    write_text(path, "\n".join([head, *parts, "</svg>"]) + "\n")


def _places(values: np.ndarray, first: float, last: float) -> np.ndarray:
    """`values` (n,) spread from `first` to `last`; a single one in the middle."""
    span = np.ptp(values)
    return first + (last - first) * ((values - values.min()) / span if span else values * 0 + 0.5)


def _colours(count: int) -> list[str]:
    """Colours of `count` lines."""
    at = np.linspace(0, len(_COLOURS) - 1, count)
    channels = [np.interp(at, np.arange(len(_COLOURS)), values) for values in _COLOURS.T]
    return ["rgb({:.0f},{:.0f},{:.0f})".format(*values) for values in zip(*channels, strict=True)]


def _text(x: float, y: float, words: str, anchor: str = "middle", more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(words)}</text>'


def _path(d: str, colour: str, width: float) -> str:
    return f'<path d="{d}" fill="none" stroke="{colour}" stroke-width="{width:g}"/>'


def _ring(x: float, y: float) -> str:
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="7" fill="none" stroke="crimson" stroke-width="1.5"/>'
    )


def _frame(title: str) -> Iterator[str]:
    """White ground, box, title and names of the axes."""
    yield f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="white"/>'
    yield _path(f"M{_LEFT} {_TOP}H{_RIGHT}V{_BOTTOM}H{_LEFT}Z", "black", 1)
    middle = (_LEFT + _RIGHT) / 2
    yield _text(middle, _TOP - 14, title, more=' font-size="16"')
    yield _text(middle, _HEIGHT - 12, "ridge parameter alpha")
    for x, words in ((20, "error of held-out clips"), (37, "(RMS of layer entries)")):
        y = (_TOP + _BOTTOM) / 2
        yield _text(x, y, words, more=f' transform="rotate(-90 {x} {y:.1f})"')


def _alpha_ticks(alphas: np.ndarray, x: np.ndarray) -> Iterator[str]:
    for alpha, place in zip(alphas, x, strict=True):
        yield _path(f"M{place:.1f} {_TOP}V{_BOTTOM}", "#e6e6e6", 1)
        yield _text(place, _BOTTOM + 19, f"{alpha:g}")


def _error_ticks(low: float, high: float) -> Iterator[str]:
    """Lines at round values: steps of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / 12
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= rough)
    for value in np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step:
        y = _BOTTOM - (value - low) / (high - low) * (_BOTTOM - _TOP)
        yield _path(f"M{_LEFT} {y:.1f}H{_RIGHT}", "#e6e6e6", 1)
        yield _text(_LEFT - 7, y + 4.5, f"{value:.6g}", "end")


def _line(x: np.ndarray, y: np.ndarray, colour: str) -> Iterator[str]:
    """Means, and bars of a standard error: y (3, A) of the mean and of its ends, in pixels."""
    yield _path(
        "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y[0], strict=True)), colour, 1.6
    )
    bars = (
        f"M{a:.1f} {b:.1f}V{c:.1f}M{a - 3:.1f} {b:.1f}h6M{a - 3:.1f} {c:.1f}h6"
        for a, b, c in zip(x, y[1], y[2], strict=True)
    )
    yield _path("".join(bars), colour, 1)


def _legend(labels: list[str], colours: list[str]) -> Iterator[str]:
    """One row a label in the upper left corner; without a colour, the ring of the choice."""
    height = 17 * len(labels) + 8
    yield f'<rect x="{_LEFT + 6}" y="{_TOP + 6}" width="152" height="{height}" fill="white" fill-opacity="0.85" stroke="#ccc"/>'
    for index, (label, colour) in enumerate(zip(labels, colours, strict=True)):
        y = _TOP + 19 + 17 * index
        yield _path(f"M{_LEFT + 14} {y}h24", colour, 1.6) if colour else _ring(_LEFT + 26, y)
        yield _text(_LEFT + 46, y + 4.5, label, "start")
