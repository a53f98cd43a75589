"""A large pool of generic fast features: weighted sums of boxes on the channels.

One kind of arithmetic covers the whole family of Dollar et al. 2006: a box on a colour channel is
a local mean, on an orientation channel an entry of a gradient histogram, on a derivative channel
a mean filter response; two to four boxes of alternating sign are Haar wavelets, and histogram
differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from vermilion.contours.channels import PAD

MAX_BOXES = 4
KINDS = ("mean", "two_across", "two_down", "three_across", "three_down", "checker", "apart")


@dataclass(frozen=True)
class FeaturePool:
    """N features, each up to four boxes on one channel.

    Attributes:
        channel: (N,) int16.
        boxes: (N, 4, 4) int16, x0, y0, x1, y1 relative to the pixel (right and bottom exclusive);
            unused boxes are empty.
        weights: (N, 4) float32, one over the box's area, signed.
    """

    channel: np.ndarray
    boxes: np.ndarray
    weights: np.ndarray

    def __len__(self) -> int:
        return len(self.channel)

    def take(self, ids: np.ndarray) -> FeaturePool:
        """A pool of the features `ids` only."""
        return FeaturePool(self.channel[ids], self.boxes[ids], self.weights[ids])

    def evaluate(self, integrals: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Features at n pixels, (N, n) float32, from `integral_images`."""
        return _evaluate(integrals, columns, rows, self.channel, self.boxes, self.weights)


def random_pool(
    n_features: int, n_channels: int, patch_px: int, random: np.random.Generator
) -> FeaturePool:
    """Draw features inside a patch of `patch_px` (side, region pixels) round the pixel.

    Sizes are drawn uniformly in octaves, so that fine and coarse boxes are equally frequent.
    """
    half = patch_px // 2
    if half > PAD:
        raise ValueError(f"a patch of {patch_px} px does not fit the integral images' margin")
    channel = random.integers(0, n_channels, n_features).astype(np.int16)
    boxes = np.zeros((n_features, MAX_BOXES, 4), dtype=np.int16)
    weights = np.zeros((n_features, MAX_BOXES), dtype=np.float32)
    for index in range(n_features):
        placed = _draw(KINDS[random.integers(len(KINDS))], half, random)
        for slot, (x, y, width, height, sign) in enumerate(placed):
            boxes[index, slot] = (x, y, x + width, y + height)
            weights[index, slot] = sign / (width * height)
    return FeaturePool(channel, boxes, weights)


def _draw(kind: str, half: int, random: np.random.Generator) -> list[tuple]:
    across, down = {
        "two_across": (2, 1),
        "two_down": (1, 2),
        "three_across": (3, 1),
        "three_down": (1, 3),
        "checker": (2, 2),
    }.get(kind, (1, 1))
    width = _size(half * 2 // across, random)
    height = _size(half * 2 // down, random)
    x, y = _corner(across * width, half, random), _corner(down * height, half, random)
    if kind == "mean":
        return [(x, y, width, height, 1.0)]
    if kind == "apart":
        other = (_corner(width, half, random), _corner(height, half, random))
        return [(x, y, width, height, 1.0), (*other, width, height, -1.0)]
    return [
        (x + i * width, y + j * height, width, height, -1.0 if (i + j) % 2 else 1.0)
        for j in range(down)
        for i in range(across)
    ]


def _size(limit: int, random: np.random.Generator) -> int:
    return int(np.clip(np.floor(2.0 ** random.uniform(0.0, np.log2(limit + 1))), 1, limit))


def _corner(extent: int, half: int, random: np.random.Generator) -> int:
    return int(random.integers(-half, half - extent + 2))


@numba.njit(cache=True, inline="always")
def box_feature(integrals, column, row, channel, boxes, weights):
    """One feature at one pixel of the region."""
    plane = integrals[channel]
    x, y = column + PAD, row + PAD
    value = np.float32(0.0)
    for k in range(MAX_BOXES):
        weight = weights[k]
        if weight == 0.0:
            break
        left, top, right, bottom = boxes[k]
        total = (
            plane[y + bottom, x + right]
            - plane[y + top, x + right]
            - plane[y + bottom, x + left]
            + plane[y + top, x + left]
        )
        value += weight * np.float32(total)
    return value


@numba.njit(cache=True)
def _evaluate(integrals, columns, rows, channel, boxes, weights):
    values = np.empty((len(channel), len(columns)), dtype=np.float32)
    for f in range(len(channel)):
        for i in range(len(columns)):
            values[f, i] = box_feature(
                integrals, columns[i], rows[i], channel[f], boxes[f], weights[f]
            )
    return values
