"""A subject's neutral, as the tracker has it and as it is (Lips16 4.2, D of eq. 1).

What a regressor adds to a coarse mesh has two parts: the tracker's error in an expression, which people
share, and its error in the identity, which each subject has alone: the layer between the two neutrals.
For subjects of its training a regressor knows both. For an unseen subject, one neutral frame of a rig
take supplies the identity. Camera and light change the tracker's error, so a neutral frame of the take
that is corrected adds what is particular to that take.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

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
        write_arrays(path, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> NeutralPair:
        """Read what `save` wrote."""
        arrays: dict[str, Any] = read_arrays(path, "neutral pair", [f.name for f in fields(cls)])
        return cls(**arrays | {name: str(arrays[name]) for name in ("subject", "take", "reason")})


def with_known_neutrals(
    model: LipModel,
    triangles: np.ndarray,
    of_person: NeutralPair | None,
    of_take: NeutralPair | None = None,
) -> LipModel:
    """The model with the identity bias of a subject, and of the take that is to be corrected.

    Features are measured from those of the neutral frame, as in the training: that of the take, else that
    of the rig take, as each camera and light has errors of its own. The bias is the mean of all that is
    known of it: that of the training or, for an unseen subject, the one that corrects the neutral of their
    rig take; and the one that corrects that of the take. Each is wrong by half a millimetre and more in
    its own way, so the mean is better than either. Outputs where H is absent keep their bias.

    Args:
        triangles: (T, 3) of the coarse mesh.
        of_person: the neutral of their rig take; not used where the model was trained on the subject.
        of_take: that of the take to be corrected.

    Returns:
        the model itself where neither tells anything new.

    Raises:
        InputError: a pair's features are not those of the model.
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
    shift = np.zeros_like(own.features)
    if len(model.shifts):
        shift = own.features - model.neutral_features
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
