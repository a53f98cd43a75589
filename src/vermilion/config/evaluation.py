"""Configuration of the evaluation stage."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section


class ReferenceConfig(StageConfig):
    """Correspondence of vertices and the truth."""

    max_distance_mm: float = Field(
        6.0,
        gt=0.0,
        le=50.0,
        description="A vertex farther than this from the truth's neutral has no counterpart and is "
        "not measured (mm).",
    )
    max_normal_angle_deg: float = Field(
        60.0,
        gt=0.0,
        lt=90.0,
        description="Largest angle between the normals of a vertex and of its counterpart "
        "(degrees).",
    )


class SurfaceConfig(StageConfig):
    """From where on `quality.tsv` and the rates tell that something of the corrected lips' surface is wrong."""

    inner_mouth_mm: float = Field(
        0.2,
        ge=0.0,
        le=10.0,
        description="The inside of the mouth counts where the camera sees it this far in front of the "
        "vermilion (mm).",
    )
    inner_mouth_share: float = Field(
        0.002,
        ge=0.0,
        le=1.0,
        description="A frame has inner mouth in front where it hides more than this share of the vermilion "
        "that faces the camera (0 to 1).",
    )
    rough_ratio: float = Field(
        1.3,
        gt=0.0,
        le=100.0,
        description="The inner edge of the lips is rough where its roughness is over this multiple of the base "
        "track's (ratio).",
    )
    rough_mm: float = Field(
        0.1,
        ge=0.0,
        le=10.0,
        description="It is not rough where its roughness is at most this, which nobody sees: a quarter of a "
        "pixel at a mouth of 120 px (mm).",
    )


class MeasuresConfig(StageConfig):
    """Figures and their confidence intervals."""

    clip_frames: int = Field(
        15,
        ge=1,
        description="Length of the clips that the confidence intervals are taken over (frames).",
    )
    min_clips: int = Field(
        4,
        ge=1,
        le=100,
        description="Clips are shorter where a take has too few frames for this many (clips).",
    )
    bootstrap_samples: int = Field(
        1000, ge=100, le=100_000, description="Bootstrap samples of an interval (samples)."
    )
    confidence: float = Field(
        0.95, gt=0.5, lt=1.0, description="Confidence of the intervals (0.5 to 1)."
    )
    touch_mm: float = Field(
        0.3,
        ge=0.0,
        le=2.0,
        description="Lips touch in truth where their gap is at most this everywhere in the middle "
        "half of the mouth (mm).",
    )
    gape_mm: float = Field(
        1.0,
        gt=0.0,
        le=10.0,
        description="A result is falsely open where the lips touch in truth and its gap is larger "
        "(mm).",
    )
    through_mm: float = Field(
        0.05,
        ge=0.0,
        le=10.0,
        description="Lips pass through each other where one lies deeper than this in the other (mm).",
    )
    surface: SurfaceConfig = section(
        SurfaceConfig, "From where on something of the corrected lips' surface is wrong."
    )
    seed: int = Field(0, ge=0, description="Seed of the bootstrap.")


class ContourConfig(StageConfig):
    """The baseline of Lips16 section 6: the tracker with lip shapes, aligned to the contours."""

    shapes: int = Field(
        30,
        ge=1,
        le=200,
        description="Lip shapes, chosen from the training takes and transferred to each person "
        "(Lips16: 30).",
    )
    ridge: float = Field(
        0.02,
        gt=0.0,
        description="Cost of a weight that moves the lips by 1 mm, relative to a mean square distance of "
        "1 mm2 to the contours.",
    )


class FiguresConfig(StageConfig):
    """Images of the report."""

    error_scale_mm: float = Field(
        5.0, gt=0.0, le=50.0, description="Error shown in the hottest colour of error maps (mm)."
    )
    map_frames: int = Field(
        3,
        ge=1,
        le=12,
        description="Frames a take in the error maps: those of the largest error of the base track "
        "in as many equal stretches (frames).",
    )
    map_size_px: int = Field(300, ge=100, le=1200, description="Width of one error map (pixels).")
    embed_video_mb: float = Field(
        8.0,
        ge=0.0,
        le=200.0,
        description="Overlay videos up to this size are embedded in the summary; larger ones are "
        "named (megabytes).",
    )


class EvaluationConfig(StageConfig):
    """Errors against truth or a held-out reconstruction (Lips16 section 6)."""

    truth: str | None = Field(
        None,
        description="Folder of known truth, `<subject>/<take>/vertices_mm.npy` and `triangles.npy` "
        "inside; read by the evaluation alone. Empty: the studio's truth for the takes that the "
        "studio made, and the held-out reconstruction H for the others.",
    )
    reference: ReferenceConfig = section(
        ReferenceConfig, "Correspondence of vertices and the truth."
    )
    variants: list[Literal["rbf", "affine", "kernel", "shape-only", "distances-only", "paper"]] = (
        Field(
            [],
            description="Variants of the regressors to train and evaluate beside them: another estimator "
            "(`rbf`, `affine`, `kernel`), the configured one on some of the features (`shape-only`, "
            "`distances-only`), or the paper's network with layers alone (`paper`).",
        )
    )
    variants_of: list[Literal["PS", "MS", "GR"]] = Field(
        ["PS", "MS", "GR"],
        description="Regressors that the variants are made of: `PS`, `MS`, `GR`.",
    )
    generic: str | None = Field(
        None,
        min_length=1,
        description="File of a generic regressor (docs/database.md), measured as `GR/generic` beside the others. The face "
        "model must be that of its training.",
    )
    contour: ContourConfig = section(ContourConfig, "The contour baseline (Lips16 section 6).")
    measures: MeasuresConfig = section(MeasuresConfig, "Figures and their intervals.")
    figures: FiguresConfig = section(FiguresConfig, "Images of the report.")
