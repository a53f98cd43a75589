"""What other actors' lips tell of a new one: the prior of `prior_refinement`.

Of a database of frames with a base mesh and an accurate one: displacements d (3N) of the mouth region
in the head frame, and descriptors z of each base frame (its mouth's deformation, or the features of a
regressor). The model of a new actor's frame f:

    d_f = sum_m c_fm b_m,      c_f = A0 [1, z_f] + e_f,      E[e_fm e_gm] = s_m^2 k(f, g),
    k(f, g) = share_offset + share_function z_f . z_g / q + share_frame [f = g] .

The modes b are the database's principal components; A0 is what base frames tell of every actor, e how
an actor differs: by a constant, by a function of the base frame, and frame by frame. The three shares
are measured between the database's actors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError

#: Ridge of the maps from descriptors to modes, per frame.
_RIDGE_ALL, _RIDGE_ACTOR = 0.02, 0.05
_LEAST_SHARE = 0.02
_ARRAYS = (
    "vertices", "modes_mm", "deviations", "descriptor_mean", "descriptor_scale", "mean_map", "shares",
)  # fmt: skip


@dataclass(frozen=True)
class LipPrior:
    """The fitted prior.

    Attributes:
        vertices: (N,) ids that it moves.
        modes_mm: (r, 3N) displacements in the head frame, one deviation of the database each.
        deviations: (r,) s_m of an actor about the mean map.
        descriptor_mean: (D,).
        descriptor_scale: (q, D) directions that make descriptors white.
        mean_map: (1 + q, r), A0 transposed.
        shares: (3,) of offset, function and frame; their sum is one.
    """

    vertices: np.ndarray
    modes_mm: np.ndarray
    deviations: np.ndarray
    descriptor_mean: np.ndarray
    descriptor_scale: np.ndarray
    mean_map: np.ndarray
    shares: np.ndarray

    @classmethod
    def of(
        cls,
        vertices: np.ndarray,
        displacements_mm: Sequence[np.ndarray],
        descriptors: Sequence[np.ndarray],
        n_modes: int = 30,
        n_descriptors: int = 20,
    ) -> Self:
        """Learn from the frames of several actors, an array an actor.

        Args:
            vertices: (N,) ids.
            displacements_mm: (F_a, N, 3) accurate less base, head frame.
            descriptors: (F_a, D) of the base frames.
            n_modes, n_descriptors: at most so many components are kept.

        Raises:
            InputError: fewer than two actors, or frames that do not belong together.
        """
        _check(displacements_mm, descriptors)
        moved = np.concatenate([d.reshape(len(d), -1) for d in displacements_mm])
        told = np.concatenate(list(descriptors)).astype(np.float64)
        middle = told.mean(axis=0)
        scale = _components(told - middle, n_descriptors, whiten=True)
        modes = _components(moved, n_modes)
        # The components are orthogonal: each coefficient by itself.
        coefficients = moved @ (modes / (modes**2).sum(axis=1, keepdims=True)).T
        z = (told - middle) @ scale.T
        mean_map = _ridge(_with_one(z), coefficients, _RIDGE_ALL)
        left = coefficients - _with_one(z) @ mean_map
        actor = np.repeat(np.arange(len(descriptors)), [len(d) for d in descriptors])
        deviations = np.sqrt((left**2).mean(axis=0))
        shares = _shares(left, z, actor, (modes**2).sum(axis=1))
        return cls(np.asarray(vertices), modes, deviations, middle, scale, mean_map, shares)

    def descriptors(self, raw: np.ndarray) -> np.ndarray:
        """White descriptors (F, q) of raw ones (F, D)."""
        return (raw - self.descriptor_mean) @ self.descriptor_scale.T

    def mean(self, white: np.ndarray) -> np.ndarray:
        """Coefficients (F, r) that base frames tell of every actor, by white descriptors (F, q)."""
        return _with_one(white) @ self.mean_map

    def kernel(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """(F, G) k(f, g) of different frames, by white descriptors `a` (F, q) and `b` (G, q)."""
        offset, function, _ = self.shares
        return offset + function * (a @ b.T) / a.shape[1]

    def displacements(self, coefficients: np.ndarray) -> np.ndarray:
        """(F, N, 3) mm, head frame, of coefficients (F, r)."""
        return (coefficients @ self.modes_mm).reshape(len(coefficients), -1, 3)

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, **{name: getattr(self, name) for name in _ARRAYS})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote."""
        arrays = read_arrays(path, "lip prior", _ARRAYS)
        return cls(*(arrays[name] for name in _ARRAYS))


def _components(rows: np.ndarray, most: int, whiten: bool = False) -> np.ndarray:
    """Principal directions (c, D) of rows (N, D): of one deviation each, or such that rows become white."""
    _, values, directions = np.linalg.svd(rows, full_matrices=False)
    count = min(most, int((values > 1e-6 * max(values[0], 1e-300)).sum()))
    deviation = values[:count, None] / np.sqrt(len(rows))
    return directions[:count] / deviation if whiten else directions[:count] * deviation


def _with_one(z: np.ndarray) -> np.ndarray:
    return np.concatenate([np.ones((len(z), 1)), z], axis=1)


def _ridge(inputs: np.ndarray, outputs: np.ndarray, strength: float) -> np.ndarray:
    system = inputs.T @ inputs + strength * len(inputs) * np.eye(inputs.shape[1])
    return np.linalg.solve(system, inputs.T @ outputs)


def _shares(left: np.ndarray, z: np.ndarray, actor: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Shares (3,) of what the mean map leaves (N, r): an actor's offset, function of z (N, q), frame."""
    total = ((left**2).mean(axis=0) * weight).sum()
    parts, actors = np.zeros(2), np.unique(actor)
    for one in actors:
        own, at = left[actor == one], z[actor == one]
        offset = own.mean(axis=0)
        at = at - at.mean(axis=0)
        follows = at @ _ridge(at, own - offset, _RIDGE_ACTOR)
        parts += [(offset**2 * weight).sum(), ((follows**2).mean(axis=0) * weight).sum()]
    parts /= len(actors) * max(total, 1e-300)
    frame = max(1.0 - parts.sum(), _LEAST_SHARE)
    shares = np.array([*parts, frame])
    return shares / shares.sum()


def _check(displacements: Sequence[np.ndarray], descriptors: Sequence[np.ndarray]) -> None:
    if len(displacements) < 2 or len(displacements) != len(descriptors):
        raise InputError(
            f"frames of {len(displacements)} actors and descriptors of {len(descriptors)}",
            "two actors or more, with descriptors of each",
            "Add a subject to the database, or work without the prior.",
        )
    for number, (moved, told) in enumerate(zip(displacements, descriptors, strict=True)):
        if len(moved) != len(told) or len(moved) == 0:
            raise InputError(
                f"{len(moved)} frames and {len(told)} descriptors of actor {number}",
                "one descriptor a frame",
                "Give the same frames in both.",
            )
        if not (np.isfinite(moved).all() and np.isfinite(told).all()):
            raise InputError(
                f"values of actor {number} that are not finite", "finite frames", "Leave them out."
            )
