"""Configuration of the image fit and of the vertex offsets (Lips16 3.2)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from vermilion.config.base import StageConfig, section

Counts = Annotated[list[Annotated[int, Field(ge=0, le=50)]], Field(min_length=1, max_length=6)]


class ColourTermConfig(StageConfig):
    """Errors of colours that compare model and image."""

    sigma: float = Field(
        6.0, gt=0, le=255, description="Deviation of a colour (display values, 0 to 255)."
    )
    robust_sigmas: float = Field(
        2.0,
        gt=0.1,
        le=100,
        description="A sample with an error of this many deviations counts half (deviations).",
    )


def acceleration(default: float, of: str, unit: str) -> float:
    """A typical acceleration, of the prior over time."""
    text = f"Typical acceleration of {of} ({unit} per second squared); smaller is smoother."
    return Field(default, gt=0, le=1e9, description=text)


class AppearanceConfig(StageConfig):
    """Lighting and albedo of a take, from a few automatically chosen frames."""

    frames: int = Field(20, ge=1, le=200, description="Frames that are chosen (count).")
    rounds: int = Field(
        5,
        ge=0,
        le=20,
        description="Alternations of appearance and of the chosen frames' pose and expression (count).",
    )
    spacing_mm: float = Field(
        2.2,
        ge=0.5,
        le=20,
        description="Distance between samples at which model and image are compared (mm).",
    )
    pixel_mm: float = Field(
        0.5,
        ge=0.1,
        le=20,
        description="Pixel size of the finest image that is compared (mm at the face).",
    )
    albedo_prior: float = Field(
        0.5,
        ge=0,
        le=100,
        description="Weight of the skin's median colour at each sample, in frames.",
    )


class FrameFitConfig(ColourTermConfig):
    """Pose and expression of a frame: weight of the image beside the landmarks."""

    strength: float = Field(
        4000.0,
        ge=0,
        le=1e6,
        description="Weight of the whole face's image, in independent samples.",
    )
    rotation_deg: float = Field(
        3.0, gt=0, le=180, description="Typical rotation from the landmark fit (degrees)."
    )
    translation_mm: float = Field(
        5.0,
        gt=0,
        le=1e4,
        description="Typical motion parallel to the image from the landmark fit (mm).",
    )
    depth_mm: float = Field(
        10.0, gt=0, le=1e4, description="Typical motion in depth from the landmark fit (mm)."
    )
    weight: float = Field(
        0.2, gt=0, le=10, description="Typical change of a blend weight from the landmark fit."
    )
    iterations: Counts = Field(
        [3, 3, 4], description="Gauss-Newton steps at each resolution, coarsest first (counts)."
    )
    shading: bool = Field(
        False,
        description="Use the change of shading with the normals, besides the motion of the texture.",
    )


class DenseLipsConfig(StageConfig):
    """The mouth in the image fit, where dense landmarks tell the person's lips (`identity.own_lips`)."""

    opening_mm: float = Field(
        1.5,
        ge=0,
        le=20,
        description="Samples so near to the inner edge of the lips are not compared with the image: teeth, "
        "tongue and shade would be taken for lips (mm).",
    )
    noise_share: float = Field(
        0.25,
        gt=0,
        le=10,
        description="Deviation of the mouth's landmarks, as a share of that in the landmark fit.",
    )


class SmoothingConfig(StageConfig):
    """Smoothing of the fitted frames of a take over time."""

    weight_acceleration: float = acceleration(15.0, "a blend weight", "1")
    translation_acceleration_mm: float = acceleration(200.0, "a head, mostly in depth", "mm")


class OffsetsConfig(ColourTermConfig):
    """Offsets of the vertices outside the model's space, parallel to the image (Lips16 3.2)."""

    enabled: bool = Field(False, description="Add the offsets to the meshes.")
    sigma_mm: float = Field(2.0, gt=0, le=100, description="Deviation of an offset (mm).")
    length_mm: float = Field(
        20.0, gt=0, le=1e3, description="Correlation length of the offsets (mm)."
    )
    strength: float = Field(
        1000.0,
        ge=0,
        le=1e6,
        description="Weight of the whole face's image, in independent samples.",
    )
    iterations: Counts = Field(
        [0, 1, 2], description="Gauss-Newton steps at each resolution, coarsest first (counts)."
    )


class ImageFitConfig(StageConfig):
    """Pose and expression from the images, by analysis by synthesis (Lips16 3.2)."""

    enabled: bool = Field(
        True,
        description="Fit pose and expression to the images; off: the landmark fit is the track.",
    )
    appearance: AppearanceConfig = section(AppearanceConfig, "Lighting and albedo.")
    frame_fit: FrameFitConfig = section(FrameFitConfig, "Pose and expression of one frame.")
    lips: DenseLipsConfig = section(DenseLipsConfig, "The mouth, with dense landmarks.")
    join: SmoothingConfig = section(SmoothingConfig, "Smoothing over time.")
    overlay_frames: int = Field(
        4, ge=1, le=100, description="Frames of a chunk in its overlay image (count)."
    )
