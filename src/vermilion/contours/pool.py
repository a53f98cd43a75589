"""A large pool of generic fast features: weighted sums of boxes on the channels.

One kind of arithmetic covers the whole family of Dollar et al. 2006: a box on a colour channel is
a local mean, on an orientation channel an entry of a gradient histogram, on a derivative channel
a mean filter response; two to four boxes of alternating sign are Haar wavelets, and histogram
differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.contours.channels import PAD
from vermilion.storage.kernels import kernel

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
        """A pool of the features `ids` (n,) only."""
        return FeaturePool(self.channel[ids], self.boxes[ids], self.weights[ids])

    def evaluate(self, integrals: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Features (N, n) float32 at pixels `columns`, `rows` (n,) of `integrals` (C, H, W)."""
        flat, offsets, starts = self.laid_out(integrals, columns, rows)
        return _evaluate(flat, offsets, self.weights, starts)

    def laid_out(
        self, integrals: np.ndarray, columns: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For `box_feature` at pixels `columns`, `rows` (n,): `integrals` (C, H, W) flat, and places there.

        Of the corners of each feature's boxes from the pixel, (N, 4, 4): bottom right, top right,
        bottom left, top left; and of n pixels in the first channel, (n,). One sum a corner then.
        """
        _, height, width = integrals.shape
        plane = self.channel[:, None].astype(np.int64) * (height * width)
        left, top, right, bottom = np.moveaxis(self.boxes.astype(np.int64), -1, 0)
        corners = ((bottom, right), (top, right), (bottom, left), (top, left))
        offsets = np.stack([plane + y * width + x for y, x in corners], axis=-1)
        starts = (np.asarray(rows) + PAD) * width + np.asarray(columns) + PAD
        return integrals.reshape(-1), offsets, starts.astype(np.int64)


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


@kernel(inline="always")
def box_feature(flat, offsets, weights, f, start):
    """Feature f at one pixel of the region, of what `FeaturePool.laid_out` gives."""
    # Unused boxes are empty and summed all the same, and places are unsigned: a branch here that is
    # foreseen wrongly costs more than the sums.
    value = np.float32(0.0)
    for k in range(MAX_BOXES):
        total = (
            flat[np.uint64(start + offsets[f, k, 0])]
            - flat[np.uint64(start + offsets[f, k, 1])]
            - flat[np.uint64(start + offsets[f, k, 2])]
            + flat[np.uint64(start + offsets[f, k, 3])]
        )
        value += weights[f, k] * np.float32(total)
    return value


@kernel()
def _evaluate(flat, offsets, weights, starts):
    values = np.empty((len(offsets), len(starts)), dtype=np.float32)
    for f in range(len(offsets)):
        for i in range(len(starts)):
            values[f, i] = box_feature(flat, offsets, weights, f, starts[i])
    return values
