"""Configuration of the correspondence between the coarse and the accurate mesh."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig


class CorrespondenceConfig(StageConfig):
    """Laplacian registration of the two neutrals, once a subject (Lips16 4.1)."""

    landmarks: Literal["image", "model"] = Field(
        "image",
        description="First correspondences of the two neutrals. `image`: the landmarks of the frontal "
        "image, projected onto both meshes along their rays (as in the paper). `model`: the landmark "
        "vertices of the template and of the tracker's model.",
    )
    landmark_weight: float = Field(
        0.3, gt=0.0, le=100.0, description="Weight of a landmark beside bending (1/mm^2)."
    )
    wavelengths_mm: list[float] = Field(
        [100.0, 60.0, 40.0, 25.0, 15.0, 15.0],
        min_length=1,
        description="Dense steps: each smooths away differences of the two surfaces of a shorter "
        "wavelength (mm).",
    )
    search_distance_mm: float = Field(
        25.0,
        gt=0.0,
        le=100.0,
        description="Largest distance of a closest point that is used (mm).",
    )
    max_distance_mm: float = Field(
        4.0,
        gt=0.0,
        le=50.0,
        description="A vertex farther than this from the accurate mesh, once registered, has no "
        "counterpart (mm).",
    )
    max_angle_deg: float = Field(
        70.0,
        gt=0.0,
        lt=90.0,
        description="Largest angle between the normals of a vertex and of its counterpart "
        "(degrees).",
    )
    mask_radius_mm: float = Field(
        95.0,
        gt=10.0,
        le=150.0,
        description="Reach of the correction layer from the middle of the mouth (mm). The face "
        "outside stays where the tracker put it, which bounds what a correction can gain.",
    )
    eye_gap_mm: float = Field(
        10.0,
        ge=0.0,
        le=60.0,
        description="Smallest distance of the correction layer from the eyelids' landmarks (mm): lip "
        "features do not predict blinks.",
    )
