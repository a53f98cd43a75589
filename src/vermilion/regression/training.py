"""Training of one regressor: which features, which alpha and beta, the fit, the model."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vermilion.config.regressors import GENERIC, VARIANTS, Estimator, split_name
from vermilion.regression.cross_validation import (
    Curve,
    Rule,
    clips_of_rows,
    cross_validate,
    held_out_novelty,
    target_gram,
)
from vermilion.regression.estimators import AffineRegressor, RBFNetwork
from vermilion.regression.kernel import KernelRegressor
from vermilion.regression.linear import LinearOutputs
from vermilion.regression.model import DISPLACEMENT_UNIT_MM, LipModel
from vermilion.regression.ridge import person_averages
from vermilion.regression.training_set import TrainingSet
from vermilion.storage.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

#: Fewer people tell nothing of unseen subjects: folds of GR are then clips, as those of PS and MS.
LEAST_PEOPLE = 3


@dataclass(frozen=True)
class Selection:
    """How the parameters are chosen; the fields are those of the configuration's `training`."""

    regressor: Estimator = "kernel"
    prototype_stride: int = 10
    prototype_minimum: int = 20
    scaling: Literal["group", "feature"] = "group"
    alphas: Sequence[float] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    betas: Sequence[float] = (0.01, 0.03, 0.1, 0.3, 1.0)
    affine_alphas: Sequence[float] = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1000.0)
    kernel_alphas: Sequence[float] = (
        *(1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0),
        *(3.0, 10.0, 30.0, 100.0, 300.0),
    )
    kernel_betas: Sequence[float] = (0.1, 0.3, 1.0, 3.0)
    kernel_linear: float = 1.0
    kernel_equalise: float = 0.5
    folds: int = 5
    clip_frames: int = 30
    reach: float = 0.0
    fade: float = 2.0
    choice: Rule = "least"
    basis_error: float = 0.03
    bias: Literal["person", "shared"] = "person"
    anchor: Literal["neutral", "none"] = "neutral"
    novelty_quantile: float = 0.99

    def estimator(self, kind: Estimator, groups: Sequence[str] | None) -> LinearOutputs:
        """An estimator that lacks only alpha and beta."""
        shared: dict[str, Any] = {
            "feature_groups": groups,
            "reach": self.reach,
            "fade": self.fade,
            "basis_error": self.basis_error,
        }
        if kind == "affine":
            return AffineRegressor(**shared)
        if kind == "kernel":
            return KernelRegressor(
                linear=self.kernel_linear, equalise=self.kernel_equalise, **shared
            )
        return RBFNetwork(
            prototype_stride=self.prototype_stride,
            prototype_minimum=self.prototype_minimum,
            **shared,
        )

    def as_in_the_paper(self) -> Selection:
        """Lips16 5.2 to the letter: one bias, features as they are, no limit, the least error."""
        return replace(self, bias="shared", anchor="none", reach=1e9, choice="least")

    def grid(self, kind: Estimator) -> tuple[list[float], list[float] | None]:
        """Alphas and betas to try, ascending; no betas for an estimator without."""
        if kind == "affine":
            return sorted(self.affine_alphas), None
        if kind == "kernel":
            return sorted(self.kernel_alphas), sorted(self.kernel_betas)
        return sorted(self.alphas), sorted(self.betas)


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
    vertices: np.ndarray,
    selection: Selection,
) -> tuple[LipModel, Curve]:
    """Choose alpha and beta by cross-validation of the layers, then fit on all of `data`.

    Folds hold out whole clips; those of GR hold out whole people.

    Args:
        name: of the regressor, with its variant.
        data: rows of the database.
        feature_names: of all M features.
        mask, area_mm2: (T,) the layer's triangles and their areas, which weight the errors.
        topology: hash of the coarse topology.
        vertices: (N,) corners of the mask, whose displacements are regressed with the layers (but for
            the variant `paper`, which is the paper's in all).
        selection: how the parameters are chosen.

    Raises:
        InputError: no feature is of the kind that the variant reads.
    """
    group, _, variant = split_name(name)
    kind, wanted = VARIANTS[variant]
    kind = kind or selection.regressor
    if variant == "paper":
        selection, vertices = selection.as_in_the_paper(), vertices[:0]
    columns, kinds = _columns(name, feature_names, wanted)
    shifts, neutral_features = _shifts(data, selection)
    features = data.features.astype(np.float64)
    features = (features - shifts[data.persons] if len(shifts) else features)[:, columns]
    persons = data.persons if selection.bias == "person" else None
    clips = clips_of_rows(data.sequences, selection.clip_frames, selection.folds)
    # These are for unseen subjects, so their folds hold out whole people.
    by_person = group in ("GR", GENERIC) and len(np.unique(data.persons)) >= LEAST_PEOPLE
    estimator = selection.estimator(kind, kinds if selection.scaling == "group" else None)
    # None of them where the model has no vertices.
    places = data.displacements_mm[:, : 3 * len(vertices)] / np.float32(DISPLACEMENT_UNIT_MM)
    judged, gram = _judged(group, data, features, places, area_mm2)
    alphas, betas = selection.grid(kind)
    curve = cross_validate(
        estimator, judged, gram, data.sequences,
        data.persons if by_person else clips, alphas=alphas, betas=betas, n_folds=selection.folds,
        persons=persons,
    )  # fmt: skip
    estimator.set_params(**curve.parameters(selection.choice))
    targets = np.concatenate([data.layers, places], axis=1)
    estimator.fit(features, targets, data.sequences, persons, n_layers=data.layers.shape[1])
    novelty = held_out_novelty(estimator, features, data.sequences, clips, selection.folds)
    model = LipModel(
        name, estimator, tuple(feature_names), columns, mask, topology, data.frames_of_takes(),
        vertices, data.neutrals_mm if persons is not None else {}, shifts, neutral_features,
        novelty_limit=float(np.quantile(novelty, selection.novelty_quantile)),
    )  # fmt: skip
    return motion_only(model, features[data.first_rows]) if group == GENERIC else model, curve


def _judged(
    group: str, data: TrainingSet, features: np.ndarray, places: np.ndarray, area_mm2: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Features (F, M') and Gram matrix (F, F) of what cross-validation judges by: layers, or motion.

    Args:
        group: kind of the regressor: the generic one is judged by the motion of the mask's corners alone.
        data: the rows.
        features: (F, M') of them.
        places: (F, N * 3) displacements.
        area_mm2: (T,) of the layers' triangles.
    """
    if group != GENERIC:
        return features, target_gram(data.layers, np.repeat(area_mm2 / area_mm2.mean(), 9))
    moving, moved = (about_own_mean(values, data.persons) for values in (features, places))
    return moving, target_gram(moved)


def about_own_mean(values: np.ndarray, persons: np.ndarray) -> np.ndarray:
    """`values` (F, K) less the mean over the frames of each of `persons` (F,): what is motion."""
    return values - (person_averages(persons) @ values)[persons]


def motion_only(model: LipModel, neutral_features: np.ndarray) -> LipModel:
    """The model without anything that is a person's own: it corrects the motion and leaves the neutral.

    The neutral's correction is zero, so that the identity that the tracker found stays as it is.

    Args:
        model: fitted with a bias for each person.
        neutral_features: (G, M') of the neutral frame of each.
    """
    estimator = copy.copy(model.estimator)
    neutral = estimator.activations(neutral_features).mean(axis=0) @ estimator.coefficients_
    estimator.bias_ = -(neutral @ estimator.basis_).astype(estimator.basis_.dtype)
    estimator.person_biases_ = np.zeros((0, len(estimator.bias_)), estimator.basis_.dtype)
    none = np.zeros((0, 0))
    return replace(
        model, estimator=estimator, neutrals_mm={}, shifts=none, neutral_features=np.zeros(0)
    )


def _columns(name: str, feature_names: Sequence[str], wanted: str) -> tuple[np.ndarray, list[str]]:
    """Columns (M',) of the features that are wanted, and the kind of each."""
    kinds = np.array([feature_group(feature) for feature in feature_names])
    columns = np.flatnonzero((kinds == wanted) | (wanted == "all"))
    if not len(columns):
        raise InputError(
            f"features {list(feature_names)}",
            f"some of kind {wanted}",
            f"Leave the variant {name} out, or make such features.",
        )
    return columns, list(kinds[columns])


def _shifts(data: TrainingSet, selection: Selection) -> tuple[np.ndarray, np.ndarray]:
    """What to take off each person's features (G, M), and the features (M,) of all neutrals then.

    Trackers and contours err in a way of their own on every face, lips are thick or thin: what a
    neutral shows of that, every frame of the person has (as C_f is taken back to C_0 in Lips16 eq. 1).
    Nobody's are shifted whose neutral has no features.
    """
    known = data.neutral_features
    if selection.anchor == "none" or selection.bias == "shared" or not known:
        return np.zeros((0, 0)), np.zeros(0)
    mean = np.array(list(known.values())).mean(axis=0, dtype=np.float64)
    return np.array([known.get(subject, mean) - mean for subject in data.subjects]), mean


def curve_table(name: str, curve: Curve, choice: Rule = "simplest") -> pd.DataFrame:
    """The cross-validation curve, one row a grid point, for the report."""
    import pandas as pd

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
