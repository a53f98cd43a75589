"""Where a lip ends and the dark of the mouth begins.

A lip darkens towards the opening: its shade is its own. What is black beside it is the opening, however
far inside the landmarks' lips it lies: networks draw rounded and nearly closed mouths too wide.
"""

from __future__ import annotations

import numpy as np

DARK = (0.5, 0.3)  # of no and of a sure hole: its lightness per the lip's
DEEP_PX = 6.0  # a hole is as dark as its darkest place so near to its edge
#: From so near to the start on a lip only darkens; what is lighter again by so much is something else.
NEAR_PX, RISE = 2.0, 1.1
GLOSS = 1.2  # per the lips' lightness: what is lighter of a lip is gloss


def hole_edges(
    lightness: np.ndarray, flesh: np.ndarray, lip: np.ndarray, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The first dark place of each line that comes over flesh: index (n,) of its edge, and how sure it is.

    Args:
        lightness: (n, m) of lines that run outwards: from the mouth's opening over the lip.
        flesh: (n, m) bool, lips, gums or tongue. A line is followed from the lip inwards over flesh and shade.
        lip: (n, m) bool, inside the outer contour.
        places: (m,) px of a line from where the border is thought to be: there a line must be on the lip.
    """
    light, flesh, lip = (values[:, ::-1] for values in (lightness, flesh, lip))
    usual = float(np.median(light[lip & flesh])) if (lip & flesh).any() else 0.0
    begun = np.maximum.accumulate(lip & flesh & (places[::-1] >= 0), axis=1)
    before = np.minimum(np.maximum.accumulate(np.where(begun, light, 0.0), axis=1), GLOSS * usual)
    other = begun & ~flesh & (light > DARK[0] * before)  # teeth, as a rule
    dim = np.minimum.accumulate(np.where(places[::-1] <= NEAR_PX, light, np.inf), axis=1)
    other |= light > RISE * dim  # a tongue or gums, behind the shade of the lip
    followed = begun & ~np.maximum.accumulate(other, axis=1)
    deep = light.copy()
    for shift in range(1, round(DEEP_PX / (places[1] - places[0])) + 1):
        deep[:, :-shift] = np.minimum(deep[:, :-shift], light[:, shift:])
    edge = followed & (light <= 0.5 * (before + deep)) & (deep < DARK[0] * before)
    at = edge.argmax(axis=1)
    rows = np.arange(len(at))
    share = deep[rows, at] / np.maximum(before[rows, at], 1e-6)
    sure = np.where(edge.any(axis=1), np.clip((DARK[0] - share) / (DARK[0] - DARK[1]), 0, 1), 0.0)
    return lightness.shape[1] - 1 - at, sure
