"""A person's neutral, as the tracker has it and as it is (Lips16 4.2, D of eq. 1).

What a regressor adds to a coarse mesh has two parts: what the tracker gets wrong of an expression,
which people have in common, and what it gets wrong of the person, which is theirs alone: the layer
between the two neutrals. Of people whom a regressor was trained on it knows both. Of anybody else
one frame tells the second: the neutral from a rig.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from vermilion.arrays import read_arrays, write_arrays
from vermilion.correction.layers import correction_layers
from vermilion.errors import InputError
from vermilion.regression.model import DISPLACEMENT_UNIT_MM, LipModel


@dataclass(frozen=True)
class NeutralPair:
    """The neutral frame of a person.

    Attributes:
        subject: their name.
        coarse_mm: (V, 3) **C** of that frame, head frame.
        accurate_mm: (V, 3) **H** of that frame on C's topology, laid on it; NaN where H is absent.
        features: (M,) of that frame; NaN where it has none.
        feature_names: (M,) str.
        neutral_mm: (V, 3) the coarse neutral (`identity.npz`), by which the person is known.
        reason: why the pair is not to be used; empty for a good one.
    """

    subject: str
    coarse_mm: np.ndarray
    accurate_mm: np.ndarray
    features: np.ndarray
    feature_names: np.ndarray
    neutral_mm: np.ndarray
    reason: str = ""

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, **{f.name: np.asarray(getattr(self, f.name)) for f in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> NeutralPair:
        """Read what `save` wrote."""
        arrays = read_arrays(path, "neutral pair", [f.name for f in fields(cls)])
        texts = {name: str(arrays[name]) for name in ("subject", "reason")}
        return cls(**{**arrays, **texts})


def acquainted(model: LipModel, pair: NeutralPair, triangles: np.ndarray) -> LipModel:
    """The model with the person of a pair among those whom it knows.

    Their features are taken from those of the neutral frame, as in the training. Their bias is such
    that the neutral frame is corrected to the accurate neutral; outputs where H is absent keep a
    stranger's. The model itself where it was trained on the person, or where the
    pair is not to be used.

    Args:
        triangles: (T, 3) of the coarse mesh.
    """
    if pair.reason or model.person_of(pair.neutral_mm) is not None:
        return model
    if tuple(pair.feature_names) != tuple(model.feature_names):
        raise InputError(
            f"a neutral with {len(pair.feature_names)} features that are not the regressor's",
            f"the {len(model.feature_names)} features that {model.name} was trained on",
            "Measure the features of both with one configuration.",
            subject=pair.subject,
        )
    model.check_topology(triangles)
    target = _target(model, pair, triangles)
    shift = pair.features - model.neutral_features if len(model.shifts) else 0.0
    seen = (pair.features - shift)[None, model.feature_columns]
    known = target - model.estimator.mixture(seen)[0] @ model.estimator.basis_
    stranger = model.estimator.bias_of(None)
    estimator = copy.copy(model.estimator)
    biases = model.estimator.person_biases_[: len(model.neutrals_mm)]
    bias = np.where(np.isfinite(known), known, stranger).astype(stranger.dtype)
    estimator.person_biases_ = np.concatenate([biases, bias[None]])
    neutrals = {**model.neutrals_mm, pair.subject: pair.neutral_mm}
    shifts = np.concatenate([model.shifts, shift[None]]) if len(model.shifts) else model.shifts
    return replace(model, estimator=estimator, neutrals_mm=neutrals, shifts=shifts)


def _target(model: LipModel, pair: NeutralPair, triangles: np.ndarray) -> np.ndarray:
    """What the regressor should say of the neutral frame (K,); NaN where H is absent."""
    corners = triangles[model.mask]
    present = np.isfinite(pair.accurate_mm[corners]).all(axis=(1, 2))
    layers = np.full((len(corners), 9), np.nan)
    layers[present] = correction_layers(pair.coarse_mm, pair.accurate_mm, corners[present])
    moved = (pair.accurate_mm - pair.coarse_mm)[model.vertices] / DISPLACEMENT_UNIT_MM
    return np.concatenate([layers.reshape(-1), moved.reshape(-1)])
