"""Whether the face of another piece of a take is another person's, by the shape of its landmarks.

The landmarks of brows, eyes and nose, with the depth that the detector tells, are turned and scaled onto each
other. Medians over a piece take expressions and noise out. In pieces of one person they differ by 0.004 to 0.014
eye distances, of two people by 0.030 to 0.048 (one real speaker, mirrored and made smaller too; two rendered people).
"""

from __future__ import annotations

import numpy as np

from vermilion.geometry.alignment import similarity_alignment
from vermilion.landmarks.faces import INNER_FACE, SeenFaces
from vermilion.landmarks.scheme import EYE_CORNERS, MOUTH

#: Landmarks that a person's face keeps, whatever it says.
KEPT = np.setdiff1d(INNER_FACE, MOUTH)


def other_persons(
    seen: SeenFaces, row: np.ndarray, piece: np.ndarray, limit: float
) -> dict[int, float]:
    """Pieces whose face differs from that of the first piece with a face: piece -> difference.

    Nothing is found where the detector tells no depth.

    Args:
        seen: faces of a take.
        row: (F,) the face of each frame among them; -1 where it is not there.
        piece: (F,) int piece of each frame.
        limit: least difference of two people, in eye distances.
    """
    reference: tuple[np.ndarray, float] | None = None
    found: dict[int, float] = {}
    for number in np.unique(piece):
        rows = row[(piece == number) & (row >= 0)]
        shapes = seen.shape[rows][:, KEPT].astype(np.float64)
        if not len(rows) or not np.abs(seen.shape[rows][..., 2]).max() > 0:
            continue
        eyes = np.linalg.norm(np.diff(seen.shape[rows][:, EYE_CORNERS], axis=1)[:, 0], axis=-1)
        shapes = shapes / np.median(eyes)
        onto = shapes[len(shapes) // 2] if reference is None else reference[0]
        shape, spread = _median_shape(shapes, onto)
        if reference is None:
            reference = shape, spread
            continue
        apart = _rms(shape - reference[0])
        if apart > max(limit, spread + reference[1]):
            found[int(number)] = float(apart)
    return found


def _median_shape(shapes: np.ndarray, onto: np.ndarray) -> tuple[np.ndarray, float]:
    """Median (K, 3) of shapes (n, K, 3) laid onto one (K, 3), and how much one differs from it."""
    laid = np.stack([similarity_alignment(shape, onto).apply(shape) for shape in shapes])
    median = np.median(laid, axis=0)
    return median, float(np.median([_rms(shape - median) for shape in laid]))


def _rms(apart: np.ndarray) -> float:
    return float(np.sqrt((apart**2).sum(axis=-1).mean()))
