"""Configuration of the detailed sequence: corrective flow (Mono13 7) and relief (Mono13 8)."""

from __future__ import annotations

from pydantic import Field, field_validator

from vermilion.config.base import StageConfig, section


class FlowEnergyConfig(StageConfig):
    """Weights of the six-frame flow (Mono13 eq. 9) and how it is minimised."""

    smoothness: tuple[float, float, float, float, float] = Field(
        (250.0, 300.0, 150.0, 300.0, 150.0),
        description="Smoothness of the flows w1 to w5 (alpha_1 to alpha_5; colours from 0 to 255).",
    )
    similarity: float = Field(
        50.0,
        ge=0,
        description="Similarity of the corrective flows of neighbouring frames (gamma; per px squared).",
    )
    gradient_weight: float = Field(
        1.0,
        ge=0,
        le=100,
        description="Weight of gradient constancy against colour constancy (ratio).",
    )
    structure_px: float = Field(
        0.1,
        gt=0,
        le=10,
        description="Slope of a flow above which the smoothness weight falls (px per px).",
    )
    data_floor: float = Field(
        0.001,
        gt=0,
        le=10,
        description="Smaller differences are penalised by their square (display values, 0 to 255).",
    )
    warps: int = Field(3, ge=1, le=50, description="Linearisations a level (count).")
    sweeps: int = Field(
        8, ge=1, le=500, description="Sweeps of relaxation a linearisation (count)."
    )
    omega: float = Field(1.6, gt=0, lt=2, description="Over-relaxation of a sweep (factor).")


class DeformationConfig(StageConfig):
    """How far the mesh follows the flow (Mono13 eq. 14)."""

    mu: float = Field(0.5, gt=0, le=100, description="Weight of the flow against the mesh's shape.")
    spacing_px: float = Field(
        4.0,
        ge=0,
        le=100,
        description="One vertex follows the flow in each square of this side; 0: all visible vertices do "
        "(working pixels).",
    )
    pose: bool = Field(
        True,
        description="First move the head rigidly by the flow of forehead, temples and nose bridge; "
        "`false`: only the paper's motion parallel to the image.",
    )
    depth_sigma_mm: float = Field(
        3.0, gt=0, le=1000, description="Typical error of the head's distance, for `pose` (mm)."
    )


class ReliefConfig(StageConfig):
    """Fine relief from shading (Mono13 8), after the corrective flow if a take has it."""

    takes: list[str] = Field(
        default_factory=list,
        description="Takes (subject/take) of role video or tattoo that get relief; none by default.",
    )
    levels: int = Field(
        5, ge=0, le=6, description="Most subdivisions of the coarse mesh's skin (count)."
    )
    spacing_mm: float = Field(
        2.5,
        gt=0,
        le=100,
        description="Edges of the skin that are longer are halved; half the length costs fourfold (mm).",
    )
    light_frames: int = Field(
        10,
        ge=2,
        le=200,
        description="First frames, from which light, albedo and noise are estimated (count).",
    )
    face_px: int = Field(
        640,
        ge=64,
        le=4096,
        description="A larger face is scaled down to this (longer side, pixels).",
    )
    detail_mm: float = Field(
        8.0,
        gt=0,
        le=1000,
        description="Shading that changes over longer ranges is attributed to light and coarse mesh (mm).",
    )
    curvature_sigma: float = Field(
        0.06, gt=0, le=10, description="Typical curvature of the relief; less is smoother (1 / mm)."
    )
    displacement_sigma_mm: float = Field(
        0.3, gt=0, le=100, description="Typical height of the relief (mm)."
    )
    standing_share: float = Field(
        0.25,
        ge=0,
        le=1,
        description="Curvature and height of the relief that is there in all of the first frames, as a share "
        "of those that come and go: paint that never changes looks alike. 0: all of it is paint.",
    )
    noise_floor: float = Field(
        1.0,
        gt=0,
        le=255,
        description="Least noise of a triangle's value (display values).",
    )
    misplaced_mm: float = Field(
        0.5,
        ge=0,
        le=100,
        description="Typical error of a place on the skin: edges of the albedo are trusted less (mm).",
    )
    iterations: int = Field(2, ge=1, le=50, description="Gauss-Newton steps (count).")
    window: int = Field(
        5, ge=1, le=99, description="Frames over which normals are averaged, odd (count)."
    )
    position_weight: float = Field(
        0.1,
        gt=0,
        le=100,
        description="Weight of positions against normals when the two are combined (1 / mm).",
    )
    map_px: int = Field(1024, ge=16, le=8192, description="Side of the normal maps (pixels).")
    overlay_frames: int = Field(
        2, ge=1, le=100, description="Frames of a chunk in its overlay image (count)."
    )

    @field_validator("window")
    @classmethod
    def _odd(cls, window: int) -> int:
        if window % 2 == 0:
            raise ValueError("the window must be odd: it is centred on a frame")
        return window


class DetailConfig(StageConfig):
    """The detailed sequence, in `detail/` of a take."""

    takes: list[str] = Field(
        default_factory=list,
        description="Takes (subject/take) of role video or tattoo that are refined; none by default.",
    )
    face_px: int = Field(
        480,
        ge=64,
        le=4096,
        description="A larger face is scaled down to this for the flow (longer side, pixels).",
    )
    flow: FlowEnergyConfig = section(FlowEnergyConfig, "The corrective flow (Mono13 7.1).")
    deformation: DeformationConfig = section(
        DeformationConfig, "The mesh after the flow (Mono13 7.2)."
    )
    relief: ReliefConfig = section(ReliefConfig, "Fine relief from shading (Mono13 8).")
    overlay_frames: int = Field(
        4, ge=1, le=100, description="Frames of a chunk in its overlay image (count)."
    )
