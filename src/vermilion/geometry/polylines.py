"""Points along a polyline, by its length."""

from __future__ import annotations

import numpy as np


def lengths_along(points: np.ndarray) -> np.ndarray:
    """Length of a polyline `points` (n, D) up to each of its points, (n,), from 0; same unit."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def points_at(points: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Points (m, D) of a polyline `points` (n, D) at some `lengths` (m,) along it, same unit."""
    along = lengths_along(points)
    return np.stack([np.interp(lengths, along, column) for column in points.T], axis=1)


def evenly_along(points: np.ndarray, count: int) -> np.ndarray:
    """Points (count, D), evenly spaced from the first to the last of a polyline `points` (n, D)."""
    return points_at(points, np.linspace(0.0, lengths_along(points)[-1], count))
