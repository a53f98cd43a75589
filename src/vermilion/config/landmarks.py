"""Configuration of the landmarks stage: detector, its training, key frames, correction."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator, model_validator

from vermilion.config.base import StageConfig, section
from vermilion.config.sheet_numbers import face_problem


class NetworksConfig(StageConfig):
    """The ONNX face and landmark networks (`detector: onnx`)."""

    face_threshold: float = Field(
        0.5, ge=0.0, le=1.0, description="Least score of a face (0 to 1)."
    )
    landmark_threshold: float = Field(
        0.6, ge=0.0, le=1.0, description="Least mean confidence of a face's landmarks (0 to 1)."
    )
    passes: int = Field(
        2,
        ge=1,
        le=8,
        description="Crops a face (count): the first from its box, the others around the landmarks of "
        "the previous crop.",
    )


class MediapipeConfig(StageConfig):
    """The attention mesh of mediapipe (`detector: mediapipe`)."""

    environment: str = Field(
        ".venv-mediapipe",
        min_length=1,
        description="Folder of the virtual environment that tools/setup_landmarks.sh makes.",
    )


class LandmarkFilesConfig(StageConfig):
    """Landmarks of another tracker, a file a take (`detector: files`)."""

    path: str = Field(
        "",
        description="File of a take's landmarks, with {subject}, {take} and {camera} in place of "
        "their names: a CSV with columns frame, x_0.., y_0.., optional confidence and success (the format of "
        "OpenFace), or JSON (docs/landmarks.md).",
    )
    set: Literal["ibug66", "mediapipe478"] = Field(
        "ibug66",
        description="What the points are. `ibug66`: 66 points, or 68 whose inner mouth corners are left out. "
        "`mediapipe478`: the 478 points of mediapipe's attention mesh.",
    )
    first_frame: int | None = Field(
        None,
        ge=0,
        description="Number that the file gives to frame 0 of the take's source. Empty: 1 in a CSV, as "
        "OpenFace counts, 0 in JSON.",
    )
    pixel_centre: float = Field(
        0.0,
        ge=0.0,
        le=0.5,
        description="Coordinates that the file gives to the centre of the top-left pixel (pixels): "
        "0 as OpenCV and OpenFace have it, or 0.5. Not for the unit `image` of JSON.",
    )
    min_confidence: float = Field(
        0.5,
        ge=0.0,
        le=1.0,
        description="Frames with less confidence count as not found (0 to 1).",
    )


class LandmarkTrainingConfig(StageConfig):
    """The embedded regressor: supervised descent (Xiong and De la Torre 2013)."""

    stages: int = Field(5, ge=1, le=10, description="Successive regressions (count).")
    ridge: float = Field(
        0.1, gt=0, le=100, description="Ridge parameter, relative to the features' mean variance."
    )
    perturbations: int = Field(
        6, ge=1, le=50, description="Starting shapes a training image and its mirror (count)."
    )
    box_shift: float = Field(
        0.08, ge=0, le=0.3, description="Deviation of the start's place (face sizes)."
    )
    box_scale: float = Field(
        0.1, ge=0, le=0.3, description="Deviation of the logarithm of the start's size."
    )
    box_turn_deg: float = Field(
        8.0, ge=0, le=30, description="Deviation of the start's turn in the image (degrees)."
    )
    max_frames: int = Field(
        400,
        ge=10,
        le=5000,
        description="Labelled images that are used, evenly spread over all (count).",
    )
    found_threshold: float = Field(
        0.35, ge=0.0, le=1.0, description="Least mean confidence of a face's landmarks (0 to 1)."
    )
    seed: int = Field(0, ge=0, description="Seed of the starting shapes.")


class KeyFramesConfig(StageConfig):
    """Frames whose landmarks are trusted (Mono13 5.2; `correction.mode: flow`)."""

    share: float = Field(
        0.025,
        gt=0,
        le=1,
        description="Initial key frames: the share of a take's frames that are most similar to the first.",
    )
    max_clip: int = Field(
        50,
        ge=2,
        le=100_000,
        description="Longer clips between key frames are divided (frames).",
    )
    files: LandmarkFilesConfig = section(
        LandmarkFilesConfig,
        "Landmarks of another tracker, frame by frame, that count as key frames where "
        "the file exists and the tracker was sure.",
    )


class LandmarkCorrectionConfig(StageConfig):
    """Detected landmarks corrected by dense flow between key frames (Mono13 5.3)."""

    mode: Literal["raw", "flow"] = Field(
        "raw",
        description="`raw`: as detected. `flow`: blended with landmarks that flow carries from the key "
        "frames before and after; costs about 0.1 s a frame.",
    )
    mouth: float = Field(0.1, ge=0, le=1, description="Weight of the detector at the mouth.")
    inner_lips: float = Field(
        0.5,
        ge=0,
        le=1,
        description="Weight of the detector at the inner lip contour. The contour is an outline; flow "
        "follows the lip beside it. (0.1: as the rest of the mouth, as in Mono13.)",
    )
    eyes: float = Field(0.5, ge=0, le=1, description="Weight of the detector at the eyes.")
    jaw: float = Field(0.2, ge=0, le=1, description="Weight of the detector along the jaw.")
    rest: float = Field(0.2, ge=0, le=1, description="Weight of the detector elsewhere.")
    face_px: float = Field(
        280.0,
        ge=50,
        le=2000,
        description="Size of the face where flow is computed: root of its landmarks' box (pixels).",
    )
    tolerance: float = Field(
        0.03,
        gt=0,
        le=1,
        description="Flow with this forward-backward error, summed from the key frame, counts half "
        "(face sizes).",
    )


class FollowingConfig(StageConfig):
    """Which face is followed, and what is too little of one."""

    face: list[float] = Field(
        default_factory=list,
        max_length=4,
        description="Which of several faces is followed, for takes whose row of the take sheet has nothing "
        "in its column `face`. Empty: the largest; x, y: the one nearest to a point; left, top, right, "
        "bottom: the largest with its middle in a box (pixels of the upright image).",
    )
    least_eyes_px: float = Field(
        16.0,
        ge=0,
        le=1000,
        description="Faces whose outer eye corners are nearer to each other, at the sharpness of the image, "
        "count as not found (pixels).",
    )
    person_difference: float = Field(
        0.028,
        gt=0,
        le=10,
        description="After a cut, a face whose shape differs by more is another person's, and its frames "
        "count as not found; only `mediapipe` tells (inter-ocular distances).",
    )

    @field_validator("face")
    @classmethod
    def _none_a_point_or_a_box(cls, value: list[float]) -> list[float]:
        if reason := face_problem(value):
            raise ValueError(reason)
        return value


class LandmarksConfig(StageConfig):
    """Landmarks of every frame (Mono13 5)."""

    detector: Literal["mediapipe", "trained", "onnx", "files"] = Field(
        "trained",
        description="`mediapipe`: the attention mesh of mediapipe, 478 points, for real faces; needs "
        "the environment in `mediapipe`, and without it gives way to `onnx` where `models` is named, "
        "else to `trained`. `trained`: the embedded regressor, trained on `training_takes`. `onnx`: "
        "the networks in `models`. `files`: landmarks of another tracker, in `files`.",
    )
    mediapipe: MediapipeConfig = section(MediapipeConfig, "The attention mesh of mediapipe.")
    models: str = Field(
        "",
        description="`onnx`, or in place of `mediapipe`: folder with OpenSeeFace's mnv3_detection_opt.onnx and "
        "lm_model0_opt.onnx.",
    )
    training_takes: list[str] = Field(
        default_factory=list,
        description="`trained`, or in place of `mediapipe`: takes (subject/take) whose captures hold labels/landmarks/.",
    )
    following: FollowingConfig = section(FollowingConfig, "The face that is followed.")
    networks: NetworksConfig = section(NetworksConfig, "The ONNX networks.")
    files: LandmarkFilesConfig = section(LandmarkFilesConfig, "Files of another tracker.")
    training: LandmarkTrainingConfig = section(LandmarkTrainingConfig, "The embedded regressor.")
    key_frames: KeyFramesConfig = section(KeyFramesConfig, "Frames whose landmarks are trusted.")
    correction: LandmarkCorrectionConfig = section(
        LandmarkCorrectionConfig, "Correction by flow between them."
    )

    @model_validator(mode="after")
    def _detector_has_what_it_needs(self) -> LandmarksConfig:
        needs = {"onnx": ("models", self.models), "files": ("files.path", self.files.path)}
        if self.detector in needs and not needs[self.detector][1]:
            raise ValueError(
                f"landmarks.detector is '{self.detector}' but landmarks.{needs[self.detector][0]} "
                "is empty; name it"
            )
        return self
