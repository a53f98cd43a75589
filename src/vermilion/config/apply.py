"""Configuration of the apply stage."""

from __future__ import annotations

from pydantic import Field

from vermilion.config.base import StageConfig


class ExportConfig(StageConfig):
    """Files that other programs open."""

    obj: bool = Field(
        False, description="Also write one OBJ a frame (`obj/<frame>.obj`, millimetres)."
    )
    usd: bool = Field(
        True, description="Write `corrected.usdc` with one time sample a frame (millimetres)."
    )


class OverlayConfig(StageConfig):
    """The overlay video: original, base and corrected side by side."""

    panel_height_px: int = Field(
        480, ge=160, le=2160, description="Height of each of the three panels (pixels)."
    )
    margin: float = Field(
        0.35,
        ge=0.0,
        le=2.0,
        description="Picture left round the face, as a share of the face's size.",
    )
    opacity: float = Field(0.85, ge=0.0, le=1.0, description="Opacity of the mesh (0 to 1).")


class ApplyConfig(StageConfig):
    """Correction of ordinary video by a trained regressor (Lips16 section 6)."""

    takes: list[str] = Field(
        [],
        description="Takes to correct, each written `subject/take`. Empty: every take of role `video`.",
    )
    regressor: str = Field(
        "MS",
        pattern=r"^[A-Za-z0-9_.{}\-]+$",
        description="Regressor to apply: `MS`, `PS-{subject}` or `GR-{subject}`, where `{subject}` "
        "stands for the take's subject, or the full name of one.",
    )
    export: ExportConfig = Field(
        default_factory=ExportConfig, description="Files that other programs open."
    )
    overlay: OverlayConfig = Field(default_factory=OverlayConfig, description="The overlay video.")
