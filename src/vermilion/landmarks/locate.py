"""Where faces are: a linear classifier of gradient histograms in a sliding window."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.landmarks.gradients import N_ORIENTATIONS, cell_map
from vermilion.landmarks.scheme import face_size_px

WINDOW_CELLS = 12
CELL_PX = 6
#: Side of the window over the face size.
WINDOW_PER_FACE = 1.35
#: Smallest face that is looked for, over the image's shorter side.
SMALLEST_FACE = 0.16
_STEP = 1.19


@dataclass(frozen=True)
class FaceLocator:
    """A linear window classifier.

    Attributes:
        weights: (12, 12, 8) float32.
        bias: float.
    """

    weights: np.ndarray
    bias: float

    def locate(self, grey: np.ndarray, count: int = 4) -> list[tuple[np.ndarray, float, float]]:
        """The likeliest faces in `grey` (h, w): (centre (2,) px, size px, score), best first, apart."""
        found = []
        for scale, cells, pad in pyramid(grey):
            score = np.zeros(cells.shape[:2], dtype=np.float32)
            for k in range(N_ORIENTATIONS):
                score += cv2.filter2D(
                    cells[..., k],
                    cv2.CV_32F,
                    self.weights[..., k],
                    borderType=cv2.BORDER_CONSTANT,
                    anchor=(0, 0),
                )
            score = score[: -WINDOW_CELLS + 1, : -WINDOW_CELLS + 1] + self.bias
            peak = score >= cv2.dilate(score, np.ones((3, 3)))
            rows, columns = np.nonzero(peak)
            best = np.argsort(-score[rows, columns], kind="stable")[: 2 * count]
            for r, c in zip(rows[best], columns[best], strict=True):
                centre = (np.array([c, r]) + WINDOW_CELLS / 2) * CELL_PX / scale - pad
                size = WINDOW_CELLS * CELL_PX / WINDOW_PER_FACE / scale
                found.append((centre, size, float(score[r, c])))
        return _apart(sorted(found, key=lambda face: -face[2]), count)


def pyramid(grey: np.ndarray):
    """Cell maps (scale, cells, pad) of `grey` (h, w), widened by `pad` px, at each face size."""
    window = WINDOW_CELLS * CELL_PX / WINDOW_PER_FACE
    shrink = min(1.0, 1.1 * window / (SMALLEST_FACE * min(grey.shape)))
    if shrink < 1:
        target = (round(grey.shape[1] * shrink), round(grey.shape[0] * shrink))
        grey = cv2.resize(grey, target, interpolation=cv2.INTER_AREA)
    side = min(grey.shape)
    size = 1.0 * side
    while size >= SMALLEST_FACE * side:
        scale, pad = window / size, round(0.3 * size)
        wide = cv2.copyMakeBorder(grey, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
        target = (max(round(wide.shape[1] * scale), 1), max(round(wide.shape[0] * scale), 1))
        small = cv2.resize(wide, target, interpolation=cv2.INTER_AREA)
        if min(small.shape) >= WINDOW_CELLS * CELL_PX:
            yield scale * shrink, cell_map(small, CELL_PX), pad / shrink
        size /= _STEP


def _apart(found, count):
    kept = []
    for centre, size, score in found:
        near = any(
            np.linalg.norm(centre - c) < 0.3 * min(size, s) and max(size, s) < 1.5 * min(size, s)
            for c, s, _ in kept
        )
        if not near:
            kept.append((centre, size, score))
        if len(kept) == count:
            break
    return kept


def train_locator(images: list[np.ndarray], points: np.ndarray, seed: int) -> FaceLocator:
    """Learn from labelled images.

    Args:
        images: N grey images (h, w) in [0, 1].
        points: (N, 66, 2) landmarks in pixels.
        seed: of the choice of backgrounds.
    """
    from sklearn.linear_model import LogisticRegression

    rng = np.random.default_rng(seed)
    positive, negative = [], []
    for grey, shape in zip(images, points, strict=True):
        centre = 0.5 * (shape.min(axis=0) + shape.max(axis=0))
        size = face_size_px(shape)
        for scale, cells, pad in pyramid(grey):
            this = WINDOW_CELLS * CELL_PX / WINDOW_PER_FACE / scale
            place = (centre + pad) * scale / CELL_PX - WINDOW_CELLS / 2
            windows = np.lib.stride_tricks.sliding_window_view(
                cells, (WINDOW_CELLS, WINDOW_CELLS), axis=(0, 1)
            )
            rows, columns = np.indices(windows.shape[:2])
            away = np.hypot(columns - place[0], rows - place[1]) / (WINDOW_CELLS / WINDOW_PER_FACE)
            ratio = abs(np.log(this / size))
            if ratio < 0.12:
                c, r = np.rint(place).astype(int)
                if 0 <= r < windows.shape[0] and 0 <= c < windows.shape[1]:
                    positive += [windows[r, c], windows[r, c][::-1]]
            bad = np.argwhere((away > 0.25) | (ratio > 0.4))
            for r, c in bad[rng.permutation(len(bad))[:10]]:
                negative.append(windows[r, c])
    # windows are (8, 12, 12); mirroring swaps columns and reflects orientations
    positive = [w if i % 2 == 0 else _mirrored(positive[i - 1]) for i, w in enumerate(positive)]
    x = np.array(positive + negative).reshape(len(positive) + len(negative), -1)
    y = np.repeat([1, 0], [len(positive), len(negative)])
    model = LogisticRegression(C=0.02, max_iter=300, class_weight="balanced").fit(x, y)
    weights = model.coef_[0].reshape(N_ORIENTATIONS, WINDOW_CELLS, WINDOW_CELLS)
    return FaceLocator(
        np.ascontiguousarray(weights.transpose(1, 2, 0), dtype=np.float32),
        float(model.intercept_[0]),
    )


def _mirrored(window: np.ndarray) -> np.ndarray:
    """A window (8, 12, 12) of the mirrored image: angle a becomes pi - a."""
    return window[(-np.arange(N_ORIENTATIONS)) % N_ORIENTATIONS, :, ::-1]
