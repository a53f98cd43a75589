"""A person's neutral, as the tracker has it and as it is (Lips16 4.2, D of eq. 1).

What a regressor adds to a coarse mesh has two parts: what the tracker gets wrong of an expression,
which people have in common, and what it gets wrong of the person, which is theirs alone: the layer
between the two neutrals. Of people whom a regressor was trained on it knows both. Of anybody else
one frame tells the second: the neutral from a rig. It is not quite the same in every take, as camera
and light change what a tracker sees: a neutral frame of the take that is corrected tells that.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from vermilion.correction.layers import correction_layers
from vermilion.regression.model import DISPLACEMENT_UNIT_MM, LipModel
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class NeutralPair:
    """A neutral frame of a person.

    Attributes:
        subject: their name.
        take: of the frame.
        coarse_mm: (V, 3) **C** of that frame, head frame.
        accurate_mm: (V, 3) **H** of that frame on C's topology, laid on it; NaN where H is absent.
        features: (M,) of that frame; NaN where it has none.
        feature_names: (M,) str.
        neutral_mm: (V, 3) the coarse neutral (`identity.npz`), by which the person is known.
        reason: why the pair is not to be used; empty for a good one.
    """

    subject: str
    take: str
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
        texts = {name: str(arrays[name]) for name in ("subject", "take", "reason")}
        return cls(**{**arrays, **texts})


def with_known_neutrals(
    model: LipModel,
    triangles: np.ndarray,
    of_person: NeutralPair | None,
    of_take: NeutralPair | None = None,
) -> LipModel:
    """The model, told how the track errs on a person, and in the take that is to be corrected.

    Features are taken from those of the neutral frame, as in the training: of the take's, else the
    person's, as each camera and light has errors of its own. The person's bias is the mean of what is
    known of it: that of the training, or for somebody else the one that corrects the neutral of their
    rig to the accurate one; and the one that does so with the take's. Each errs by half a
    millimetre and more in its own way, so that two are better than either. Outputs where H is absent
    keep the bias that they have. The model itself where nothing is told that it did not know.

    Args:
        triangles: (T, 3) of the coarse mesh.
        of_person: the neutral of their rig take; of no use where the model was trained on the person.
        of_take: that of the take to be corrected.
    """
    given = [pair for pair in (of_person, of_take) if pair is not None and not pair.reason]
    person = model.person_of(given[0].neutral_mm) if given else None
    told = [pair for pair in given if person is None or pair is of_take]
    if not told:
        return model
    for pair in told:
        _check(model, pair)
    model.check_topology(triangles)
    own = told[-1]
    shift = own.features - model.neutral_features if len(model.shifts) else 0.0
    estimator, before = copy.copy(model.estimator), model.estimator.bias_of(person)
    known = [] if person is None else [before]
    for pair in told:
        seen = (pair.features - shift)[None, model.feature_columns]
        expression = estimator.mixture(seen)[0] @ estimator.basis_
        known.append(_target(model, pair, triangles) - expression)
    mean = np.mean(known, axis=0)
    bias = np.where(np.isfinite(mean), mean, before).astype(before.dtype)
    names = list(model.neutrals_mm)
    others = [k for k in range(len(names)) if k != person]
    estimator.person_biases_ = np.concatenate([estimator.person_biases_[others], bias[None]])
    shifts = model.shifts
    if len(shifts):
        shifts = np.concatenate([shifts[others], shift[None]])
    neutrals = {names[k]: model.neutrals_mm[names[k]] for k in others}
    neutrals[own.subject] = own.neutral_mm
    return replace(model, estimator=estimator, neutrals_mm=neutrals, shifts=shifts)


def load_pairs(*paths: str | Path | None) -> list[NeutralPair | None]:
    """What `with_known_neutrals` is told: the pair of each file; None for no file."""
    return [NeutralPair.load(path) if path else None for path in paths]


def _check(model: LipModel, pair: NeutralPair) -> None:
    """Raise InputError where a pair's features are not those of the model."""
    if tuple(pair.feature_names) != tuple(model.feature_names):
        raise InputError(
            f"a neutral with {len(pair.feature_names)} features that are not the regressor's",
            f"the {len(model.feature_names)} features that {model.name} was trained on",
            "Measure the features of both with one configuration.",
            subject=pair.subject,
            take=pair.take,
        )


def _target(model: LipModel, pair: NeutralPair, triangles: np.ndarray) -> np.ndarray:
    """What the regressor should say of the neutral frame (K,); NaN where H is absent."""
    corners = triangles[model.mask]
    present = np.isfinite(pair.accurate_mm[corners]).all(axis=(1, 2))
    layers = np.full((len(corners), 9), np.nan)
    layers[present] = correction_layers(pair.coarse_mm, pair.accurate_mm, corners[present])
    moved = (pair.accurate_mm - pair.coarse_mm)[model.vertices] / DISPLACEMENT_UNIT_MM
    return np.concatenate([layers.reshape(-1), moved.reshape(-1)])
