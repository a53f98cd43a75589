"""Configuration of the landmarks stage: the detector, and how the embedded one is trained."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from vermilion.config.base import StageConfig


class NetworksConfig(StageConfig):
    """The ONNX face and landmark networks (`detector: onnx`)."""

    face_threshold: float = Field(
        0.5, ge=0.0, le=1.0, description="Least score of a face (0 to 1)."
    )
    landmark_threshold: float = Field(
        0.6, ge=0.0, le=1.0, description="Least mean confidence of a face's landmarks (0 to 1)."
    )
    passes: int = Field(
        3,
        ge=1,
        le=8,
        description="Crops a face: the first round the face box, the others round the landmarks of "
        "the crop before (count).",
    )


class LandmarkFilesConfig(StageConfig):
    """Landmarks of another tracker, a CSV a take (`detector: csv`)."""

    path: str = Field(
        "",
        description="File of a take's landmarks, with {subject}, {take} and {camera} in place of "
        "their names: columns frame, x_0.., y_0.. of 66 or 68 points, optional confidence and "
        "success (the format of OpenFace).",
    )
    first_frame: int = Field(
        1,
        ge=0,
        description="Number that the file gives to frame 0 of the take's source (OpenFace: 1).",
    )
    pixel_centre: float = Field(
        0.0,
        ge=0.0,
        le=0.5,
        description="Coordinates that the file gives to the centre of the top-left pixel (pixels): "
        "0 as OpenCV and OpenFace have it, or 0.5.",
    )
    min_confidence: float = Field(
        0.5,
        ge=0.0,
        le=1.0,
        description="Frames with less confidence count as not found (0 to 1).",
    )


class LandmarkTrainingConfig(StageConfig):
    """The embedded regressor: supervised descent (Xiong and De la Torre 2013)."""

    stages: int = Field(5, ge=1, le=10, description="Regressions in a row (count).")
    ridge: float = Field(
        0.1, gt=0, le=100, description="Ridge parameter, relative to the features' mean variance."
    )
    perturbations: int = Field(
        6, ge=1, le=50, description="Starting shapes a training picture and its mirror (count)."
    )
    box_shift: float = Field(
        0.08, ge=0, le=0.3, description="Deviation of the start's place (face sizes)."
    )
    box_scale: float = Field(
        0.1, ge=0, le=0.3, description="Deviation of the logarithm of the start's size."
    )
    box_turn_deg: float = Field(
        8.0, ge=0, le=30, description="Deviation of the start's turn in the picture (degrees)."
    )
    max_frames: int = Field(
        400,
        ge=10,
        le=5000,
        description="Labelled pictures that are used, evenly spread over all (count).",
    )
    found_threshold: float = Field(
        0.35, ge=0.0, le=1.0, description="Least mean confidence of a face's landmarks (0 to 1)."
    )
    seed: int = Field(0, ge=0, description="Seed of the starting shapes.")


class LandmarksConfig(StageConfig):
    """66 landmarks a frame (Mono13 5.1)."""

    detector: Literal["trained", "onnx", "csv"] = Field(
        "trained",
        description="`trained`: the embedded regressor, trained on `training_takes`. `onnx`: the "
        "networks in `models`. `csv`: files of another tracker.",
    )
    models: str = Field(
        "",
        description="`onnx` only: folder with OpenSeeFace's mnv3_detection_opt.onnx and "
        "lm_model0_opt.onnx.",
    )
    training_takes: list[str] = Field(
        default_factory=list,
        description="`trained` only: takes (subject/take) whose captures hold labels/landmarks/.",
    )
    networks: NetworksConfig = Field(
        default_factory=NetworksConfig, description="The ONNX networks."
    )
    csv: LandmarkFilesConfig = Field(
        default_factory=LandmarkFilesConfig, description="Files of another tracker."
    )
    training: LandmarkTrainingConfig = Field(
        default_factory=LandmarkTrainingConfig, description="The embedded regressor."
    )

    @model_validator(mode="after")
    def _detector_has_what_it_needs(self) -> LandmarksConfig:
        needs = {"onnx": ("models", self.models), "csv": ("csv.path", self.csv.path)}
        if self.detector in needs and not needs[self.detector][1]:
            raise ValueError(
                f"landmarks.detector is '{self.detector}' but landmarks.{needs[self.detector][0]} "
                "is empty; name it"
            )
        return self
