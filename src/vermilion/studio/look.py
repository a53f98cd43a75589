"""How an actor looks: colours of skin, lips, eyes and brows, drawn from a seed."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

NOISE_SIZE = 64


class Look(NamedTuple):
    """Linear RGB albedos (3,) float32 and strengths; a NamedTuple so that numba can read it.

    `inside` is that of the inside of lips and cheeks; `wet` a factor of the gloss in the mouth.
    """

    skin: np.ndarray
    lips: np.ndarray
    brows: np.ndarray
    hair: np.ndarray
    cloth: np.ndarray
    iris: np.ndarray
    inside: np.ndarray
    gums: np.ndarray
    tongue: np.ndarray
    teeth: np.ndarray
    paint_light: np.ndarray
    paint_dark: np.ndarray
    grain: float
    tattoo: float
    wet: float
    shift_mm: np.ndarray


def look_of(seed: int, tattoo: bool) -> Look:
    """The look of the actor with this seed; with the lip tattoo or without."""
    rng = np.random.default_rng([seed, 7001])
    tone = rng.uniform(0.0, 1.0)
    fair, dark = np.array([0.52, 0.35, 0.265]), np.array([0.27, 0.155, 0.10])
    skin = fair + (dark - fair) * tone**1.3
    skin *= 1.0 + 0.04 * rng.standard_normal(3)
    lips = skin * np.array([0.90, 0.46, 0.52]) * (1.0 + 0.08 * rng.standard_normal(3))
    hair = np.array([0.05, 0.035, 0.028]) * rng.uniform(0.5, 2.5)
    cloths = np.array([[0.06, 0.08, 0.11], [0.12, 0.05, 0.05], [0.05, 0.10, 0.07], [0.2, 0.2, 0.2]])
    irises = np.array([[0.13, 0.06, 0.03], [0.07, 0.11, 0.06], [0.08, 0.15, 0.24]])

    def colour(values: np.ndarray | list[float]) -> np.ndarray:
        return np.asarray(values, dtype=np.float32)

    return Look(
        skin=colour(skin),
        lips=colour(lips),
        brows=colour(hair),
        hair=colour(hair),
        cloth=colour(cloths[rng.integers(len(cloths))]),
        iris=colour(irises[rng.integers(len(irises))]),
        inside=colour([0.26, 0.085, 0.08]),
        gums=colour([0.351, 0.11475, 0.108]),
        tongue=colour([0.40, 0.17, 0.15]),
        teeth=colour([0.62, 0.57, 0.46]),
        paint_light=colour([0.66, 0.64, 0.58]),
        paint_dark=colour([0.045, 0.065, 0.17]),
        grain=float(rng.uniform(0.85, 1.15)),
        tattoo=1.0 if tattoo else 0.0,
        wet=1.0,
        shift_mm=colour(rng.uniform(0, 1000, 3)),
    )


@cache
def noise_volume(seed: int = 20160) -> np.ndarray:
    """Smooth noise that tiles, (64, 64, 64) float32, deviation 1, blobs some four cells wide."""
    from scipy.ndimage import gaussian_filter

    white = np.random.default_rng(seed).standard_normal((NOISE_SIZE,) * 3)
    smooth = gaussian_filter(white, 1.0, mode="wrap")
    return ((smooth - smooth.mean()) / smooth.std()).astype(np.float32)
