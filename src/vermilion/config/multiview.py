"""Configuration of the multi-view reconstruction (Lips16 3.1)."""

from __future__ import annotations

from pydantic import Field, model_validator

from vermilion.config.base import StageConfig, section


class ImageConfig(StageConfig):
    """How images are prepared for matching."""

    window_px: float = Field(
        8.0,
        gt=0.5,
        le=50,
        description="Standard deviation of the window of the local contrast normalisation (px).",
    )
    floor: float = Field(
        0.01,
        gt=0,
        le=0.5,
        description="Local deviation of sRGB luma (0 to 1) below which an image counts as flat.",
    )


class StereoConfig(StageConfig):
    """Dense matching of rectified stereo pairs."""

    pairs: list[tuple[str, str]] = Field(
        [],
        description="Stereo pairs by camera name; empty: found from the cameras' poses (nearest "
        "viewing direction, similar resolution).",
    )
    reach_mm: float = Field(
        70.0,
        gt=5,
        le=500,
        description="Depth range of the face around the centre of its landmarks (mm).",
    )
    block_px: int = Field(
        5, ge=1, le=21, description="Matching window of semi-global matching (px)."
    )
    uniqueness_percent: int = Field(
        5, ge=0, le=50, description="Margin of the best disparity over the second best (percent)."
    )
    consistency_px: float = Field(
        1.0, gt=0, le=5, description="Largest left-right disagreement of a disparity (px)."
    )
    speckle_px: int = Field(
        200, ge=0, le=100_000, description="Smaller connected regions are dropped (px)."
    )
    min_texture: float = Field(
        4.0,
        ge=0,
        le=100,
        description="Smallest local deviation of the normalised image (grey levels of 255).",
    )
    spacing_mm: float = Field(
        1.0, gt=0.1, le=5, description="Spacing of the fused point cloud (mm)."
    )


class NeutralConfig(StageConfig):
    """Registration of the template to the neutral frame."""

    min_confidence: float = Field(
        0.3, ge=0, le=1, description="Least confidence of a landmark that is used."
    )
    landmark_distance_mm: float = Field(
        4.0,
        gt=0.1,
        le=50,
        description="A view agrees with a triangulated landmark within this distance (mm).",
    )
    landmark_sigma_mm: float = Field(
        2.0, gt=0.1, le=20, description="Expected error of a triangulated landmark (mm)."
    )
    landmark_length_mm: float = Field(
        15.0,
        gt=1,
        le=100,
        description="Stiffness of the deformation onto the landmarks: finer details do not change (mm).",
    )
    first_gate_mm: float = Field(
        20.0, gt=1, le=100, description="Largest distance of a matched point, first round (mm)."
    )
    last_gate_mm: float = Field(
        3.0, gt=0.2, le=20, description="Largest distance of a matched point, last round (mm)."
    )
    first_length_mm: float = Field(
        40.0, gt=1, le=200, description="Stiffness of the first round of dense registration (mm)."
    )
    last_length_mm: float = Field(
        4.0, gt=0.5, le=50, description="Stiffness of the last round of dense registration (mm)."
    )
    rounds: int = Field(9, ge=2, le=50, description="Rounds of dense registration.")
    poisson_depth: int = Field(
        7, ge=5, le=12, description="Octree depth of the screened Poisson reconstruction."
    )
    polish_lengths_mm: list[float] = Field(
        [3.0, 1.5],
        description="Stiffness of each round of photo-consistency between cameras (mm).",
    )
    sigma_px: float = Field(
        0.3, gt=0.01, le=10, description="Expected error of a flow vector between cameras (px)."
    )
    polish_min_angle_deg: float = Field(
        6.0,
        gt=0,
        le=60,
        description="Pairs of cameras below this angle are not polished (degrees).",
    )
    polish_max_angle_deg: float = Field(
        40.0,
        gt=0,
        le=90,
        description="Pairs of cameras above this angle are not polished (degrees).",
    )
    same_points: bool = Field(
        True,
        description="All takes of a person have the same points of the skin: the neutral of the first take "
        "is registered to later takes by the images. Off: each take has its own points.",
    )


class TrackConfig(StageConfig):
    """The coarse track through the take, between anchor frames."""

    scale: float = Field(
        0.5, gt=0.05, le=1.0, description="Size of the images against the originals (ratio)."
    )
    length_mm: float = Field(
        3.0, gt=0.5, le=50, description="Stiffness: motion is smooth below this length (mm)."
    )
    sigma_px: float = Field(
        0.5,
        gt=0.01,
        le=10,
        description="Expected error of a flow vector (px of the small images).",
    )
    min_agreement: float = Field(
        0.4, ge=0, le=0.99, description="Smallest correlation of a flow vector's surroundings."
    )
    max_step_mm: float = Field(
        8.0, gt=0.1, le=100, description="Longest motion of a vertex between two frames (mm)."
    )
    anchor_similarity: float = Field(
        0.6,
        ge=0,
        le=1,
        description="Smallest correlation of an anchor frame's images with the neutral's.",
    )
    clip_frames: int = Field(
        24,
        ge=3,
        le=10_000,
        description="Approximate length of a clip between two anchor frames; each clip is a job (frames).",
    )


class RefineConfig(StageConfig):
    """The final registration of each frame to the neutral's images."""

    scales: list[float] = Field(
        [0.5, 1.0],
        min_length=1,
        description="Size of the images in each round against the originals (ratio).",
    )
    lengths_mm: list[float] = Field(
        [2.5, 1.0],
        min_length=1,
        description="Stiffness of each round: finer details come from the neutral (mm).",
    )
    sigma_px: float = Field(
        0.3, gt=0.01, le=10, description="Expected error of a flow vector (px)."
    )
    min_agreement: float = Field(
        0.3, ge=0, le=0.99, description="Smallest correlation of a flow vector's surroundings."
    )
    max_step_mm: float = Field(
        8.0, gt=0.1, le=100, description="Longest motion of a vertex in a round (mm)."
    )
    ray_stride_px: int = Field(
        2, ge=1, le=8, description="Spacing of the rays that predict an image (px)."
    )
    cloud_scale: float = Field(
        0.5,
        ge=0,
        le=1.0,
        description="Size of the images for each frame's stereo points against the originals "
        "(ratio); 0: no stereo after the neutral.",
    )
    cloud_gate_mm: float = Field(
        1.5, gt=0.05, le=20, description="Largest distance of a stereo point from the mesh (mm)."
    )
    max_residual_px: float = Field(
        2.0,
        gt=0.05,
        le=50,
        description="Median residual at which a frame is flagged as failed (px).",
    )
    min_seen_percent: float = Field(
        25.0,
        ge=0,
        le=100,
        description="Share of the neutral's visible vertices that must be measured, below which a "
        "frame is flagged as failed (percent).",
    )


class DriftConfig(StageConfig):
    """Drift against the anchor: the neutral's images warped to each frame by its mesh."""

    scale: float = Field(
        0.5,
        gt=0.05,
        le=1.0,
        description="Size of the compared images against the originals (ratio).",
    )
    min_agreement: float = Field(
        0.3, ge=0, le=0.99, description="Smallest correlation of a flow vector's surroundings."
    )
    ray_stride_px: int = Field(
        2, ge=1, le=8, description="Spacing of the rays that warp an image (px)."
    )


class LostConfig(StageConfig):
    """Frames in which the mesh lost the lips: their pattern differs from the neutral's. They train nothing."""

    difference: float = Field(
        0.6,
        gt=0.0,
        le=2.0,
        description="A frame whose lips differ by more is lost (local deviations; 0: the same pattern, 1.1: "
        "unrelated ones).",
    )
    near_difference: float = Field(
        0.4, gt=0.0, le=2.0,
        description="So are the frames before and after it, up to the first whose lips differ by less.",
    )  # fmt: skip


class ReportConfig(StageConfig):
    """The report page of a take."""

    spaced_frames: int = Field(
        3,
        ge=0,
        le=50,
        description="Evenly spaced frames that are shown, besides the neutral and the worst frames.",
    )
    flagged_frames: int = Field(
        2,
        ge=0,
        le=50,
        description="Flagged frames that are shown, those of the largest drift first.",
    )
    image_px: int = Field(
        200, ge=80, le=800, description="Width and height of an image of a sheet (px)."
    )
    residual_px: float = Field(
        1.0, gt=0, le=20, description="Residual of the hottest colour (px of the originals)."
    )
    cloud_mm: float = Field(
        0.5,
        gt=0,
        le=10,
        description="Distance of a stereo point from the mesh at the ends of the colours (mm).",
    )
    page_mb: float = Field(
        12.0,
        gt=0.1,
        le=200,
        description="Largest size of the page; sheets are scaled down to it (MB).",
    )


class MultiviewConfig(StageConfig):
    """From calibrated cameras to **H**, the registered high-quality mesh sequence."""

    images: ImageConfig = section(ImageConfig, "Preparation of images.")
    stereo: StereoConfig = section(StereoConfig, "Dense matching.")
    neutral: NeutralConfig = section(NeutralConfig, "Template to the neutral frame.")
    track: TrackConfig = section(TrackConfig, "Coarse track with anchor frames (Beeler 2011).")
    refine: RefineConfig = section(RefineConfig, "Registration of each frame to the neutral.")
    drift: DriftConfig = section(DriftConfig, "Drift of each frame against the neutral.")
    lost: LostConfig = section(LostConfig, "Frames in which the mesh lost the lips.")
    report: ReportConfig = section(ReportConfig, "The report page of a take.")

    @model_validator(mode="after")
    def _rounds_agree(self) -> MultiviewConfig:
        if len(self.refine.scales) != len(self.refine.lengths_mm):
            raise ValueError(
                f"multiview.refine.scales has {len(self.refine.scales)} rounds, "
                f"multiview.refine.lengths_mm has {len(self.refine.lengths_mm)}; give as many"
            )
        return self
