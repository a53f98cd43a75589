"""Configuration of the correction layer and of its integration."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import Field

from vermilion.config.base import StageConfig, section

#: Frames to either side that count, per `coherence_s` in frames: one for the unfolding, the rest for the solve.
_COHERENCE_REACH = 3
#: Frames to either side at most: what the solve takes grows with their square, and so many still the noise.
_MOST_COHERENT = 12


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
        description="Region by which the accurate mesh is aligned. `face`: the face outside the mask, "
        "weighted by area, as the evaluation aligns. `rigid`: forehead, temples and bridge of the nose, "
        "without outliers; errors of the tracker in the whole face then stay in the corrected mesh.",
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
        description="Width of the ring outside the mask that may deform, so that the border shows no "
        "crease (mm); 0: everything outside is fixed.",
    )
    detail_mm: float = Field(
        15.0,
        ge=0.0,
        le=1000.0,
        description="Finer detail than this comes from the layers, coarser shape from regressed "
        "displacements (mm). 0: layers alone, as in the paper.",
    )
    smooth_s: float = Field(
        0.1,
        ge=0.0,
        le=1.0,
        description="Half the window of a symmetric quadratic filter over the regressed values (seconds; 3 "
        "frames at 30 a second, none below 20). It removes per-frame noise without lag. 0: no filter, as "
        "in the paper.",
    )
    fade_power: float = Field(
        4.0,
        ge=0.0,
        le=20.0,
        description="Outside the training's span (`novelty` above its limit) what is regressed fades to the "
        "training's mean: it counts by this power of limit over novelty. `training.reach` does so by each "
        "feature's range, this by all features together. 0: no fade, as in the paper.",
    )

    def at(self, fps: float) -> dict[str, float | int]:
        """Arguments of the integration: `seam_mm`, `detail_mm`, `smooth_frames`, `fade_power`."""
        frames = round(self.smooth_s * fps)
        return {
            "seam_mm": self.seam_mm,
            "detail_mm": self.detail_mm,
            "smooth_frames": frames if frames > 1 else 0,
            "fade_power": self.fade_power,
        }


class ImageAgreementConfig(StageConfig):
    """How the corrected mesh is made to agree with the image (not in the paper)."""

    repose: bool = Field(
        True,
        description="Align the corrected head with the image again: rigidly, by its lip contours, brows "
        "and eyes. Otherwise correct lips on a coarse face of other proportions miss the image's lips.",
    )
    repose_frames: float = Field(
        3.0,
        ge=0.0,
        le=30.0,
        description="Deviation of the Gaussian filter over time of that motion (frames); it does not lag. "
        "0: no filter.",
    )
    contour_weight: float = Field(
        3.0,
        ge=0.0,
        le=1000.0,
        description="Weight, per millimetre of lip contour, of the constraint that it projects onto the "
        "contour found in the image. 0: no constraint.",
    )
    bending_mm: float = Field(
        4.0,
        ge=0.0,
        le=100.0,
        description="Where contours and contact move the lips, they bend as a plate over shorter lengths "
        "than this and stretch as a membrane over longer ones (mm). 0: a membrane alone, which every "
        "contour point pulls to a tip.",
    )
    contour_robust_mm: float = Field(
        2.5,
        gt=0.0,
        le=100.0,
        description="A contour point at this distance from the mesh's contour counts half (mm).",
    )
    coherence_s: float = Field(
        0.2,
        ge=0.0,
        le=1.0,
        description="What contours and contact do to the lips resembles what they do to frames this near "
        "(seconds; at most 12 frames), and the nearer the more: the lips do not tremble, and nothing "
        "comes late. 0: each frame by itself.",
    )
    contact: bool = Field(
        True,
        description="Lips never pass through each other.",
    )
    folded_deg: float = Field(
        120.0,
        gt=0.0,
        lt=180.0,
        description="Two neighbouring triangles of one lip are folded where their normals are further apart "
        "than this (degrees); folds are taken out, and `flipped_rate` and `quality.tsv` count those left.",
    )
    crease_deg: float = Field(
        90.0,
        gt=0.0,
        lt=180.0,
        description="They are not folded where the base track's normals are further apart than this "
        "(degrees): a crease of its own.",
    )

    def at(self, fps: float) -> dict[str, Any]:
        """Plain values of `correction.image_agreement.ImageAgreementSettings` for a take of `fps` a second."""
        return {
            **self.model_dump(exclude={"coherence_s"}),
            "coherence_frames": self._coherence_frames(fps),
        }

    def reach_frames(self, fps: float) -> int:
        """Frames to either side whose corrected meshes the result of a frame depends on."""
        repose = math.ceil(3 * self.repose_frames) if self.repose else 0
        # A frame within the coherence depends on others in turn; twice as far off that is nothing.
        return repose + _COHERENCE_REACH * self._coherence_frames(fps)

    def _coherence_frames(self, fps: float) -> int:
        return min(round(self.coherence_s * fps), _MOST_COHERENT)


class CorrectionConfig(StageConfig):
    """The correction layer (Lips16 4.2)."""

    layers: LayersConfig = section(LayersConfig, "Making layers.")
    integration: IntegrationConfig = section(IntegrationConfig, "Applying layers.")
    image: ImageAgreementConfig = section(ImageAgreementConfig, "Agreeing with the image.")
    neutral_frames: dict[str, int] = Field(
        default_factory=dict,
        description="`subject/take: frame` for videos that have a frame of the neutral with which the "
        "person's rig takes begin (mouth slightly open). It gives the track's error in this take.",
    )

    def at(self, fps: float) -> dict[str, Any]:
        """Plain values of `correction.correct.CorrectionSettings` for a take of `fps` a second."""
        return {**self.integration.at(fps), "image": self.image.at(fps)}

    def reach_frames(self, fps: float) -> int:
        """Frames to either side whose features the result of a frame depends on."""
        return self.image.reach_frames(fps) + int(self.integration.at(fps)["smooth_frames"])
