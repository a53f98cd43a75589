"""Configuration of the lip contours (Lips16 3.2.2)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section


class BoostingConfig(StageConfig):
    """Boosted trees of the contour detectors."""

    trees: int = Field(160, ge=1, le=5000, description="Rounds of boosting (trees).")
    depth: int = Field(4, ge=1, le=8, description="Splits from root to leaf of a tree.")
    learning_rate: float = Field(0.15, gt=0, le=1, description="Shrinkage of each tree (share).")
    features_per_tree: int = Field(
        128, ge=1, description="Random subset of the pool that one tree may use (features)."
    )
    sample_share: float = Field(
        0.4, gt=0, le=1, description="Share of the samples that choose a tree's splits."
    )
    l2: float = Field(
        5.0, gt=0, description="Ridge on leaf values (second derivative of the loss)."
    )


class TrackRidgeConfig(StageConfig):
    """Ridges near the tracked lips (`kind: track`). Lengths are per inter-ocular distance."""

    frames: int = Field(
        20,
        ge=1,
        le=500,
        description="Frames of a take from which its lip borders are learnt, evenly spaced (count).",
    )
    span: int = Field(
        240,
        ge=0,
        description="Where dense landmarks are the start, a take of fewer frames is learnt from frames of its "
        "source before and after it, too, as far as there are no cuts: so many in all (count); 0: from its own.",
    )
    reach: float = Field(
        0.08,
        gt=0,
        le=0.3,
        description="Search distance for the take's outer border, from the tracked border.",
    )
    frame_reach: float = Field(
        0.02,
        gt=0,
        le=0.2,
        description="Search distance for a frame's outer border, from the take's; 1.5 times this at most.",
    )
    lip_reach: float = Field(
        0.05,
        gt=0,
        le=0.3,
        description="Largest shift of a whole lip or corner from there in a frame, as when lips roll.",
    )
    inner_reach: float = Field(
        0.05, gt=0, le=0.3, description="Search distance for the inner border, from its mean place."
    )


class ContourDetectorConfig(StageConfig):
    """How contours are found: by detectors trained on labelled frames, or near the track."""

    kind: Literal["auto", "boosted", "track", "landmarks"] = Field(
        "auto",
        description="`boosted`: edge learning, trained on the take's labelled frames. `track`: ridges at "
        "the border of the lips' colour near the tracked lips, learnt from frames of the whole take. "
        "`landmarks`: the same near the landmarks, each frame by itself. `auto`: boosted where the take has "
        "labelled frames in the monocular camera, else track.",
    )
    interocular_size_px: float = Field(
        200.0,
        ge=60,
        le=600,
        description="Inter-ocular distance to which the mouth's region is scaled before detection "
        "(pixels): the working resolution.",
    )
    margin: float = Field(
        0.16,
        gt=0,
        le=0.5,
        description="Width of the searched band around the landmarks' mouth (per inter-ocular distance).",
    )
    features: int = Field(1000, ge=50, le=50_000, description="Size of the pool (features).")
    patch_px: int = Field(
        48, ge=8, le=78, description="Side of the patch a feature may reach (region pixels)."
    )
    label_px: float = Field(
        1.2, gt=0, le=5, description="Deviation of the soft labels about a contour (region pixels)."
    )
    variants: int = Field(
        4,
        ge=1,
        le=32,
        description="Samples of a labelled frame: itself, then jittered or mirrored.",
    )
    far_share: float = Field(
        0.08, gt=0, le=1, description="Share of the pixels far from a contour that are drawn."
    )
    max_samples: int = Field(
        30_000, ge=1000, description="Pixels, at most, of the first training of a detector."
    )
    hard_rounds: int = Field(
        1, ge=0, le=5, description="Rounds of training that add false positives (hard negatives)."
    )
    smoothing_px: float = Field(
        1.0, gt=0, le=5, description="Deviation of the Gaussian on the maps (region pixels)."
    )
    ridge_width: float = Field(
        0.008,
        gt=0,
        le=0.2,
        description="`track`, `landmarks`: deviation of the ridges (per inter-ocular distance).",
    )
    ridge_reach: float = Field(
        0.08,
        gt=0,
        le=0.3,
        description="`landmarks`: search distance for the lips' border, from the landmarks (per "
        "inter-ocular distance; 1.5 times this for the outer border).",
    )
    lips_reach: float = Field(
        0.02,
        gt=0,
        le=0.3,
        description="`track`, `landmarks`: how far from the lips of dense landmarks (detector `mediapipe`) "
        "the inner border is looked for (per inter-ocular distance). Where there are such lips, both start "
        "from them, and `ridge_reach` and `track.inner_reach` do not count.",
    )
    lips_shade: float = Field(
        1.0,
        ge=0,
        le=2,
        description="Where the lips of dense landmarks are the start: what the dark line between a lip and "
        "the teeth counts as an edge (share of the strongest), and a gap between the teeth and the lower lip against "
        "a border above it.",
    )
    lips_colours: float = Field(
        0.5,
        ge=0,
        le=1,
        description="`track`, where the lips of dense landmarks are the start: what the colours of lips and of the "
        "mouth's inside in all frames of the take count for the inner border, against those of the frame "
        "alone (share); 0 does not learn them.",
    )
    lips_heights: float = Field(
        1.0,
        ge=0,
        le=10,
        description="`track`, where the lips of dense landmarks are the start: weight of the heights that the lips "
        "have in the other frames of the take against edges in this one; 0 does not learn them.",
    )
    edge_weight: float = Field(
        4.0,
        ge=0,
        description="`track`, `landmarks`: weight of the strongest edge against a border at the search "
        "distance from the start; 0 keeps the start.",
    )
    stiffness: float = Field(
        6.0,
        ge=0,
        description="`track`, `landmarks`: cost of a slope of 1 between the border and the start.",
    )
    track: TrackRidgeConfig = section(TrackRidgeConfig, "Ridges near the tracked lips.")
    boosting: BoostingConfig = section(BoostingConfig, "Boosted trees of the detectors.")
    seed: int = Field(0, ge=0, description="Seed of the random features and samples.")


class ContourMapsConfig(StageConfig):
    """Likelihood maps of every frame."""

    least_peak: float = Field(
        0.2,
        ge=0,
        le=1,
        description="A frame whose outer map stays below this likelihood is flagged.",
    )
    overlay_frames: int = Field(
        12, ge=1, le=200, description="Frames at most in a chunk's overlay image."
    )


class ContoursConfig(StageConfig):
    """Lip contour likelihood maps."""

    detector: ContourDetectorConfig = section(ContourDetectorConfig, "How contours are found.")
    maps: ContourMapsConfig = section(ContourMapsConfig, "Maps of every frame.")
