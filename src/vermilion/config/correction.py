"""Configuration of the correction layer and of its integration."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section


class LayersConfig(StageConfig):
    """Layers of the takes with an accurate mesh (Lips16 4.2)."""

    head: Literal["frame", "neutral"] = Field(
        "frame",
        description="How the accurate mesh is brought into the coarse mesh's head frame. `frame`: "
        "aligned to the coarse mesh on the rigid region in every frame. `neutral`: its own head "
        "motion removed on that region, then aligned to the coarse mesh once, at the neutral.",
    )
    region: Literal["rigid", "face"] = Field(
        "face",
        description="What the accurate mesh is aligned by. `face`: all of the face outside the mask, by "
        "area, as the evaluation aligns. `rigid`: forehead, temples and bridge of the nose, as far as they "
        "fit; what the tracker gets wrong of the face as a whole then stays in the corrected mesh.",
    )
    max_alignment_mm: float = Field(
        6.0,
        gt=0.0,
        le=50.0,
        description="A frame is flagged where the aligned regions differ by more (RMS, mm).",
    )


class IntegrationConfig(StageConfig):
    """From layers to vertices: deformation transfer (Sumner and Popovic 2004)."""

    seam_mm: float = Field(
        16.0,
        ge=0.0,
        le=50.0,
        description="Width of the ring outside the mask that may give way, so that the border shows "
        "no crease (mm); 0 fixes everything outside.",
    )
    detail_mm: float = Field(
        15.0,
        ge=0.0,
        le=1000.0,
        description="Detail finer than this comes from the layers, the place of the mesh over longer "
        "ranges from regressed displacements (mm). 0: layers alone, as in the paper.",
    )
    smooth_s: float = Field(
        0.1,
        ge=0.0,
        le=1.0,
        description="What is regressed for a frame is the middle of a parabola fitted over so many seconds "
        "to either side (3 frames at 30 a second, none below 20): noise of single frames goes, nothing "
        "comes late. 0: every frame for itself, as in the paper.",
    )

    def at(self, fps: float) -> dict[str, float | int]:
        """Arguments of the integration of a take: `seam_mm`, `detail_mm`, `smooth_frames`."""
        frames = round(self.smooth_s * fps)
        return {
            "seam_mm": self.seam_mm,
            "detail_mm": self.detail_mm,
            "smooth_frames": frames if frames > 1 else 0,
        }


class ImageAgreementConfig(StageConfig):
    """How the corrected mesh is made to agree with the image. None of it is in the paper."""

    repose: bool = Field(
        True,
        description="Lay the corrected head on the image again: rigidly, by its lip contours, brows "
        "and eyes. Without, true lips beside a coarse face of other proportions miss the image's.",
    )
    repose_frames: float = Field(
        3.0,
        ge=0.0,
        le=30.0,
        description="Deviation of the filter over time of that motion; symmetric, so without lag "
        "(frames). 0: every frame for itself.",
    )
    contour_weight: float = Field(
        1.0,
        ge=0.0,
        le=1000.0,
        description="Weight of a millimetre of lip contour, as a constraint that it projects on the one "
        "found in the image, beside the stiffness of the mesh. 0: none.",
    )
    contour_robust_mm: float = Field(
        2.5,
        gt=0.0,
        le=100.0,
        description="A contour point this far beside the mesh's contour counts half, farther ones less (mm).",
    )
    closed: float = Field(
        0.012,
        ge=0.0,
        le=0.2,
        description="The lips touch where the inner contour in the image is lower than this, per "
        "distance between the outer corners of the eyes (about 1 mm).",
    )
    contact: bool = Field(
        True,
        description="Lips that touch in the image meet in the mesh (by `contour_weight`), and never pass "
        "through each other.",
    )

    @property
    def reach_frames(self) -> int:
        """Frames to either side whose corrected meshes the result of a frame depends on."""
        return math.ceil(3 * self.repose_frames) if self.repose else 0


class CorrectionConfig(StageConfig):
    """The correction layer (Lips16 4.2)."""

    layers: LayersConfig = section(LayersConfig, "Making layers.")
    integration: IntegrationConfig = section(IntegrationConfig, "Applying layers.")
    image: ImageAgreementConfig = section(ImageAgreementConfig, "Agreeing with the image.")
    neutral_frames: dict[str, int] = Field(
        default_factory=dict,
        description="Videos with a frame of the neutral that the person's rig takes begin with (mouth "
        "slightly open, as there): `subject/take: frame`. It tells how the track errs in this take.",
    )

    def reach_frames(self, fps: float) -> int:
        """Frames to either side whose features the result of a frame depends on."""
        return self.image.reach_frames + int(self.integration.at(fps)["smooth_frames"])
