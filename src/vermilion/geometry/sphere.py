"""Even directions over the sphere."""

from __future__ import annotations

import numpy as np


def sphere_points(count: int) -> np.ndarray:
    """Even directions over the sphere (Fibonacci spiral), (count, 3) float64."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(angle), z, radius * np.sin(angle)], axis=1)
