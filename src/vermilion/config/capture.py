"""Configuration of the capture stage: checks and calibration."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator, model_validator

from vermilion.config.base import StageConfig, section
from vermilion.imaging.colour_space import check_colour_space
from vermilion.imaging.images import ImageReading


class ManifestConfig(StageConfig):
    """What the manifest records about the images."""

    hash_decoded: bool = Field(
        False,
        description="Also record the SHA-256 of each decoded frame of a video file (slower).",
    )


class CalibrationConfig(StageConfig):
    """Calibration from images of a board, for captures without `cameras/`."""

    board: Literal["charuco", "checkerboard"] = Field(
        "charuco", description="Kind of the calibration board: `charuco` or `checkerboard`."
    )
    squares: tuple[int, int] = Field(
        (9, 7), description="Squares of the board in a row and in a column (count)."
    )
    square_mm: float = Field(20.0, ge=0.5, le=1000, description="Edge of a square (mm).")
    marker_mm: float = Field(
        15.0, gt=0, le=1000, description="Edge of a marker, ChArUco only (mm); less than a square."
    )
    dictionary: str = Field(
        "DICT_4X4_50",
        pattern="^DICT_[A-Za-z0-9_]+$",
        description="Marker dictionary, ChArUco only, as `cv2.aruco` names it.",
    )
    legacy_pattern: bool = Field(
        False, description="The board was printed with OpenCV before 4.6 (ChArUco only)."
    )
    camera_model: Literal["PINHOLE", "OPENCV"] = Field(
        "OPENCV",
        description="COLMAP camera model: `PINHOLE`, or `OPENCV` with two radial and two tangential "
        "distortion terms.",
    )
    refine_principal_point: bool = Field(
        True, description="Estimate the principal point; off: it is the middle of the image."
    )
    max_view_px: float = Field(
        2.0, gt=0, le=50, description="Board views with a larger RMS error are left out (pixels)."
    )
    assumed_focal: float = Field(
        1.2,
        ge=0.3,
        le=10,
        description="Focal length of a single camera without calibration, for takes whose row of the take sheet "
        "has nothing in its column `focal` (lengths of the image's longer side; a full-frame lens of 43 mm is 1.2).",
    )

    @field_validator("squares")
    @classmethod
    def _at_least_three(cls, squares: tuple[int, int]) -> tuple[int, int]:
        if min(squares) < 3:
            raise ValueError("a board has at least 3 squares a side")
        return squares

    @field_validator("dictionary")
    @classmethod
    def _known_dictionary(cls, name: str) -> str:
        import cv2

        if not hasattr(cv2.aruco, name):
            raise ValueError(f"cv2.aruco has no dictionary {name}; for example DICT_4X4_50")
        return name

    @model_validator(mode="after")
    def _board_is_possible(self) -> CalibrationConfig:
        if self.board == "charuco" and self.marker_mm >= self.square_mm:
            raise ValueError(
                f"marker_mm is {self.marker_mm}; a marker must be smaller than its square "
                f"({self.square_mm} mm)"
            )
        if self.board == "checkerboard" and sum(self.squares) % 2 == 0:
            raise ValueError(
                f"a checkerboard of {self.squares[0]} x {self.squares[1]} squares looks the same "
                "upside down; use one with an odd and an even side, or a ChArUco board"
            )
        return self


class RigRefinementConfig(StageConfig):
    """Refinement of the cameras' poses by bundle adjustment over skin and tattoo features."""

    mode: Literal["off", "auto", "on"] = Field(
        "auto",
        description="`off`: never. `auto`: only where the given poses are inaccurate and the refined ones "
        "are clearly better on held-out tracks. `on`: always; a failure is an error.",
    )
    board_calibrated: bool = Field(
        False, description="Also refine cameras that were calibrated here from a board."
    )
    frames: int = Field(
        1, ge=1, le=50, description="Frames used, evenly spaced from the first to the last (count)."
    )
    contrast: float = Field(
        0.002, gt=0, lt=0.1, description="Smallest contrast of a feature (share of the grey range)."
    )
    max_features: int = Field(
        6000, ge=100, le=50000, description="Features of one image, at most (count)."
    )
    gate_deg: float = Field(
        1.0,
        gt=0,
        le=10,
        description="Largest angle of a match to the epipolar plane of the given poses (degrees).",
    )
    fine_gate_deg: float = Field(
        0.1, gt=0, le=10, description="The same after the first adjustment of the poses (degrees)."
    )
    max_angle_deg: float = Field(
        40.0,
        gt=0,
        le=90,
        description="Largest angle between the axes of two cameras that are matched (degrees).",
    )
    ratio: float = Field(
        0.85,
        gt=0,
        le=1,
        description="Largest ratio of descriptor distances, best over second best match.",
    )
    verify_px: float = Field(
        2.0,
        gt=0,
        le=50,
        description="Largest distance at which a match agrees with its pair's essential matrix (pixels).",
    )
    min_pair: int = Field(
        15, ge=6, description="Fewest agreeing matches of a pair of cameras that is used (count)."
    )
    max_residual_px: float = Field(
        1.0,
        gt=0,
        le=20,
        description="Observations with a larger final residual are outliers (pixels).",
    )
    loss_px: float = Field(
        0.3, gt=0, le=20, description="Residual at which the robust loss becomes linear (pixels)."
    )
    patch_radius_px: int = Field(
        8,
        ge=0,
        le=30,
        description="Half the width of the surface patches that are matched by least squares in the "
        "last step (px); 0: no patches, features keep the accuracy of their detector.",
    )
    patch_residual_px: float = Field(
        0.3,
        gt=0.01,
        le=10,
        description="Patches with a larger residual are outliers (px).",
    )
    patch_loss_px: float = Field(
        0.1,
        gt=0.001,
        le=10,
        description="Residual of patches at which the robust loss turns linear (px).",
    )
    min_tracks: int = Field(
        100,
        ge=20,
        description="Fewest points seen by two cameras over which a rig is refined (count).",
    )
    min_camera_tracks: int = Field(
        30, ge=6, description="A camera with fewer observations keeps its given pose (count)."
    )
    held_out: float = Field(
        0.2,
        ge=0.05,
        le=0.5,
        description="Part of the tracks that is held out to measure the result.",
    )
    threshold_px: float = Field(
        1.0,
        ge=0,
        le=50,
        description="`auto` does not change cameras with a smaller median error (pixels).",
    )
    improvement: float = Field(
        0.7,
        gt=0,
        lt=1,
        description="Refined cameras are taken where their held-out median error is at most this part "
        "of the given cameras'.",
    )
    turn_deg: float = Field(
        0.3, gt=0, le=10, description="Expected error of a given orientation (degrees)."
    )
    shift_mm: float = Field(
        1.0,
        gt=0,
        le=100,
        description="Expected error of a given position (mm); the prior that keeps the rig's shape.",
    )
    refine_focal: bool = Field(False, description="Also adjust the focal lengths.")
    seed: int = Field(0, ge=0, description="Seed of the random samples and of the held-out tracks.")


class CaptureConfig(StageConfig):
    """Checks of captures and calibration of their cameras (Lips16 3.1)."""

    frontal_camera: str = Field(
        "face2",
        min_length=1,
        description="Camera of a multi-view take that serves as the monocular video. A rig that is "
        "calibrated from a board has the frame of this camera as its world.",
    )
    exr_layer: str = Field(
        "",
        description="Name of the layer that is the image, in EXR files of several layers (`beauty` of "
        "`beauty.R`); files of one layer are read as they are.",
    )
    colour_space: str = Field(
        "",
        description="Name of the colour space of the captures' image files, as OpenColorIO's built-in "
        "studio configuration has it (`ACEScg`, `ARRI LogC3 (EI800)`, ...); by default sRGB, and linear "
        "sRGB for EXR and HDR. Videos are read by their tags.",
    )
    confined_to: list[str] = Field(
        default_factory=list,
        description="For captures that are not trusted: folders out of which nothing may lead, neither a "
        "`source` of the take sheet (`..`, absolute, links), nor a link below one, nor a file that a USD "
        "names, nor a key that names data of captures. Empty: any path is allowed.",
    )
    manifest: ManifestConfig = section(
        ManifestConfig, "What the manifest records about the images."
    )
    calibration: CalibrationConfig = section(
        CalibrationConfig, "Calibration from images of a board."
    )
    refinement: RigRefinementConfig = section(
        RigRefinementConfig, "Refinement of the cameras' poses."
    )

    @field_validator("colour_space")
    @classmethod
    def _known_colour_space(cls, name: str) -> str:
        if name:
            check_colour_space(name)
        return name

    @property
    def reading(self) -> ImageReading:
        """How image files of captures are read."""
        return ImageReading(self.exr_layer, self.colour_space)
