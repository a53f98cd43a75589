"""Configuration of the tracking stage: what is typical of landmarks, faces and heads."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section
from vermilion.config.image_fit import ImageFitConfig, OffsetsConfig


class LandmarkGroups(StageConfig):
    """One number for each part of the face, as a fraction of the inter-ocular distance."""

    jaw: float = Field(0.05, gt=0, le=1, description="Jaw line (inter-ocular distances).")
    brows: float = Field(0.03, gt=0, le=1, description="Brows (inter-ocular distances).")
    nose: float = Field(0.02, gt=0, le=1, description="Nose (inter-ocular distances).")
    eyes: float = Field(0.015, gt=0, le=1, description="Eyes (inter-ocular distances).")
    mouth: float = Field(0.015, gt=0, le=1, description="Mouth (inter-ocular distances).")


class LandmarkBiases(StageConfig):
    """How far a person's landmarks lie from the model's in all frames alike."""

    jaw: float = Field(0.08, gt=0, le=1, description="Jaw line (inter-ocular distances).")
    brows: float = Field(0.05, gt=0, le=1, description="Brows (inter-ocular distances).")
    nose: float = Field(0.04, gt=0, le=1, description="Nose (inter-ocular distances).")
    eyes: float = Field(0.04, gt=0, le=1, description="Eyes (inter-ocular distances).")
    mouth: float = Field(0.04, gt=0, le=1, description="Mouth (inter-ocular distances).")


class ModelFitConfig(StageConfig):
    """How much landmarks, and how much blend weights, are trusted."""

    noise: LandmarkGroups = section(
        LandmarkGroups, "Deviation of a detected landmark from one frame to another."
    )
    robust_sigmas: float = Field(
        3.0, gt=0.5, le=100, description="A landmark this far off counts half (deviations)."
    )
    weight_sigma: float = Field(
        0.5, gt=0.01, le=100, description="Deviation of a blend weight about zero."
    )
    jaw_slide: float = Field(
        0.1,
        ge=0,
        le=1,
        description="How far the place along the jaw line counts: 0, it slides freely; 1, fully.",
    )


class IdentityImagesConfig(StageConfig):
    """The person from the images as well: shape, albedo and light together (Lips16 3.2)."""

    enabled: bool = Field(
        True, description="Fit the person to the images of these frames; off: to landmarks alone."
    )
    spacing_mm: float = Field(
        5.0, ge=0.5, le=20, description="Between places where model and image are compared (mm)."
    )
    pixel_mm: float = Field(
        8.0, ge=0.1, le=20, description="Pixel of the image that is compared (mm at the face)."
    )
    sigma: float = Field(
        6.0, gt=0, le=255, description="Deviation of a colour (display values, 0 to 255)."
    )
    robust_sigmas: float = Field(
        2.0, gt=0.1, le=100, description="A place this far off counts half (deviations)."
    )
    strength: float = Field(
        10.0, ge=0, le=1e6, description="How many independent places a face is worth."
    )
    albedo_prior: float = Field(
        0.5,
        ge=0,
        le=100,
        description="How many frames' worth the skin's one colour counts at each place.",
    )
    rounds: int = Field(
        3, ge=1, le=20, description="Turns of light and visibility with the rest (count)."
    )
    iterations: int = Field(4, ge=1, le=50, description="Gauss-Newton steps of a turn (count).")


class IdentityConfig(StageConfig):
    """The person, from a few frames of all of a subject's takes."""

    frames: int = Field(
        16, ge=1, le=200, description="Frames of all takes together, evenly spread (count)."
    )
    bias: LandmarkBiases = section(
        LandmarkBiases,
        "Deviation of the person's landmarks, as the detector sees them, from the "
        "model's, the same in all frames.",
    )
    neutral_weight_sigma: float = Field(
        0.03,
        gt=0.001,
        le=1,
        description="Deviation of the blend weights in the first frame of a multi-view take, "
        "which is the neutral.",
    )
    focal_sigma: float = Field(
        0.3,
        gt=0.001,
        le=2,
        description="Deviation of the logarithm of an unknown focal length about the assumed one.",
    )
    images: IdentityImagesConfig = section(
        IdentityImagesConfig, "The person from the images as well."
    )


class MotionConfig(StageConfig):
    """Pose and blend weights of each frame (Mono13 6)."""

    rotation_acceleration_deg: float = Field(
        400.0,
        gt=0,
        le=1e9,
        description="Typical angular acceleration of a head (degrees per second squared); smaller "
        "is smoother.",
    )
    translation_acceleration_mm: float = Field(
        600.0,
        gt=0,
        le=1e9,
        description="Typical acceleration of a head (mm per second squared); smaller is smoother.",
    )
    weight_acceleration: float = Field(
        60.0,
        gt=0,
        le=1e9,
        description="Typical acceleration of a blend weight (per second squared); smaller is "
        "smoother.",
    )
    iterations: int = Field(15, ge=1, le=200, description="Gauss-Newton steps, at most (count).")
    max_reprojection: float = Field(
        0.12,
        gt=0,
        le=2,
        description="Frames whose landmarks miss the model by more are flagged (inter-ocular "
        "distances, root mean square).",
    )


class MeshesConfig(StageConfig):
    """The mesh sequence and its overlays."""

    overlay_frames: int = Field(
        6, ge=1, le=100, description="Frames of a chunk in its overlay image (count)."
    )


class ExternalConfig(StageConfig):
    """Mesh sequences of other trackers (takes of role `tracked`)."""

    unit_mm: float | None = Field(
        None,
        gt=0,
        le=1e6,
        description="Length of a unit in the files (mm). Empty: USD files say it, others are in mm.",
    )


class ScanConfig(StageConfig):
    """A 3D scan of a person, from which the tracker's model of that person is made (Mono13 4)."""

    path: str = Field(
        min_length=1, description="OBJ, PLY or STL of a head or face: any topology, unit and frame."
    )
    eyes: Literal["open", "closed"] = Field("open", description="Whether the scan's lids are shut.")
    landmarks: str | None = Field(
        None,
        description="Landmarks given by hand: a TSV with columns landmark (0 to 65), x, y, z in the "
        "scan's frame. Empty: they are found in rendered views.",
    )
    unit_mm: float | None = Field(
        None,
        gt=0,
        le=1e6,
        description="Length of a unit in the file (mm). Empty: the size of the model's head.",
    )
    finest_mm: float = Field(
        4.0,
        ge=1,
        le=50,
        description="Detail of the scan that is finer is smoothed away (wavelength, mm).",
    )


class TrackingConfig(StageConfig):
    """The coarse monocular track (Lips16 3.2, Mono13 6)."""

    fit: ModelFitConfig = section(ModelFitConfig, "Trust in landmarks and blend weights.")
    identity: IdentityConfig = section(IdentityConfig, "The person.")
    motion: MotionConfig = section(MotionConfig, "Pose and expression.")
    image_fit: ImageFitConfig = section(ImageFitConfig, "Pose and expression from the images.")
    offsets: OffsetsConfig = section(OffsetsConfig, "Offsets outside the model's space.")
    meshes: MeshesConfig = section(MeshesConfig, "Meshes and overlays.")
    scans: dict[str, ScanConfig] = Field(
        default_factory=dict,
        description="Subject -> scan, for those whose face model comes from one; the others' comes "
        "from the identity that their takes show.",
    )
    external: ExternalConfig = section(ExternalConfig, "Mesh sequences of other trackers.")
