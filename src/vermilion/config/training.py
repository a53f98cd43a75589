"""Configuration of the regressors and of their selection."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vermilion.config.base import StageConfig

Positive = Annotated[float, Field(gt=0.0)]


class TrainingConfig(StageConfig):
    """Regressors from features to correction layers (Lips16 5.2)."""

    regressor: Literal["rbf", "affine", "kernel"] = Field(
        "kernel",
        description="Estimator of PS, MS and GR. `kernel`: kernel ridge regression on all frames, with "
        "a predictive variance. `rbf`: the paper's network. `affine`: its simple alternative. "
        "The others can be evaluated beside it (`evaluation.variants`).",
    )
    prototype_stride: int = Field(
        10,
        ge=1,
        le=1000,
        description="Stride of the training frames that become prototypes (frames).",
    )
    prototype_minimum: int = Field(
        20,
        ge=1,
        le=10_000,
        description="Fewest prototypes, if there are as many frames: the stride is shortened for short "
        "takes.",
    )
    scaling: Literal["group", "feature"] = Field(
        "group",
        description="Scaling of the features. `group`: one scale for the shape coefficients and one for "
        "the distances. `feature`: every feature has the same variance.",
    )
    alphas: list[Positive] = Field(
        [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0],
        min_length=1,
        description="Ridge parameters of the RBF network that cross-validation tries.",
    )
    betas: list[Positive] = Field(
        [0.01, 0.03, 0.1, 0.3, 1.0],
        min_length=1,
        description="Scales of the Gaussians that cross-validation tries, per squared distance of "
        "features scaled to a total variance of 1.",
    )
    affine_alphas: list[Positive] = Field(
        [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1000.0],
        min_length=1,
        description="Tikhonov parameters of the affine regressor that cross-validation tries.",
    )
    kernel_alphas: list[Positive] = Field(
        [1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0],
        min_length=1,
        description="Noise variances of the kernel regressor that cross-validation tries.",
    )
    kernel_betas: list[Positive] = Field(
        [0.1, 0.3, 1.0, 3.0],
        min_length=1,
        description="Scales of the kernel regressor's Gaussians that cross-validation tries.",
    )
    kernel_linear: float = Field(
        1.0,
        ge=0.0,
        description="Variance of the kernel regressor's linear part, relative to the smooth part.",
    )
    kernel_equalise: float = Field(
        0.5,
        ge=0.0,
        le=1.0,
        description="With `scaling: group`, how far the kernel regressor equalises the variances of the "
        "features of a group: 0 keeps their ratios, 1 makes them equal.",
    )
    folds: int = Field(5, ge=2, le=50, description="Folds of the cross-validation.")
    clip_frames: int = Field(
        30,
        ge=1,
        le=10_000,
        description="Length of the clips that are held out as a whole (frames); shorter if there are too "
        "few frames for the folds.",
    )
    reach: float = Field(
        0.0,
        ge=0.0,
        description="Distance beyond the training's range up to which a feature counts, as a share of the "
        "range. Farther out the feature is clamped and the prediction fades to the training's mean. A "
        "large number gives the paper's regressors, which there fall back to their bias (RBF) or grow "
        "without bound (affine).",
    )
    fade: Positive = Field(
        2.0,
        description="Distance beyond the reach at which half of the prediction is left, in units of the "
        "training's RMS distance from its mean (scaled features).",
    )
    choice: Literal["simplest", "least"] = Field(
        "least",
        description="`least`: the grid point of the least cross-validation error, as in the paper. "
        "`simplest`: the one with the fewest effective degrees of freedom within one standard error "
        "of it.",
    )
    basis_error: float = Field(
        0.03,
        ge=0.0,
        lt=1.0,
        description="Predictions use a basis of few layers: principal components of the predictions. "
        "Largest change of the predictions by the truncation (RMS, as a share of the predictions' RMS "
        "about their mean); 0: no truncation.",
    )
    bias: Literal["person", "shared"] = Field(
        "person",
        description="`person`: each person of the training has a bias of their own. It absorbs the "
        "identity in the layers and is used when the same person is corrected. `shared`: one bias, as "
        "in the paper.",
    )
    anchor: Literal["neutral", "none"] = Field(
        "neutral",
        description="Origin of the features. `neutral`: the features of the person's neutral frame, for "
        "all people whose neutral is known (from the training, or from a rig take of their own). "
        "`none`: zero, as in the paper. With `bias: shared` always `none`.",
    )
    novelty_quantile: float = Field(
        0.99,
        gt=0.0,
        le=1.0,
        description="A corrected frame is reported as outside the training's range if its novelty exceeds "
        "this quantile of the training frames' novelty, measured by cross-validation.",
    )
