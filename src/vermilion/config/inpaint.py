"""Configuration of the removal of the lip tattoo (Lips16 3.2.1)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section


class DomainConfig(StageConfig):
    """The patch of the lips in texture space."""

    texel_mm: float = Field(
        0.2, ge=0.05, le=1.0, description="Edge of a texel on the neutral face (mm)."
    )
    skin_mm: float = Field(
        14.0,
        ge=6.0,
        le=40.0,
        description="Width of the texture's margin of skin around the lips (mm).",
    )
    inner_mm: float = Field(
        6.0,
        ge=0.0,
        le=20.0,
        description="Depth of the texture inside the mouth, past the vermilion (mm).",
    )
    edge_mm: float = Field(
        0.8,
        ge=0.0,
        le=5.0,
        description="Surface closer than this to an occluding contour is not sampled (mm); about the "
        "error of the meshes.",
    )


class MaskConfig(StageConfig):
    """Where the tattoo is: the tattooed neutral compared with the plain one."""

    reach_mm: float = Field(
        4.0,
        ge=0.0,
        le=20.0,
        description="Largest distance of the tattoo from the vermilion (mm).",
    )
    sensitivity: float = Field(
        6.0,
        ge=1.0,
        le=50.0,
        description="Colour differences of more than this many deviations of bare skin are tattoo.",
    )
    closing_mm: float = Field(
        1.5, ge=0.0, le=10.0, description="Narrower gaps of the pattern are painted too (mm)."
    )
    border_mm: float = Field(
        0.6, ge=0.0, le=5.0, description="Margin around the tattoo that is painted in full (mm)."
    )
    feather_mm: float = Field(
        1.0, ge=0.0, le=10.0, description="Width of the soft border outside that margin (mm)."
    )


class ShadingConfig(StageConfig):
    """How the shading of a frame is transferred to the plain texture."""

    mode: Literal["ratio", "difference", "none"] = Field(
        "ratio",
        description="Change from the reference pose to a frame: `ratio` of intensities, `difference` "
        "(Lips16 as written), or `none`.",
    )
    sigma_mm: float = Field(
        2.0, ge=0.2, le=20.0, description="Gaussian low-pass of that change (mm)."
    )
    border_mm: float = Field(
        2.0, ge=0.2, le=20.0, description="Gaussian low-pass of the match to the bare skin (mm)."
    )
    gap_mm: float = Field(
        1.0,
        ge=0.0,
        le=5.0,
        description="Skin closer than this to the painted region is not used for the match (mm).",
    )
    limit: float = Field(
        2.5,
        ge=1.0,
        le=10.0,
        description="Largest gain of the shading; its inverse is the smallest.",
    )
    seam_mm: float = Field(
        1.0,
        ge=0.0,
        le=5.0,
        description="Near the seam of the lips, shading is averaged along the inner contours up to this "
        "distance from them (mm; `ratio` only; 0: nowhere).",
    )
    seam_along_mm: float = Field(
        4.0, ge=0.5, le=20.0, description="Gaussian average along the inner contours (mm)."
    )


class OpeningConfig(StageConfig):
    """The mouth opening: inner contours of the mesh, corrected by the image."""

    reach_mm: float = Field(
        2.5,
        ge=0.0,
        le=10.0,
        description="Largest correction of a contour (mm); 0: none.",
    )
    step_mm: float = Field(
        0.12, ge=0.02, le=1.0, description="Step of the search (mm); at least half a pixel."
    )
    clear_mm: float = Field(
        1.0,
        ge=0.0,
        le=5.0,
        description="Lips closer than this to the mesh's contour are not samples of the tattoo's colours (mm).",
    )
    inside_mm: float = Field(
        0.3,
        ge=0.0,
        le=5.0,
        description="Pixels of the opening closer than this to the mesh's contour are not samples of the "
        "colours inside the mouth (mm).",
    )
    black: float = Field(
        0.2,
        ge=0.01,
        le=10.0,
        description="Weight of black among the colours inside the mouth, relative to the samples.",
    )
    teeth: float = Field(
        0.3, ge=0.0, le=10.0, description="Weight of the colours of teeth, relative to the samples."
    )
    unlike: float = Field(
        0.2, ge=0.001, le=0.9, description="Share of the inside that may have any colour (0 to 1)."
    )
    sure: float = Field(
        4.0,
        ge=0.5,
        le=20.0,
        description="Largest logarithm of a likelihood ratio that counts in full.",
    )
    prior: float = Field(
        1.0,
        ge=0.0,
        le=1000.0,
        description="Cost of a contour at 1 mm from the mesh's (points of the search).",
    )
    smooth: float = Field(
        0.6, ge=0.0, le=100.0, description="Cost of a bend by one point (points of the search)."
    )


class CompositeConfig(StageConfig):
    """How the texture is rendered into a frame."""

    samples: int = Field(3, ge=1, le=8, description="Rays a pixel, along each side (count).")
    lens_px: float = Field(
        0.4, ge=0.0, le=5.0, description="Blur of the camera: deviation of a Gaussian (pixels)."
    )
    rim_px: float = Field(
        1.0,
        ge=0.0,
        le=10.0,
        description="Pixels of the mouth opening within this distance of the lips are corrected for the "
        "tattoo's colour that lens blur mixed in (pixels).",
    )
    grain: bool = Field(True, description="Add the noise that the image has and the texture lacks.")
    seed: int = Field(0, ge=0, description="Seed of that noise.")


class InpaintConfig(StageConfig):
    """Removal of the lip tattoo (Lips16 3.2.1)."""

    domain: DomainConfig = section(DomainConfig, "The patch of the lips in texture space.")
    mask: MaskConfig = section(MaskConfig, "Where the tattoo is.")
    shading: ShadingConfig = section(ShadingConfig, "How shading is transferred.")
    opening: OpeningConfig = section(OpeningConfig, "The mouth opening.")
    composite: CompositeConfig = section(
        CompositeConfig, "How the texture is rendered into a frame."
    )
