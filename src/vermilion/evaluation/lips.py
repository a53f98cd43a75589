"""The gap between the lips, and how deep one lies in the other, the same way for truth and result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.correction.lip_crossings import LipCrossings
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel

N_COLUMNS = 7


@dataclass(frozen=True)
class LipTolerances:
    """When lips count as touching, open, or one in the other; mm.

    Attributes:
        touch_mm: lips touch in truth where no column is open by more.
        gape_mm: a result is open where a column is open by more.
        through_mm: lips pass through each other where one lies deeper in the other.
    """

    touch_mm: float = 0.3
    gape_mm: float = 1.0
    through_mm: float = 0.05


def columns_of(model: FaceModel) -> np.ndarray:
    """(V,) column of each lip vertex within the middle half of the mouth, -1 outside.

    The columns stand side by side from the subject's right to their left, in the neutral.
    """
    sides = lip_sides(model, with_inside=True)
    return np.where(sides != 0, column_of_x(model, model.neutral_mm[:, 0]), -1)


def column_of_x(model: FaceModel, x_mm: np.ndarray) -> np.ndarray:
    """(n,) column of places across the mouth of the model's neutral, -1 outside the middle half.

    Args:
        x_mm: (n,) head frame.
    """
    x = model.neutral_mm[lip_sides(model) != 0, 0]
    start, width = x.min() + 0.25 * np.ptp(x), 0.5 * np.ptp(x) / N_COLUMNS
    column = np.floor((x_mm - start) / width).astype(np.int64)
    return np.where((column >= 0) & (column < N_COLUMNS), column, -1)


def lip_gaps(points_mm: np.ndarray, sides: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Height of the gap in each column, (F, N_COLUMNS) mm; 0 where the lips touch or overlap.

    Lowest point of the upper lip minus highest point of the lower lip.

    Args:
        points_mm: (F, V, 3) in the head frame (y up); NaN points do not count.
        sides, columns: (V,) of `lip_sides` with the inside, `columns_of`.
    """
    gaps = np.full((len(points_mm), N_COLUMNS), np.nan)
    height = points_mm[..., 1]
    for column in range(N_COLUMNS):
        upper = height[:, (columns == column) & (sides == 1)]
        lower = height[:, (columns == column) & (sides == -1)]
        if upper.shape[1] == 0 or lower.shape[1] == 0:
            continue
        lowest = np.where(np.isfinite(upper), upper, np.inf).min(axis=1)
        highest = np.where(np.isfinite(lower), lower, -np.inf).max(axis=1)
        gap = np.maximum(lowest - highest, 0.0)
        gaps[:, column] = np.where(np.isfinite(gap), gap, np.nan)
    return gaps


def aperture_mm(gaps: np.ndarray) -> np.ndarray:
    """Mean gap of the middle half of the mouth, (F,) mm, of gaps (F, columns)."""
    finite = np.isfinite(gaps)
    count = finite.sum(axis=1)
    total = np.where(finite, gaps, 0.0).sum(axis=1)
    return np.divide(total, count, out=np.full(len(gaps), np.nan), where=count > 0)


def lip_depths(sequence_mm: np.ndarray, model: FaceModel) -> np.ndarray:
    """How deep one lip lies in the other, (F,) mm, of sequence_mm (F, V, 3); 0 where neither does.

    Away from the corners of the mouth, where the lips are one surface.
    """
    crossings = LipCrossings(model)
    return np.array([crossings.find(vertices).deepest_mm for vertices in sequence_mm])
