"""Configuration of the studio: synthetic captures that stand in for a real rig."""

from __future__ import annotations

from typing import Literal, get_args

from pydantic import Field, model_validator

from vermilion.config.base import StageConfig

RigCamera = Literal[
    "face0", "face1", "face2", "face3", "face4", "face5", "lip0", "lip1", "lip2", "lip3"
]


class StudioTake(StageConfig):
    """How one take of the studio is performed and lit. Its role comes from the take sheet."""

    performance: Literal["generated", "live_link", "people"] = Field(
        "generated",
        description="`generated`: curves made from the seed. `live_link`: a Live Link Face CSV. "
        "`people`: every frame another random person, expression and light, with landmark labels "
        "(to train the embedded landmark regressor).",
    )
    seed: int = Field(0, ge=0, description="Seed of the curves and of the head motion.")
    poses: int = Field(
        0,
        ge=0,
        le=100,
        description="`generated` only: number of different mouth poses that the curves repeat (0: all, "
        "more than twenty). Few poses suit short takes.",
    )
    pose_seconds: tuple[float, float] = Field(
        (0.22, 0.42),
        description="`generated` only: shortest and longest transition into a pose (s).",
    )
    csv: str | None = Field(
        None, description="`live_link` only: the CSV file with ARKit weights, one row a frame."
    )
    csv_first: int = Field(0, ge=0, description="`live_link` only: first row used (frame number).")
    csv_fps: float = Field(
        30.0, gt=0, description="`live_link` only: rate of the rows (frames a second)."
    )
    mirrored: bool = Field(
        False, description="`live_link` only: the recording's left and right are exchanged."
    )
    gain: float = Field(
        1.0,
        gt=0,
        le=2,
        description="`live_link` only: factor of the recorded weights (1), which stay between 0 and 1.",
    )
    camera_distance_mm: float | None = Field(
        None,
        gt=200,
        le=5000,
        description="Distance of the take's cameras from the face (mm); empty: that of all takes.",
    )
    video_view_mm: float | None = Field(
        None,
        gt=50,
        le=1000,
        description="Height that the video camera sees at the face (mm); empty: that of all takes.",
    )
    head_turn_deg: float | None = Field(
        None,
        ge=0,
        le=30,
        description="Largest turn of the head in the take (degrees); empty: that of all takes.",
    )
    head_shift_mm: float | None = Field(
        None,
        ge=0,
        le=30,
        description="Largest shift of the head in the take (mm); empty: that of all takes.",
    )
    video_size_px: tuple[int, int] | None = Field(
        None,
        description="Width and height of the take's images, of `video` takes only (px); empty: those of all takes.",
    )
    lights: Literal["rig", "room", "window"] = Field(
        "rig",
        description="`rig`: even light of a capture rig. `room`: lamps above and at one side. "
        "`window`: strong light from one side.",
    )

    @model_validator(mode="after")
    def _check_together(self) -> StudioTake:
        if self.performance == "live_link" and not self.csv:
            raise ValueError("performance is 'live_link' but csv is empty; name the CSV file")
        if not 0 < self.pose_seconds[0] <= self.pose_seconds[1]:
            raise ValueError("pose_seconds must be two rising times above 0 s")
        return self


class StudioSubject(StageConfig):
    """A synthetic actor."""

    seed: int = Field(0, ge=0, description="Seed of the actor's shape and skin.")
    identity: list[float] | None = Field(
        None,
        description="Identity coefficients (standard deviations); empty: drawn from the seed.",
    )
    takes: dict[str, StudioTake] = Field(
        default_factory=dict,
        description="How each take is performed, by take name; takes not named have the defaults.",
    )


class StudioConfig(StageConfig):
    """Actors, their performances, the cameras and the light."""

    subjects: dict[str, StudioSubject] = Field(
        default_factory=dict, description="The synthetic actors, by subject name."
    )
    identity_spread: float = Field(
        0.7,
        ge=0,
        le=2,
        description="Deviation of drawn identity coefficients (standard deviations).",
    )
    expression_spread: float = Field(
        0.0,
        ge=0,
        le=2,
        description="How far each actor's expressions are their own: gain, direction and a smooth field for "
        "each shape (0: those of the face model; 1: as different as people are).",
    )
    cameras: list[RigCamera] = Field(
        list(get_args(RigCamera)),
        description="Cameras of the rig: `face0` to `face5` from right to left, of which the frontal pair, "
        "`face2` and `face3`, cannot be left out; `lip0` and `lip1` from above, `lip2` and `lip3` from below.",
    )
    face_size_px: tuple[int, int] = Field(
        (512, 512), description="Width and height of the six face cameras' images (px)."
    )
    lip_size_px: tuple[int, int] = Field(
        (512, 512), description="Width and height of the four lip cameras' images (px)."
    )
    video_size_px: tuple[int, int] = Field(
        (640, 480), description="Width and height of `video` takes' images (px)."
    )
    face_view_mm: float = Field(
        245.0, gt=50, le=1000, description="Height that a face camera sees at the face (mm)."
    )
    lip_view_mm: float = Field(
        105.0, gt=30, le=500, description="Height that a lip camera sees at the lips (mm)."
    )
    video_view_mm: float = Field(
        250.0, gt=50, le=1000, description="Height that a video camera sees at the face (mm)."
    )
    video_calibration: bool = Field(
        True,
        description="Whether videos come with their camera. Off: it lies with the truth, and the tracker has to "
        "estimate the focal length.",
    )
    camera_distance_mm: float = Field(
        735.0, gt=200, le=5000, description="Distance of the cameras from the face (mm)."
    )
    slight_open: float = Field(
        0.08,
        ge=0,
        le=0.3,
        description="Weight of jawOpen in the first frame of every take, so that the lips part "
        "(0 to 1).",
    )
    ease_in_frames: int = Field(
        6, ge=1, le=60, description="Frames from the neutral into the performance (frames)."
    )
    intensity: float = Field(
        1.0, gt=0, le=1.5, description="Scale of generated expressions (1: full weights)."
    )
    head_turn_deg: float = Field(
        2.5, ge=0, le=30, description="Largest turn of the head during a take (degrees)."
    )
    head_shift_mm: float = Field(
        2.0, ge=0, le=30, description="Largest shift of the head during a take (mm)."
    )
    occlusion_directions: int = Field(
        192,
        ge=32,
        le=4096,
        description="Directions of the sky that ambient occlusion samples (rays a vertex, half of "
        "them above its horizon).",
    )
    light_samples: int = Field(
        12, ge=1, le=256, description="Points sampled on each area light (rays a vertex)."
    )
    edge_samples: int = Field(
        4, ge=1, le=16, description="Rays a pixel where an edge crosses it (anti-aliasing)."
    )
    noise_read: float = Field(
        0.0012, ge=0, le=0.1, description="Deviation of the sensor's read noise (linear, 0 to 1)."
    )
    noise_shot: float = Field(
        0.00003,
        ge=0,
        le=0.01,
        description="Variance of the sensor's shot noise at full brightness (linear, squared).",
    )
    contour_labels: int = Field(
        6, ge=0, le=1000, description="Labelled contour frames of a take (frames)."
    )
    seed: int = Field(0, ge=0, description="Seed that is combined with all other seeds.")

    def take_of(self, subject: str, take: str) -> StudioTake:
        """How a take is performed: its section, or the defaults."""
        actor = self.subjects.get(subject)
        own = None if actor is None else actor.takes.get(take)
        return StudioTake.model_validate({}) if own is None else own

    @model_validator(mode="after")
    def _check_cameras(self) -> StudioConfig:
        if len(set(self.cameras)) < len(self.cameras):
            raise ValueError(f"cameras names a camera twice: {', '.join(self.cameras)}")
        missing = [name for name in ("face2", "face3") if name not in self.cameras]
        if missing:
            raise ValueError(
                f"cameras lacks {' and '.join(missing)} of the frontal pair, which carries the labels; add it"
            )
        return self
