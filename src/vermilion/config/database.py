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
        description="Deflate level of the layers (0 to 9); 0 stores them as they are.",
    )
    min_common_mask: float = Field(
        0.5,
        gt=0.0,
        le=1.0,
        description="The layers cover the triangles that all subjects have; the smallest share of "
        "any subject's mask that must be left (0 to 1).",
    )
