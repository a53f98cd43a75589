"""Where a lip ends and gums begin.

Gums are nearly lip-coloured, and their border with the teeth is the stronger one. But the lip lies
before them: at its border it turns into its own shade, and the gums come out of that shade again. So
going from the lip into the mouth, the first dark crease with flesh on both sides is the inner border.
"""

from __future__ import annotations

import numpy as np

RED = 0.7  # per the lips': redness per lightness of flesh, whatever light falls on it
LEAST_RED = 0.05  # in an image without colour nothing is told from teeth
BLACK = 0.25  # per the lips' lightness: darker is the mouth's opening itself
BLURRED_PX = 2.0  # flesh beside something else is mixed with it
DEPTH = (0.1, 0.3)  # of no and of a sure crease: logarithm of lightness against both sides
FOOT = 0.1  # of a crease's depth: its border with the lip lies where the lip is as dark as this
LINE_PX = 2.0  # deviation of a crease's place


def flesh_plane(colours: np.ndarray, lip: np.ndarray) -> np.ndarray:
    """Where the image is flesh in light or shade, not teeth, skin or black, (size, size) float32.

    Args:
        colours: (3, size, size) as `channels.COLOUR_CHANNELS`.
        lip: (size, size) bool, where lips are sure to be.
    """
    lightness = np.maximum(colours[0], 1e-3)
    redness = (colours[1] - 0.5) / lightness
    red = redness > max(RED * float(np.median(redness[lip])), LEAST_RED)
    return (red & (lightness > BLACK * np.median(lightness[lip]))).astype(np.float32)


def creases(
    lightness: np.ndarray, flesh: np.ndarray, lip: np.ndarray, step_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """The crease of each line: how likely each place is its lip's end, and lies beyond it, (n, m).

    Args:
        lightness: (n, m) of lines that run outwards: from the mouth's opening over the lip.
        flesh: (n, m) bool. A line is followed over flesh alone, and to the first end of it.
        lip: (n, m) bool, inside the outer contour: a line is followed from there inwards.
        step_px: between the places of a line.
    """
    logs, flesh, lip = np.log(np.maximum(lightness, 0.02))[:, ::-1], flesh[:, ::-1], lip[:, ::-1]
    blurred = min(round(BLURRED_PX / step_px), flesh.shape[1] - 1)
    flesh = flesh & np.pad(flesh[:, blurred:], ((0, 0), (0, blurred)), constant_values=True)
    begun = np.maximum.accumulate(lip & flesh, axis=1)
    followed = begun & ~np.maximum.accumulate(begun & ~flesh, axis=1)
    logs = np.where(followed, logs, -np.inf)
    before = np.maximum.accumulate(logs, axis=1)
    after = np.maximum.accumulate(logs[:, ::-1], axis=1)[:, ::-1]
    depth = np.zeros(logs.shape)
    np.subtract(np.minimum(before, after), logs, out=depth, where=followed)
    deepest = depth.argmax(axis=1)[:, None]
    most, bottom = (np.take_along_axis(values, deepest, axis=1) for values in (depth, logs))
    places = np.arange(logs.shape[1])
    foot = (logs <= bottom + FOOT * most) & (np.maximum.accumulate(depth, axis=1) > 0)
    at = np.where(foot.any(axis=1), foot.argmax(axis=1), deepest[:, 0])[:, None]
    sure = np.clip((most - DEPTH[0]) / (DEPTH[1] - DEPTH[0]), 0.0, 1.0)
    line = np.exp(-0.5 * ((places - at) * step_px / LINE_PX) ** 2)
    beyond = np.where(places > at, 1.0 - line, 0.0)
    return (sure * line)[:, ::-1], (sure * beyond)[:, ::-1]
