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
        description="How far the texture reaches onto the skin round the lips (mm).",
    )
    inner_mm: float = Field(
        6.0, ge=0.0, le=20.0, description="How far it reaches inside the mouth, past the red (mm)."
    )
    edge_mm: float = Field(
        0.8,
        ge=0.0,
        le=5.0,
        description="Surface closer than this to an occluding contour is not sampled (mm): about "
        "the error of the meshes.",
    )


class MaskConfig(StageConfig):
    """Where the tattoo is: the tattooed neutral compared with the plain one."""

    reach_mm: float = Field(
        4.0,
        ge=0.0,
        le=20.0,
        description="The tattoo is looked for up to this far from the red of the lips (mm).",
    )
    sensitivity: float = Field(
        6.0,
        ge=1.0,
        le=50.0,
        description="Colour differences of more than this many deviations of bare skin are tattoo.",
    )
    closing_mm: float = Field(
        1.5, ge=0.0, le=10.0, description="Gaps of the pattern narrower than this are painted (mm)."
    )
    border_mm: float = Field(
        0.6, ge=0.0, le=5.0, description="Margin painted in full round the tattoo (mm)."
    )
    feather_mm: float = Field(
        1.0, ge=0.0, le=10.0, description="Width of the soft border outside that margin (mm)."
    )


class ShadingConfig(StageConfig):
    """How the shading of a frame is carried over to the plain texture."""

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
        description="Skin closer than this to the painted region is not compared with (mm).",
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
        description="Next to where the lips meet, shading is read along the inner contours, up to this "
        "far from them (mm; `ratio` only, 0: not).",
    )
    seam_along_mm: float = Field(
        4.0, ge=0.5, le=20.0, description="Gaussian average along the inner contours (mm)."
    )


class OpeningConfig(StageConfig):
    """Where the mouth opens: the contours of the mesh, corrected by what the image shows."""

    reach_mm: float = Field(
        2.5,
        ge=0.0,
        le=10.0,
        description="Furthest correction of a contour (mm); 0: the mesh's own.",
    )
    step_mm: float = Field(
        0.12, ge=0.02, le=1.0, description="Step of that search (mm), half a pixel at least."
    )
    clear_mm: float = Field(
        1.0,
        ge=0.0,
        le=5.0,
        description="Lips closer than this to the mesh's contour do not teach the tattoo's colours (mm).",
    )
    inside_mm: float = Field(
        0.3,
        ge=0.0,
        le=5.0,
        description="The opening closer than this to the mesh's contour does not teach the colours of "
        "the mouth's inside (mm).",
    )
    black: float = Field(
        0.2, ge=0.01, le=10.0, description="Weight of black among those colours (theirs: 1)."
    )
    teeth: float = Field(
        0.3, ge=0.0, le=10.0, description="Weight of the colours of teeth among them (theirs: 1)."
    )
    unlike: float = Field(
        0.2, ge=0.001, le=0.9, description="Share of the inside that may have any colour (0 to 1)."
    )
    sure: float = Field(
        4.0, ge=0.5, le=20.0, description="Logarithm of a ratio of likelihoods that counts in full."
    )
    prior: float = Field(
        1.0,
        ge=0.0,
        le=1000.0,
        description="Cost of a contour one millimetre off the mesh's (points of the search).",
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
        description="Pixels of the mouth opening this close to the lips are freed of the tattoo that "
        "the lens mixed into them (pixels).",
    )
    grain: bool = Field(True, description="Add the noise that the image has and the texture lacks.")
    seed: int = Field(0, ge=0, description="Seed of that noise.")


class InpaintConfig(StageConfig):
    """Removal of the lip tattoo (Lips16 3.2.1)."""

    domain: DomainConfig = section(DomainConfig, "The patch of the lips in texture space.")
    mask: MaskConfig = section(MaskConfig, "Where the tattoo is.")
    shading: ShadingConfig = section(ShadingConfig, "How shading is carried over.")
    opening: OpeningConfig = section(OpeningConfig, "Where the mouth opens.")
    composite: CompositeConfig = section(
        CompositeConfig, "How the texture is rendered into a frame."
    )
