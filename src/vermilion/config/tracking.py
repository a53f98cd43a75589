"""Configuration of the tracking stage: landmark fit, identity, meshes, other trackers, scans."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section
from vermilion.config.image_fit import (
    ColourTermConfig,
    ImageFitConfig,
    OffsetsConfig,
    acceleration,
)


def _per_interocular(default: float, part: str) -> float:
    """A fraction of the inter-ocular distance, for a part of the face."""
    return Field(default, gt=0, le=1, description=f"{part} (inter-ocular distances).")


class LandmarkGroups(StageConfig):
    """Deviation of a detected landmark between frames, for each part of the face."""

    jaw: float = _per_interocular(0.05, "Jaw line")
    brows: float = _per_interocular(0.03, "Brows")
    nose: float = _per_interocular(0.02, "Nose")
    eyes: float = _per_interocular(0.015, "Eyes")
    mouth: float = _per_interocular(0.015, "Mouth")


class LandmarkBiases(StageConfig):
    """Deviation of a person's detected landmarks from the model's that is constant over all frames."""

    jaw: float = _per_interocular(0.08, "Jaw line")
    brows: float = _per_interocular(0.05, "Brows")
    nose: float = _per_interocular(0.04, "Nose")
    eyes: float = _per_interocular(0.04, "Eyes")
    mouth: float = _per_interocular(0.04, "Mouth")


class ModelFitConfig(StageConfig):
    """Noise of the landmarks and prior of the blend weights."""

    noise: LandmarkGroups = section(
        LandmarkGroups, "Deviation of a detected landmark between frames."
    )
    robust_sigmas: float = Field(
        3.0,
        gt=0.5,
        le=100,
        description="A landmark with an error of this many deviations counts half (deviations).",
    )
    weight_sigma: float = Field(
        0.5, gt=0.01, le=100, description="Deviation of a blend weight about zero."
    )
    lid_weight_sigma: float = Field(
        1.0,
        gt=0.01,
        le=100,
        description="Deviation of the closing lids' weights about zero, where larger: blinks are whole.",
    )
    side_weight_share: float = Field(
        0.2,
        gt=0.001,
        le=1,
        description="Deviation of the weights that move jaw or mouth sideways, as a share of `weight_sigma`: people "
        "hardly do, and a turned head looks alike (1).",
    )
    rare_weight_share: float = Field(
        0.4,
        gt=0.001,
        le=1,
        description="The same for a jaw pushed forward, puffed cheeks, rolled and pressed lips and dimples (1).",
    )
    jaw_slide: float = Field(
        0.1,
        ge=0,
        le=1,
        description="Weight of a landmark's error along the jaw line: 0, it slides freely; 1, it counts in full.",
    )


class IdentityImagesConfig(ColourTermConfig):
    """The person from landmarks and images: shape, albedo and light together (Lips16 3.2)."""

    enabled: bool = Field(
        True, description="Fit the person to the images of the frames too; off: to landmarks alone."
    )
    spacing_mm: float = Field(
        5.0,
        ge=0.5,
        le=20,
        description="Distance between samples at which model and image are compared (mm).",
    )
    pixel_mm: float = Field(
        8.0, ge=0.1, le=20, description="Pixel size of the image that is compared (mm at the face)."
    )
    strength: float = Field(
        10.0, ge=0, le=1e6, description="Weight of a face's image, in independent samples."
    )
    albedo_prior: float = Field(
        0.5,
        ge=0,
        le=100,
        description="Weight of the skin's median colour at each sample, in frames.",
    )
    rounds: int = Field(
        3, ge=1, le=20, description="Rounds; each estimates light and visibility anew (count)."
    )
    iterations: int = Field(4, ge=1, le=50, description="Gauss-Newton steps of a round (count).")


class OwnLipsConfig(StageConfig):
    """The person's own mouth, where landmarks are dense (`mediapipe`).

    The neutral's mouth moves to where the lips are seen on the whole, as the tracker's identities have no such
    lips. The 66 landmarks of other detectors are off by much the same for everybody, so it does not count with
    them.
    """

    enabled: bool = Field(True, description="Whether the neutral takes the person's own mouth.")
    range_mm: float = Field(
        10.0, gt=0.1, le=100, description="Range over which neighbouring skin moves along (mm)."
    )
    sigma_mm: float = Field(
        2.0, gt=0.01, le=50, description="Deviation of a mouth from the tracker's identities (mm)."
    )
    noise_mm: float = Field(
        0.3, gt=0.01, le=50, description="Deviation of a landmark's mean offset over a take (mm)."
    )


class IdentityConfig(StageConfig):
    """The person, from a few frames of all of a subject's takes."""

    frames: int = Field(
        16, ge=1, le=200, description="Frames of all takes together, evenly spaced (count)."
    )
    bias: LandmarkBiases = section(
        LandmarkBiases,
        "Deviation of the person's detected landmarks from the model's, constant over all frames.",
    )
    own_lips: OwnLipsConfig = section(OwnLipsConfig, "The person's own mouth (dense landmarks).")
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
        IdentityImagesConfig, "The person from landmarks and images."
    )


class MotionConfig(StageConfig):
    """Pose and blend weights of each frame (Mono13 6)."""

    rotation_acceleration_deg: float = acceleration(400.0, "a head's rotation", "degrees")
    translation_acceleration_mm: float = acceleration(600.0, "a head", "mm")
    weight_acceleration: float = acceleration(40.0, "a blend weight", "1")
    fast_limit: float = Field(
        3.5,
        gt=0,
        le=1000,
        description="Lids or mouth that accelerate this many times as much as noise does in the single "
        "frames are half free of smoothing: blinks and closing lips stay whole. Large: all is smoothed.",
    )
    iterations: int = Field(15, ge=1, le=200, description="Gauss-Newton steps, at most (count).")
    max_reprojection: float = Field(
        0.12,
        gt=0,
        le=2,
        description="Frames with a larger RMS reprojection error are flagged (inter-ocular distances).",
    )


class MeshesConfig(StageConfig):
    """The mesh sequence and its overlays."""

    overlay_frames: int = Field(
        6, ge=1, le=100, description="Frames of a chunk in its overlay image (count)."
    )


class ExternalBaseConfig(StageConfig):
    """Sequences of another tracker as the base of the correction: rows `tracked` with a take in `of`."""

    world: Literal["guess", "capture", "landmarks"] = Field(
        "guess",
        description="World of the sequence: that of the capture's cameras (`capture`), or one that is found "
        "by the landmarks in the images, one rigid motion a take (`landmarks`). `guess`: that of the "
        "capture where the mesh projects on the face.",
    )
    weights: str | None = Field(
        None,
        description="Blend weights of the tracker, a CSV a take: a column `frame` and one a blend shape, "
        "with {subject}, {take} and {of} of the `tracked` row in the path. Empty: shape features are "
        "coefficients of the modes of the training frames.",
    )
    landmarks: str | None = Field(
        None,
        description="Landmarks on the neutral of the first training take: a TSV with columns landmark (0 "
        "to 65), x, y, z in millimetres, in the sequence's frame. Empty: they are detected in rendered "
        "views.",
    )
    model: str | None = Field(
        None,
        description="`face_model/external.npz` of another run of the same tracker, for a regressor that "
        "was trained there (`apply.model`). Empty: it is made.",
    )
    variance: float = Field(
        0.999,
        gt=0,
        le=1,
        description="Share of the variance of the training frames that the modes hold (share).",
    )
    modes: int = Field(40, ge=1, le=500, description="Modes at most (count).")


class ExternalConfig(StageConfig):
    """Mesh sequences of other trackers (takes of role `tracked`)."""

    unit_mm: float | None = Field(
        None,
        gt=0,
        le=1e6,
        description="Length of a unit in the files (mm). Empty: the unit that the file names, else a guess "
        "from the size of the mesh, which the log tells.",
    )
    up: Literal["y", "z"] | None = Field(
        None,
        description="Axis of the files that points up: a sequence with `z` up is turned to y up. Empty: "
        "it is left as it is.",
    )
    mesh: str | None = Field(
        None,
        description="Path or name of the mesh in files that have several. Empty: the only one that moves.",
    )
    flame: str | None = Field(
        None,
        min_length=1,
        description="Your FLAME model as `.npz` (docs/interchange.md), for sequences of its parameters.",
    )
    base: ExternalBaseConfig = section(
        ExternalBaseConfig, "The sequence as the base of the correction (docs/other_trackers.md)."
    )


class ScanConfig(StageConfig):
    """A 3D scan of a person, from which the tracker's model of that person is made (Mono13 4)."""

    path: str = Field(
        min_length=1,
        description="OBJ, PLY or STL of a head or face, of any topology, unit and frame.",
    )
    eyes: Literal["open", "closed"] = Field("open", description="Eyelids: `open` or `closed`.")
    landmarks: str | None = Field(
        None,
        description="Landmarks placed by hand: a TSV with columns landmark (0 to 65), x, y, z in the "
        "scan's frame. Empty: they are detected in rendered views.",
    )
    unit_mm: float | None = Field(
        None,
        gt=0,
        le=1e6,
        description="Length of a unit in the file (mm). Empty: that of mm, cm, inch, dm or m in which the head is as large as "
        "a head, else estimated from the size of the model's head.",
    )
    finest_mm: float = Field(
        4.0,
        ge=1,
        le=50,
        description="Finer detail of the scan is smoothed away (wavelength, mm).",
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
        description="Subject -> scan from which the subject's face model is made. The other subjects' "
        "models come from the identity fitted to their takes.",
    )
    external: ExternalConfig = section(ExternalConfig, "Mesh sequences of other trackers.")
