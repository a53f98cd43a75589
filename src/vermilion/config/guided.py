"""Configuration of user-guided lip correction (Guided18)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section


class RegionsConfig(StageConfig):
    """Which part of the mouth is predicted, and which is trusted (Guided18 figure 2)."""

    inner_mm: float = Field(
        12.0,
        gt=0,
        le=100,
        description="How far the inner lips reach over the outside of the lips, from the line where "
        "they meet (mm). All that is wrong of the lips must lie within; the paper's figure shows about 5.",
    )
    inside_mm: float = Field(
        8.0, gt=0, le=100, description="How far the inner lips reach into the mouth (mm)."
    )
    mouth_mm: float = Field(
        40.0, gt=0, le=500, description="How far the mouth region reaches over the face (mm)."
    )


class SketchRefinementConfig(StageConfig):
    """A frame moved onto its sketches (Guided18 eq. 1); the paper's constants."""

    position: float = Field(
        0.1, gt=0, le=1000, description="lambda_pos: how much a vertex keeps its place (weight)."
    )
    still: float = Field(
        1.0,
        gt=0,
        le=1000,
        description="lambda_pos of what should hardly move: the inside of the mouth (weight).",
    )
    silhouette: float = Field(
        1.0, gt=0, le=1000, description="lambda_silh: pull of a pixel of a stroke (weight)."
    )
    regularity: float = Field(
        3.0, gt=0, le=1000, description="lambda_reg: how much the mesh keeps its shape (weight)."
    )
    iterations: int = Field(
        5, ge=1, le=100, description="Solves, each with silhouettes found anew (count)."
    )
    near_share: float = Field(
        0.1,
        gt=0,
        le=1,
        description="Pull of a stroke that is only near, beside one that is sure (share).",
    )
    samples: int = Field(
        40,
        ge=2,
        le=2000,
        description="Points of a stroke; each stands for the pixels about it (count).",
    )


class PropagationConfig(StageConfig):
    """From corrected frames to the whole take (Guided18 section 4)."""

    predict: Literal["auto", "change", "mouth", "lips"] = Field(
        "auto",
        description="`auto`: `mouth` for tracks, `change` for **H**. `change`: how the lips differ from the sequence, so that nothing changes where "
        "nothing was wrong; `mouth`: the same and how the whole mouth region was moved, for a sequence "
        "whose chin and cheeks are wrong, too (the track C); `lips`: the lips themselves, as the paper.",
    )
    with_neutral: bool = Field(
        True, description="The neutral counts as one more corrected frame; `false`: as the paper."
    )
    follow_mm: float = Field(
        12.0, gt=0, le=500, description="How far the inside of the mouth follows the lips (mm)."
    )
    novelty_limit: float = Field(
        0.5,
        ge=0,
        le=1,
        description="Share of a frame's mouth deformation that no corrected frame spans, above which "
        "quality.tsv names the frame.",
    )


class SuggestionConfig(StageConfig):
    """Frames worth correcting (Guided18 section 7)."""

    count: int = Field(10, ge=1, le=1000, description="Frames to suggest, best first (count).")


class GuidedStudyConfig(StageConfig):
    """Error against the number of corrected frames (Guided18 6.2)."""

    takes: list[str] = Field(
        default_factory=list,
        description="Takes (subject/take) whose true frames train and predict each other: takes of the "
        "studio by their truth, other takes of role tattoo by **H**; none by default.",
    )
    counts: list[int] = Field(
        [1, 2, 3, 5, 8, 10], min_length=1, description="Numbers of corrected frames (count)."
    )
    choices: list[Literal["suggested", "uniform", "extremes", "random"]] = Field(
        ["suggested", "uniform", "extremes", "random"],
        min_length=1,
        description="How the corrected frames are chosen.",
    )
    draws: int = Field(
        20, ge=1, le=10_000, description="Random choices, whose median is the value (count)."
    )
    seed: int = Field(0, ge=0, description="Seed of the random choices.")


class GuidedConfig(StageConfig):
    """Correction of a take by a few frames that a person corrected."""

    takes: dict[str, Literal["corrected", "base", "H"]] = Field(
        default_factory=dict,
        description="Takes (subject/take) -> the sequence that is corrected: `corrected` (by the "
        "regressor of `apply`), `base` (the track C) or `H` (role tattoo); none by default.",
    )
    contact: bool = Field(
        True, description="Keep the lips from passing through each other; `false`: as the paper."
    )
    regions: RegionsConfig = section(RegionsConfig, "Inner lips and mouth region.")
    refinement: SketchRefinementConfig = section(
        SketchRefinementConfig, "Sketched frames (Guided18 section 5)."
    )
    propagation: PropagationConfig = section(
        PropagationConfig, "The whole take (Guided18 section 4)."
    )
    suggestion: SuggestionConfig = section(SuggestionConfig, "Frames worth correcting.")
    study: GuidedStudyConfig = section(
        GuidedStudyConfig, "Error against the number of corrected frames (Guided18 6.2)."
    )
