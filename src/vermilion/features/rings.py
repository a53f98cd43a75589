"""Sample points on the lip contours of the template geometry, once a face model (Lips16 5.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.contours import contour_halves
from vermilion.faces.model import FaceModel


@dataclass(frozen=True)
class Ring:
    """Points on a closed loop of edges.

    Sample 0 is the subject's right mouth corner, sample n / 2 the left one; the samples between
    run over the upper lip, those after back under the lower lip. Each half is sampled evenly in
    arc length on the neutral, so that sample k lies above sample n - k.

    Attributes:
        start, end: (n,) vertices of the edge that holds each sample.
        fraction: (n,) place on that edge.
    """

    start: np.ndarray
    end: np.ndarray
    fraction: np.ndarray

    def __len__(self) -> int:
        return len(self.start)

    def points(self, vertices: np.ndarray) -> np.ndarray:
        """Samples (..., n, 3) on a mesh `vertices` (..., V, 3)."""
        along = self.fraction[:, None]
        return vertices[..., self.start, :] * (1 - along) + vertices[..., self.end, :] * along


def lip_rings(model: FaceModel, n_samples: int) -> tuple[Ring, Ring]:
    """(outer, inner) rings of `n_samples` (a multiple of 4) each."""
    return (
        _ring(model, model.outer_contour, n_samples),
        _ring(model, model.inner_contour, n_samples),
    )


def _ring(model: FaceModel, loop: np.ndarray, n_samples: int) -> Ring:
    above, below = contour_halves(model.neutral_mm, model.landmarks, loop)
    parts = [_along(model.neutral_mm, half, n_samples // 2) for half in (above, below[::-1])]
    return Ring(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _along(
    vertices: np.ndarray, path: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`count` places evenly along a path of vertices, the last end left out."""
    lengths = np.linalg.norm(np.diff(vertices[path], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.linspace(0.0, along[-1], count, endpoint=False)
    edge = np.clip(np.searchsorted(along, places, side="right") - 1, 0, len(lengths) - 1)
    fraction = (places - along[edge]) / np.maximum(lengths[edge], 1e-12)
    return path[edge], path[edge + 1], fraction
