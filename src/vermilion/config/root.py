"""The whole configuration: one section a stage."""

from __future__ import annotations

from pydantic import Field

from vermilion.config.apply import ApplyConfig
from vermilion.config.base import StageConfig, section
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
        description="Frames of a job (frames). It changes no result; 100 locally, 250 to 300 on a cluster.",
    )
    skip_takes: dict[str, str] = Field(
        default_factory=dict,
        description="Takes (subject/take) to leave out -> the reason, which quality.tsv repeats. `make run` "
        "leaves out takes that fail by itself.",
    )
    face_model: FaceModelConfig = section(FaceModelConfig, "The face model.")
    studio: StudioConfig = section(StudioConfig, "Synthetic captures (embedded default).")
    capture: CaptureConfig = section(CaptureConfig, "Checks of captures, calibration (Lips16 3.1).")
    multiview: MultiviewConfig = section(
        MultiviewConfig, "The high-quality mesh sequence (Lips16 3.1)."
    )
    inpaint: InpaintConfig = section(InpaintConfig, "Removal of the lip tattoo (Lips16 3.2.1).")
    landmarks: LandmarksConfig = section(LandmarksConfig, "66 landmarks a frame (Mono13 5).")
    tracking: TrackingConfig = section(TrackingConfig, "The coarse monocular track (Lips16 3.2).")
    detail: DetailConfig = section(
        DetailConfig, "The detailed sequence: flow and relief (Mono13 7, 8)."
    )
    contours: ContoursConfig = section(
        ContoursConfig, "Lip contour likelihood maps (Lips16 3.2.2)."
    )
    correspondence: CorrespondenceConfig = section(
        CorrespondenceConfig, "Triangle-to-triangle map between the two topologies (Lips16 4.1)."
    )
    features: FeaturesConfig = section(FeaturesConfig, "Features of a frame (Lips16 5.1).")
    correction: CorrectionConfig = section(CorrectionConfig, "The correction layer (Lips16 4.2).")
    database: DatabaseConfig = section(DatabaseConfig, "The training database (Lips16 3).")
    training: TrainingConfig = section(TrainingConfig, "Regressors (Lips16 5.2).")
    evaluation: EvaluationConfig = section(EvaluationConfig, "Measures and report (Lips16 6).")
    apply: ApplyConfig = section(ApplyConfig, "Correction of ordinary video (Lips16 6).")
    guided: GuidedConfig = section(
        GuidedConfig, "Correction of a take by a few frames that a person corrected (Guided18)."
    )
