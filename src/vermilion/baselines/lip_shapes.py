"""Lip shapes of the training, for the tracker that Lips16 section 6 compares with.

The paper lets a user select 30 expressive lip shapes of the multi-view reconstructions. Here they
are chosen as the medoids of all training frames by the shape of their lips, the neutral being one
more medoid that is always there; nothing is random.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from vermilion.correction.integration import LayerIntegrator
from vermilion.correction.layers import correction_layers
from vermilion.correspondence.correspondence import Correspondence
from vermilion.geometry.alignment import align_frames
from vermilion.storage.arrays import read_arrays, write_arrays

_ROUNDS = 20


@dataclass(frozen=True)
class LipShapes:
    """Chosen shapes of the training, as what they do to a neutral.

    Attributes:
        take: (S,) str `subject/take`; frame: (S,) int.
        mask: (M,) ids of the coarse triangles that move.
        layers: (S, M, 9) deformation gradients from the person's own neutral, as nine numbers.
    """

    take: np.ndarray
    frame: np.ndarray
    mask: np.ndarray
    layers: np.ndarray

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, compressed=True, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> LipShapes:
        """Read what `save` wrote."""
        return cls(**read_arrays(path, "file of lip shapes", [f.name for f in fields(cls)]))

    def on(self, neutral_mm: np.ndarray, triangles: np.ndarray, seam_mm: float) -> np.ndarray:
        """Displacements (S, V, 3) mm on another identity: deformation transfer (Sumner 2004).

        Args:
            neutral_mm: (V, 3) of the identity, head frame, as open as the neutrals of the training.
            triangles: (T, 3) of it.
            seam_mm: width of the soft ring round the mask.
        """
        rest = np.broadcast_to(neutral_mm, (len(self.layers), *neutral_mm.shape))
        integrator = LayerIntegrator(neutral_mm, triangles, self.mask, seam_mm)
        return integrator.integrate(rest, self.layers.astype(np.float64)) - neutral_mm


@dataclass(frozen=True)
class PosedTake:
    """**H** of some frames on the coarse topology, without head motion.

    Attributes:
        take: `subject/take`; frames: (F,).
        neutral_mm: (V, 3) H's neutral; meshes_mm: (F, V, 3) rigidly on it. NaN where H is absent.
    """

    take: str
    frames: np.ndarray
    neutral_mm: np.ndarray
    meshes_mm: np.ndarray

    @classmethod
    def of(
        cls,
        take: str,
        frames: np.ndarray,
        accurate_mm: np.ndarray,
        accurate_neutral_mm: np.ndarray,
        correspondence: Correspondence,
    ) -> PosedTake:
        """Of H `accurate_mm` (F, V_H, 3) at `frames` (F,) and `accurate_neutral_mm` (V_H, 3), world.

        Frames that are not finite go.
        """
        neutral = correspondence.on_coarse(np.asarray(accurate_neutral_mm, dtype=np.float64))
        meshes = correspondence.on_coarse(np.asarray(accurate_mm))
        meshes = align_frames(meshes, neutral, correspondence.rigid, trim=0.2, rounds=2).apply(
            meshes
        )
        corners = np.unique(correspondence.coarse_triangles[correspondence.mask])
        whole = np.isfinite(meshes[:, corners]).all(axis=(1, 2))
        return cls(take, np.asarray(frames)[whole], neutral, meshes[whole].astype(np.float32))


def choose_lip_shapes(
    takes: Sequence[PosedTake],
    lips: np.ndarray,
    mask: np.ndarray,
    triangles: np.ndarray,
    count: int,
) -> LipShapes:
    """The `count` most representative lip shapes of some takes (fewer where there are fewer frames).

    Args:
        lips: (V,) bool, the vermilion; mask: (M,) triangles of every person's mask; triangles: (T, 3).
    """
    known = lips & np.isfinite([take.neutral_mm for take in takes]).all(axis=(0, 2))
    moved = [take.meshes_mm[:, known] - take.neutral_mm[known] for take in takes]
    owner = np.repeat(np.arange(len(takes)), [len(part) for part in moved])
    row = np.concatenate([np.arange(len(part)) for part in moved])
    chosen = medoids(np.concatenate(moved).reshape(len(owner), -1), count)
    layers = [
        correction_layers(
            takes[owner[k]].neutral_mm, takes[owner[k]].meshes_mm[[row[k]]], triangles[mask]
        )[0]
        for k in chosen
    ]
    return LipShapes(
        take=np.array([takes[owner[k]].take for k in chosen], dtype=str),
        frame=np.array([takes[owner[k]].frames[row[k]] for k in chosen], dtype=np.int64),
        mask=np.asarray(mask, dtype=np.int32),
        layers=np.array(layers, dtype=np.float32).reshape(len(chosen), len(mask), 9),
    )


def medoids(points: np.ndarray, count: int) -> np.ndarray:
    """Indices, ascending, of `count` of the points (N, D) that stand for all of them.

    Farthest points first, beginning with the one farthest from the origin; then medoids of the
    points nearest to each. The origin is a medoid that stays.
    """
    points = np.concatenate([np.zeros((1, points.shape[1])), points]).astype(np.float64)
    squared = (points**2).sum(axis=1)
    distance = squared[:, None] + squared - 2 * points @ points.T
    distance = np.sqrt(np.maximum(distance, 0.0))
    chosen = [0]
    while len(chosen) < min(count + 1, len(points)):
        chosen.append(int(distance[:, chosen].min(axis=1).argmax()))
    for _ in range(_ROUNDS):
        nearest = distance[:, chosen].argmin(axis=1)
        better = [0]
        for k in range(1, len(chosen)):
            members = np.flatnonzero(nearest == k)
            better.append(int(members[distance[np.ix_(members, members)].sum(axis=1).argmin()]))
        if better == chosen:
            break
        chosen = better
    return np.sort(chosen[1:]) - 1
