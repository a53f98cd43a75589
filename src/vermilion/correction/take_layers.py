"""Correction layers of a stretch of a take (Lips16 4.2), and where its vertices belong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.correction.layers import correction_layers
from vermilion.correspondence.correspondence import Correspondence
from vermilion.geometry.alignment import align_frames
from vermilion.geometry.head_frame import head_from_world
from vermilion.geometry.mesh import mesh_corners, vertex_areas
from vermilion.storage.arrays import write_arrays
from vermilion.storage.quality import QualityRow


@dataclass(frozen=True)
class TakeLayers:
    """Layers and what they say of themselves.

    Attributes:
        layers: (F, T, 9) float32 over the correspondence's mask; zero where not valid.
        coarse_mm: (F, V, 3) C, head frame.
        accurate_mm: (F, V, 3) H on C's topology, head frame.
        valid: (F,) bool.
        alignment_mm: (F,) RMS of the aligned regions against each other.
        strength: (F,) RMS of the layer's entries.
        folded: (F,) share of the mask's triangles turned by over a right angle.
    """

    layers: np.ndarray
    coarse_mm: np.ndarray
    accurate_mm: np.ndarray
    valid: np.ndarray
    alignment_mm: np.ndarray
    strength: np.ndarray
    folded: np.ndarray


def take_layers(
    correspondence: Correspondence,
    accurate_mm: np.ndarray,
    coarse_mm: np.ndarray,
    rotation: np.ndarray,
    translation_mm: np.ndarray,
    *,
    accurate_neutral_mm: np.ndarray | None = None,
    face: np.ndarray | None = None,
) -> TakeLayers:
    """Layers that turn **C** into **H**, free of head motion.

    Args:
        accurate_mm: (F, V_H, 3) H, world.
        coarse_mm: (F, V, 3) C, world.
        rotation, translation_mm: (F, 3, 3), (F, 3), the tracker's `world_from_head`.
        accurate_neutral_mm: (V_H, 3), H's own neutral, world: H is aligned to it, and it to C's neutral
            once. None: H is aligned to C in every frame.
        face: (V,) bool, the face of C: H is aligned on all of it outside the mask, by area, as the
            evaluation does. None: on the rigid region, without the fifth of it that fits worst.
    """
    coarse = head_from_world(coarse_mm, rotation, translation_mm)
    accurate = correspondence.on_coarse(np.asarray(accurate_mm))
    fixed = correspondence.rigid
    trimming: dict[str, Any] = {"trim": 0.2, "rounds": 2}
    if face is not None:
        fixed, trimming = _face_outside_mask(correspondence, face), {}
    target = coarse
    if accurate_neutral_mm is not None:
        neutral = correspondence.on_coarse(accurate_neutral_mm)[None]
        placed = align_frames(neutral, correspondence.coarse_neutral_mm, fixed, **trimming)
        target = placed.apply(neutral)[0]
    alignment = align_frames(accurate, target, fixed, **trimming)
    accurate, alignment_mm = alignment.apply(accurate), alignment.error_mm
    triangles = correspondence.coarse_triangles[correspondence.mask]
    corners = np.unique(triangles)
    valid = np.isfinite(accurate[:, corners]).all(axis=(1, 2))
    valid &= np.isfinite(coarse).all(axis=(1, 2))
    layers = np.zeros((len(coarse), len(triangles), 9), dtype=np.float32)
    for f in np.flatnonzero(valid):
        layers[f] = correction_layers(coarse[f], accurate[f], triangles)
    turn = np.linalg.norm(layers[..., :3], axis=-1)
    return TakeLayers(
        layers=layers,
        coarse_mm=coarse,
        accurate_mm=accurate,
        valid=valid,
        alignment_mm=alignment_mm,
        strength=np.sqrt((layers.astype(np.float64) ** 2).mean(axis=(1, 2))),
        folded=(turn > np.pi / 2).mean(axis=1),
    )


def _face_outside_mask(correspondence: Correspondence, face: np.ndarray) -> np.ndarray:
    """Area (V,) mm2 of the bound vertices of the face outside the mask; 0 elsewhere."""
    triangles = correspondence.coarse_triangles
    chosen = face & correspondence.vertices.bound
    chosen[mesh_corners(triangles, correspondence.mask)] = False
    return np.where(chosen, vertex_areas(correspondence.coarse_neutral_mm, triangles), 0.0)


def quality_rows(
    made: TakeLayers,
    frames: Sequence[int],
    *,
    tracked: np.ndarray,
    max_alignment_mm: float,
    failed: Mapping[int, str] | None = None,
) -> tuple[TakeLayers, list[QualityRow]]:
    """Flag the frames that no regressor may learn from, with the reason.

    Args:
        tracked: (F,) bool, what the tracking says of C.
        max_alignment_mm: of the aligned regions against each other (RMS).
        failed: frame -> why H is not to be learnt from; None: of no frame.

    Returns:
        (layers with `valid` narrowed, a row a frame).
    """
    rows, valid = [], made.valid.copy()
    for k, frame in enumerate(frames):
        reason = ""
        if not tracked[k]:
            reason = "the coarse track failed"
        elif failed and frame in failed:
            reason = failed[frame]
        elif not made.valid[k]:
            reason = "a mesh with vertices that are not finite"
        elif made.alignment_mm[k] > max_alignment_mm:
            reason = f"aligned regions {made.alignment_mm[k]:.1f} mm apart"
        figures = {
            "alignment_mm": float(made.alignment_mm[k]),
            "strength": float(made.strength[k]),
            "folded_share": float(made.folded[k]),
        }
        valid[k] = not reason
        rows.append(QualityRow(int(frame), not reason, reason, figures))
    return replace(made, valid=valid), rows


def displacements(made: TakeLayers, corners: np.ndarray) -> np.ndarray:
    """From C to H at the vertices `corners` (N,), head frame, (F, N, 3) mm; zero where not valid."""
    moved = (made.accurate_mm[:, corners] - made.coarse_mm[:, corners]).astype(np.float32)
    return np.where(made.valid[:, None, None], moved, np.float32(0.0))


def save_layers(
    path: str | Path,
    made: TakeLayers,
    frames: Sequence[int],
    mask: np.ndarray,
    triangles: np.ndarray,
) -> None:
    """Write frames (F,), layers (F, T, 9), displacement_mm (F, N, 3), mask (T,) and valid (F,), `.npz`.

    Displacements are those of the corners of the `mask` (T,) of `triangles` (U, 3), ascending.
    """
    write_arrays(
        path,
        frames=np.asarray(frames, dtype=np.int32),
        layers=made.layers,
        displacement_mm=displacements(made, mesh_corners(triangles, mask)),
        mask=np.asarray(mask, dtype=np.int32),
        valid=made.valid,
    )
