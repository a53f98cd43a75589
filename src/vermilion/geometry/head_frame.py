"""The canonical head frame: layers and integration know no head motion (Lips16 5.2, last line)."""

from __future__ import annotations

import numpy as np

from vermilion.geometry.alignment import move_frames


def head_from_world(
    vertices_mm: np.ndarray, rotation: np.ndarray, translation_mm: np.ndarray
) -> np.ndarray:
    """Meshes of the world in the head frame.

    Args:
        vertices_mm: (F, V, 3) in the world, mm.
        rotation, translation_mm: (F, 3, 3), (F, 3) `world_from_head`.

    Returns:
        (F, V, 3) float64 in the head frame, mm.
    """
    centred = np.asarray(vertices_mm, np.float64) - translation_mm[:, None]
    return centred @ rotation


def world_from_head(
    vertices_mm: np.ndarray, rotation: np.ndarray, translation_mm: np.ndarray
) -> np.ndarray:
    """Meshes of the head frame in the world, the inverse of `head_from_world`.

    Args:
        vertices_mm: (F, V, 3) in the head frame, mm.
        rotation, translation_mm: (F, 3, 3), (F, 3) `world_from_head`.

    Returns:
        (F, V, 3) float64 in the world, mm.
    """
    return move_frames(vertices_mm, rotation, translation_mm)
