"""Configuration of the track's fit to the images, and of its offsets (Lips16 3.2)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from vermilion.config.base import StageConfig, section

Counts = Annotated[list[Annotated[int, Field(ge=0, le=50)]], Field(min_length=1, max_length=6)]


class AppearanceConfig(StageConfig):
    """Lighting and albedo of a take, from a few frames that are chosen by themselves."""

    frames: int = Field(20, ge=1, le=200, description="Frames that are chosen (count).")
    rounds: int = Field(
        5, ge=0, le=20, description="Turns of appearance and of the chosen frames' pose (count)."
    )
    spacing_mm: float = Field(
        2.2, ge=0.5, le=20, description="Between places where model and image are compared (mm)."
    )
    pixel_mm: float = Field(
        0.5,
        ge=0.1,
        le=20,
        description="Pixel of the finest image that is compared (mm at the face).",
    )
    albedo_prior: float = Field(
        0.5,
        ge=0,
        le=100,
        description="How many frames' worth the skin's one colour counts at each place.",
    )


class FrameFitConfig(StageConfig):
    """Pose and expression from the images: how much they count beside the landmarks."""

    sigma: float = Field(
        6.0, gt=0, le=255, description="Deviation of a colour (display values, 0 to 255)."
    )
    robust_sigmas: float = Field(
        2.0, gt=0.1, le=100, description="A place this far off counts half (deviations)."
    )
    strength: float = Field(
        4000.0, ge=0, le=1e6, description="How many independent places the whole face is worth."
    )
    rotation_deg: float = Field(
        3.0, gt=0, le=180, description="Typical turn from the landmark fit (degrees)."
    )
    translation_mm: float = Field(
        5.0, gt=0, le=1e4, description="Typical sideways move from the landmark fit (mm)."
    )
    depth_mm: float = Field(
        10.0, gt=0, le=1e4, description="Typical move in depth from the landmark fit (mm)."
    )
    weight: float = Field(
        0.2, gt=0, le=10, description="Typical change of a blend weight from the landmark fit."
    )
    iterations: Counts = Field(
        [3, 3, 4], description="Gauss-Newton steps at each resolution, coarsest first (counts)."
    )
    shading: bool = Field(
        False, description="Whether shading tells of normals, beside the motion of the texture."
    )


class SmoothingConfig(StageConfig):
    """The fitted frames of a take as one track."""

    weight_acceleration: float = Field(
        15.0,
        gt=0,
        le=1e9,
        description="Typical acceleration of a blend weight (per second squared); smaller is "
        "smoother.",
    )
    translation_acceleration_mm: float = Field(
        200.0,
        gt=0,
        le=1e9,
        description="Typical acceleration of a head (mm per second squared); smaller is smoother, of its "
        "depth above all, which images tell least of.",
    )


class OffsetsConfig(StageConfig):
    """Offsets of the vertices outside the model's space, parallel to the image (Lips16 3.2)."""

    enabled: bool = Field(False, description="Add the offsets to the meshes.")
    sigma_mm: float = Field(2.0, gt=0, le=100, description="Deviation of an offset (mm).")
    length_mm: float = Field(
        20.0, gt=0, le=1e3, description="Length over which offsets are alike (mm)."
    )
    sigma: float = Field(
        6.0, gt=0, le=255, description="Deviation of a colour (display values, 0 to 255)."
    )
    robust_sigmas: float = Field(
        2.0, gt=0.1, le=100, description="A place this far off counts half (deviations)."
    )
    strength: float = Field(
        1000.0, ge=0, le=1e6, description="How many independent places the whole face is worth."
    )
    iterations: Counts = Field(
        [0, 1, 2], description="Gauss-Newton steps at each resolution, coarsest first (counts)."
    )


class ImageFitConfig(StageConfig):
    """Pose and expression from the images: analysis by synthesis (Lips16 3.2)."""

    enabled: bool = Field(
        True,
        description="Fit pose and expression to the images; off: the landmark fit is the track.",
    )
    appearance: AppearanceConfig = section(AppearanceConfig, "Lighting and albedo.")
    frame_fit: FrameFitConfig = section(FrameFitConfig, "Pose and expression of one frame.")
    join: SmoothingConfig = section(SmoothingConfig, "The frames as one track.")
    overlay_frames: int = Field(
        4, ge=1, le=100, description="Frames of a chunk in its overlay image (count)."
    )
