"""Configuration of the training database."""

from __future__ import annotations

from pydantic import Field

from vermilion.config.base import StageConfig


class DatabaseConfig(StageConfig):
    """One HDF5 of all subjects (Lips16 3)."""

    compression: int = Field(
        1,
        ge=0,
        le=9,
        description="Deflate level of the layers (0 to 9); 0: not compressed.",
    )
    generic_most_motion_mm: float = Field(
        6.0,
        gt=0.0,
        le=1000.0,
        description="Database of a generic regressor: a frame trains nothing where the track misses the motion of the "
        "lips by more (mm, mean over the vermilion, about the take's median). There it has lost the mouth.",
    )
    min_common_mask: float = Field(
        0.5,
        gt=0.0,
        le=1.0,
        description="Smallest share of any subject's mask that must be common to all subjects (0 to 1): "
        "the layers cover the common triangles.",
    )
