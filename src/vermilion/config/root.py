"""The whole configuration: one section a stage."""

from __future__ import annotations

from pydantic import Field

from vermilion.config.apply import ApplyConfig
from vermilion.config.base import StageConfig
from vermilion.config.capture import CaptureConfig
from vermilion.config.contours import ContoursConfig
from vermilion.config.correction import CorrectionConfig
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.config.database import DatabaseConfig
from vermilion.config.detail import DetailConfig
from vermilion.config.evaluation import EvaluationConfig
from vermilion.config.face_model import FaceModelConfig
from vermilion.config.features import FeaturesConfig
from vermilion.config.guided import GuidedConfig
from vermilion.config.inpaint import InpaintConfig
from vermilion.config.landmarks import LandmarksConfig
from vermilion.config.multiview import MultiviewConfig
from vermilion.config.studio import StudioConfig
from vermilion.config.tracking import TrackingConfig
from vermilion.config.training import TrainingConfig


class Configuration(StageConfig):
    """Everything that a user can set; the defaults are those of the embedded demo."""

    results: str = Field(
        "results/demo",
        min_length=1,
        description="Folder of all results; two configurations never share one.",
    )
    takes: str = Field(
        "config/takes.tsv", min_length=1, description="The take sheet (TSV), one row a take."
    )
    chunk_frames: int = Field(
        100,
        ge=1,
        le=100_000,
        description="Frames a job (frames). Changes no result; 100 locally, 250 to 300 on a cluster.",
    )
    skip_takes: dict[str, str] = Field(
        default_factory=dict,
        description="Takes (subject/take) to leave out -> the reason, which quality.tsv repeats. `make run` "
        "leaves out takes that fail by itself.",
    )
    face_model: FaceModelConfig = Field(
        default_factory=FaceModelConfig, description="The face model."
    )
    studio: StudioConfig = Field(
        default_factory=StudioConfig, description="Synthetic captures (embedded default)."
    )
    capture: CaptureConfig = Field(
        default_factory=CaptureConfig, description="Checks of captures, calibration (Lips16 3.1)."
    )
    multiview: MultiviewConfig = Field(
        default_factory=MultiviewConfig, description="The high-quality mesh sequence (Lips16 3.1)."
    )
    inpaint: InpaintConfig = Field(
        default_factory=InpaintConfig, description="Removal of the lip tattoo (Lips16 3.2.1)."
    )
    landmarks: LandmarksConfig = Field(
        default_factory=LandmarksConfig, description="66 landmarks a frame (Mono13 5)."
    )
    tracking: TrackingConfig = Field(
        default_factory=TrackingConfig, description="The coarse monocular track (Lips16 3.2)."
    )
    detail: DetailConfig = Field(
        default_factory=DetailConfig, description="A finer sequence than C (Mono13 7)."
    )
    contours: ContoursConfig = Field(
        default_factory=ContoursConfig, description="Lip contour likelihood maps (Lips16 3.2.2)."
    )
    correspondence: CorrespondenceConfig = Field(
        default_factory=CorrespondenceConfig,
        description="Triangle-to-triangle map between the two topologies (Lips16 4.1).",
    )
    features: FeaturesConfig = Field(
        default_factory=FeaturesConfig, description="Features of a frame (Lips16 5.1)."
    )
    correction: CorrectionConfig = Field(
        default_factory=CorrectionConfig, description="The correction layer (Lips16 4.2)."
    )
    database: DatabaseConfig = Field(
        default_factory=DatabaseConfig, description="The training database (Lips16 3)."
    )
    training: TrainingConfig = Field(
        default_factory=TrainingConfig, description="Regressors (Lips16 5.2)."
    )
    evaluation: EvaluationConfig = Field(
        default_factory=EvaluationConfig, description="Measures and report (Lips16 6)."
    )
    apply: ApplyConfig = Field(
        default_factory=ApplyConfig, description="Correction of ordinary video (Lips16 6)."
    )
    guided: GuidedConfig = Field(
        default_factory=GuidedConfig,
        description="Correction of a take by a few frames that a person corrected (Guided18).",
    )
