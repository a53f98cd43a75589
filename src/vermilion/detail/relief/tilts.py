"""Normals as tilts against the smooth mesh, and their average over neighbouring frames.

Tilts are relative to tangents that move with the surface, so rotation of the head between the frames
does not blur the average.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.mesh import normalised


def tangents(skin_mm: np.ndarray, normals: np.ndarray, topology: FineTopology) -> np.ndarray:
    """Two unit tangents (2, S, 3) of the skin: towards a fixed neighbour, and perpendicular.

    Args:
        skin_mm: (S, 3).
        normals: (S, 3) unit.
        topology: of the skin.
    """
    towards = skin_mm[topology.beside] - skin_mm
    first = normalised(towards - (towards * normals).sum(axis=1, keepdims=True) * normals)
    return np.stack([first, np.cross(normals, first)])


def tilts_of(smooth: np.ndarray, tangent: np.ndarray, fine: np.ndarray) -> np.ndarray:
    """Tilts (S, 2) of normals `fine` (S, 3) against `smooth` (S, 3) along `tangent` (2, S, 3)."""
    height = np.maximum((fine * smooth).sum(axis=1), 0.1)
    return np.stack([(fine * t).sum(axis=1) / height for t in tangent], axis=1)


def tilted_normals(smooth: np.ndarray, tangent: np.ndarray, tilts: np.ndarray) -> np.ndarray:
    """Unit normals (S, 3) with `tilts` (S, 2) against `smooth` (S, 3) along `tangent` (2, S, 3)."""
    return normalised(smooth + tilts[:, :1] * tangent[0] + tilts[:, 1:] * tangent[1])


def average_tilts(
    read: Callable[[int], np.ndarray], frame: int, span: tuple[int, int], window: int
) -> np.ndarray:
    """Mean tilts (S, 2) over a symmetric window of frames, weighted by their trust.

    Args:
        read: frame -> (S, 3) two tilts and trust.
        frame: middle of the window.
        span: first and last frame of the take; near an end the window is shortened on both sides.
        window: frames, odd.
    """
    half = min(window // 2, frame - span[0], span[1] - frame)
    around = np.stack([read(f) for f in range(frame - half, frame + half + 1)]).astype(np.float64)
    trust = around[..., 2:]
    return (trust * around[..., :2]).sum(axis=0) / np.maximum(trust.sum(axis=0), 1e-6)
