"""Training of one regressor: which features, which alpha and beta, the fit, the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from vermilion.database.schema import TrainingSet
from vermilion.errors import InputError
from vermilion.regression.cross_validation import (
    Curve,
    Rule,
    clips_of,
    cross_validate_affine,
    cross_validate_rbf,
    target_gram,
)
from vermilion.regression.estimators import AffineRegressor, RBFNetwork
from vermilion.regression.model import LipModel

#: Variant -> (estimator, features).
VARIANTS = {
    "": ("rbf", "all"),
    "affine": ("affine", "all"),
    "shape-only": ("rbf", "shape"),
    "distances-only": ("rbf", "distances"),
}


@dataclass(frozen=True)
class Selection:
    """How the parameters are chosen; the fields are those of the configuration's `training`."""

    prototype_stride: int = 10
    prototype_minimum: int = 20
    scaling: Literal["group", "feature"] = "group"
    alphas: Sequence[float] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    betas: Sequence[float] = (0.01, 0.03, 0.1, 0.3, 1.0)
    affine_alphas: Sequence[float] = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)
    folds: int = 5
    clip_frames: int = 30
    reach: float = 0.0
    fade: float = 2.0
    choice: Rule = "least"
    bias: Literal["person", "shared"] = "person"


def split_name(regressor: str) -> tuple[str, str | None, str]:
    """(kind, subject, variant) of a regressor's name: `MS`, `PS-anna`, `GR-anna-affine`, ...

    Raises InputError on any other name.
    """
    base, variant = regressor, ""
    for name in VARIANTS:
        if name and regressor.endswith(f"-{name}"):
            base, variant = regressor.removesuffix(f"-{name}"), name
    kind, dash, subject = base.partition("-")
    if (kind == "MS" and not dash) or (kind in ("PS", "GR") and subject):
        return kind, subject or None, variant
    raise InputError(
        f"a regressor named {regressor!r}",
        "MS, PS-<subject> or GR-<subject>, with an optional variant "
        + ", ".join(f"-{v}" for v in VARIANTS if v),
        "Correct the name.",
    )


def training_subjects(regressor: str, subjects: Sequence[str]) -> list[str]:
    """Whose frames a regressor trains on (Lips16 section 6): one, all, or all but one subject."""
    kind, subject, _ = split_name(regressor)
    if kind == "MS":
        return sorted(subjects)
    if kind == "PS":
        return [s for s in sorted(subjects) if s == subject]
    return [s for s in sorted(subjects) if s != subject]


def feature_group(name: str) -> str:
    """`shape` or `distances`: to which of the two kinds a feature belongs, by its name."""
    return "shape" if name.startswith("shape") else "distances"


def train(
    name: str,
    data: TrainingSet,
    feature_names: Sequence[str],
    mask: np.ndarray,
    area_mm2: np.ndarray,
    topology: str,
    selection: Selection,
) -> tuple[LipModel, Curve]:
    """Choose alpha and beta by cross-validation over clips, then fit on all of `data`.

    Args:
        name: of the regressor, with its variant.
        data: rows of the database.
        mask, area_mm2: (T,) the layer's triangles and their areas, which weight the errors.
        topology: hash of the coarse topology.
    """
    estimator_kind, wanted = VARIANTS[split_name(name)[2]]
    kinds = np.array([feature_group(feature) for feature in feature_names])
    columns = np.flatnonzero((kinds == wanted) | (wanted == "all"))
    if not len(columns):
        raise InputError(
            f"features {list(feature_names)}",
            f"some of kind {wanted}",
            f"Leave the variant {name} out, or make such features.",
        )
    features = data.features[:, columns].astype(np.float64)
    groups = list(kinds[columns]) if selection.scaling == "group" else None
    weights = np.repeat(area_mm2 / area_mm2.mean(), 9)
    gram = target_gram(data.layers, weights)
    clips = clips_of(data.sequences, selection.clip_frames, selection.folds)
    persons = data.persons if selection.bias == "person" else None
    common = {"n_folds": selection.folds, "feature_groups": groups, "persons": persons}
    beyond = {"reach": selection.reach, "fade": selection.fade}
    common |= beyond
    if estimator_kind == "affine":
        curve = cross_validate_affine(
            features, gram, weights.sum(), clips, alphas=sorted(selection.affine_alphas), **common
        )
        _, chosen = curve.choose(selection.choice)
        estimator = AffineRegressor(float(curve.alphas[chosen]), groups, **beyond)
        estimator.fit(features, data.layers, persons=persons)
    else:
        prototypes = {
            "prototype_stride": selection.prototype_stride,
            "prototype_minimum": selection.prototype_minimum,
        }
        curve = cross_validate_rbf(
            features,
            gram,
            weights.sum(),
            data.sequences,
            clips,
            alphas=sorted(selection.alphas),
            betas=sorted(selection.betas),
            **prototypes,
            **common,
        )
        row, column = curve.choose(selection.choice)
        alpha, beta = float(curve.alphas[column]), float(curve.betas[row])
        estimator = RBFNetwork(
            alpha, beta, **prototypes, feature_groups=groups, reach=selection.reach
        )
        estimator.fit(features, data.layers, data.sequences, persons=persons)
    used = {
        take: data.frames[data.sequences == k]
        for k, take in enumerate(data.takes)
        if (data.sequences == k).any()
    }
    model = LipModel(
        name=name,
        estimator=estimator,
        feature_names=tuple(feature_names),
        feature_columns=columns,
        mask=mask,
        topology=topology,
        training_frames=used,
        neutrals_mm=data.neutrals_mm if persons is not None else {},
    )
    return model, curve


def curve_table(name: str, curve: Curve, choice: Rule = "simplest") -> pd.DataFrame:
    """The cross-validation curve, one row a grid point, for the report."""
    mean, deviation = curve.mean, curve.standard_error
    chosen = curve.choose(choice)
    rows = [
        {
            "regressor": name,
            "alpha": alpha,
            "beta": beta,
            "feature_error": mean[i, j],
            "feature_error_se": deviation[i, j],
            "folds": len(curve.frames),
            "frames": int(curve.frames.sum()),
            "freedom": curve.freedom[i, j],
            "chosen": int((i, j) == chosen),
        }
        for i, beta in enumerate(curve.betas)
        for j, alpha in enumerate(curve.alphas)
    ]
    return pd.DataFrame(rows)
