"""The smooth surface that a ring of lip samples lies on, so that search lines follow the face."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def arch_depth(ring: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Depth (..., 1) mm of points (..., 3) on the arch a + b x + c y + d x^2 nearest to a ring.

    Lips bend round the teeth: a line that kept its sample's depth would leave the face near the
    corners of the mouth. Points of the image, (..., 2), have no depth: the answer is (..., 0).

    Args:
        ring: (n, 3) mm in the head frame, or (n, 2) px.
    """
    if ring.shape[1] == 2:
        return lambda points: points[..., 2:]
    middle = ring[:, :2].mean(axis=0)
    size = max(float(np.ptp(ring[:, 0])), 1e-9)

    def terms(points):
        x, y = np.moveaxis((points[..., :2] - middle) / size, -1, 0)
        return np.stack([np.ones_like(x), x, y, x**2], axis=-1)

    # A trace of ridge: a ring without height says nothing of the slope along y.
    basis = terms(ring)
    normal = basis.T @ basis + 1e-6 * len(ring) * np.eye(4)
    coefficients = np.linalg.solve(normal, basis.T @ ring[:, 2])
    return lambda points: (terms(points) @ coefficients)[..., None]
