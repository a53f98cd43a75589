"""Configuration of the features (Lips16 5.1)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from vermilion.config.base import StageConfig, section


class ShapeFeaturesConfig(StageConfig):
    """Shape coefficients of the coarse mesh."""

    variance: float = Field(
        0.99,
        gt=0,
        le=1,
        description="Share of the variance of the tracker's blend shapes that is kept (Lips16: 0.99).",
    )


class ContourFeaturesConfig(StageConfig):
    """Relative contour distances, and the search for the contours from the coarse mesh.

    Lengths are per inter-ocular distance.
    """

    space: Literal["head", "image"] = Field(
        "head",
        description="`head`: contours are put back on the tracked lips and measured in 3D, so that a "
        "turn of the head is undone (Lips16 7). `image`: measured in the image (Lips16 5.1).",
    )
    samples: int = Field(
        80, ge=20, le=400, description="Samples on each contour (a multiple of 20)."
    )
    reach: float = Field(
        0.12,
        gt=0,
        le=0.5,
        description="Reach of the search for the outer contour to either side of the model's.",
    )
    depth: float = Field(
        0.3, gt=0, le=1, description="Reach of the search for the inner contour from the outer one."
    )
    step: float = Field(0.0025, gt=0, le=0.05, description="Between places that are looked at.")
    least_likelihood: float = Field(
        0.2, ge=0, le=1, description="Likelihood of a maximum that counts as found."
    )
    model_weight: float = Field(
        2.0,
        ge=0,
        description="Cost of a contour one reach away from the model's (log-likelihood). Of the inner one it "
        "is 9 times as much there, and half as much again at a quarter of a reach.",
    )
    smooth_weight: float = Field(
        0.6, ge=0, description="Cost of a slope of 1 between neighbouring samples (log-likelihood)."
    )
    least_found: float = Field(
        0.6,
        ge=0,
        le=1,
        description="A frame with a smaller share of its outer contour found is flagged.",
    )
    overlay_frames: int = Field(
        15, ge=1, le=200, description="Frames at most in a chunk's overlay image."
    )

    @field_validator("samples")
    @classmethod
    def _tenths(cls, value: int) -> int:
        if value % 20:
            raise ValueError("must be a multiple of 20")
        return value


class FeaturesConfig(StageConfig):
    """The regressor's input."""

    shape: ShapeFeaturesConfig = section(
        ShapeFeaturesConfig, "Shape coefficients of the coarse mesh."
    )
    contours: ContourFeaturesConfig = section(ContourFeaturesConfig, "Relative contour distances.")
