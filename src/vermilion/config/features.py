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
        description="`head`: contours are back-projected onto the tracked lips and measured in 3D, which "
        "makes the features invariant to head rotation (Lips16 7). `image`: measured in the image "
        "(Lips16 5.1).",
    )
    samples: int = Field(
        80, ge=20, le=400, description="Samples on each contour (a multiple of 20)."
    )
    reach: float = Field(
        0.12,
        gt=0,
        le=0.5,
        description="Search distance for the outer contour on either side of the model's.",
    )
    depth: float = Field(
        0.3, gt=0, le=1, description="Search distance for the inner contour from the outer one."
    )
    step: float = Field(0.0025, gt=0, le=0.05, description="Step of the search.")
    least_likelihood: float = Field(
        0.2, ge=0, le=1, description="Least likelihood of a maximum that counts as found."
    )
    model_weight: float = Field(
        2.0,
        ge=0,
        description="Cost of a contour at the search distance from the model's (log-likelihood). For the "
        "inner contour it is 9 times as large there, and 1.5 times at a quarter of the distance.",
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
    most_apart: float = Field(
        0.05,
        gt=0,
        le=1,
        description="A frame whose inner contour lies farther than this from both the lips of dense landmarks "
        "(detector `mediapipe`) and the tracked ones (mean) is flagged and left out.",
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
