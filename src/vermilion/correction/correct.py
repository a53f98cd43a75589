"""Corrected meshes of a take: one path for evaluation, application, propagation and the oracle.

    corrected_mm = correct(model, take, settings)  # (F, V, 3), world

A frame that is not usable (`CoarseTake.usable`) keeps its coarse mesh. The others are taken to the head
frame, corrected there by the integration of layers, made to agree with their image, and taken back. To
correct several stretches of one person with one factorisation, use one `Corrector`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.coherence import smoothed_over_time
from vermilion.correction.image_agreement import ImageAgreement, ImageAgreementSettings
from vermilion.correction.integration import LayerIntegrator
from vermilion.geometry.head_frame import head_from_world, world_from_head
from vermilion.regression.model import LipModel


@dataclass(frozen=True)
class CorrectionSettings:
    """How a take is corrected.

    Attributes:
        seam_mm: width of the soft ring outside the mask.
        detail_mm: detail finer than this comes from layers, the rest from displacements; 0: layers alone.
        smooth_frames: frames to either side that the regressed layers are smoothed over; 0: none.
        fade_power: outside the training's span what is regressed fades to the training's mean, by this power
            of the span over the frame's novelty; 0: it does not.
        image: agreement with the image; None: none, as in the paper.
    """

    seam_mm: float
    detail_mm: float
    smooth_frames: int
    fade_power: float
    image: ImageAgreementSettings | None

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> CorrectionSettings:
        """From plain values, those of the image in a mapping below (`CorrectionConfig.at`)."""
        return cls(**{**values, "image": ImageAgreementSettings(**values["image"])})

    def as_in_the_paper(self) -> CorrectionSettings:
        """Without the image, which Lips16 leaves to future work, each frame by itself."""
        return replace(self, smooth_frames=0, fade_power=0.0, image=None)


def correct(model: LipModel, take: CoarseTake, settings: CorrectionSettings) -> np.ndarray:
    """Meshes of a take corrected by a regressor.

    Returns:
        (F, V, 3) float64, world, mm; coarse where a frame is not usable.

    Raises:
        ModelFileError: the mesh is not the one that the regressor was trained on.
    """
    return Corrector(model, take, settings).correct(take)


def correct_with_layers(
    mask: np.ndarray,
    layers: np.ndarray,
    displacement_mm: np.ndarray | None,
    take: CoarseTake,
    settings: CorrectionSettings,
) -> np.ndarray:
    """Meshes of a take corrected by known layers (the oracle), (F, V, 3) float64, world, mm.

    Args:
        mask: (T,) triangle ids of the layers.
        layers: (F, T, 9), head frame.
        displacement_mm: (F, N, 3) of the mask's corners, head frame; needed where `detail_mm` is not 0.
        take: its `valid` says which frames have layers.
    """
    integrator = LayerIntegrator(
        take.neutral_mm, take.triangles, mask, settings.seam_mm, settings.detail_mm
    )
    rows = take.usable(layers)
    targets_mm = None if displacement_mm is None else displacement_mm[rows]
    head_mm = integrator.integrate(_in_head(take[rows]), layers[rows], targets_mm)
    return _in_world(take, rows, head_mm, _agreement(integrator, take, settings))


class Corrector:
    """A regressor bound to a person's mesh: factors once, corrects any number of frames.

    Args:
        model: the regressor.
        take: of the person; its frames do not matter.
        settings: how takes are corrected.

    Raises:
        ModelFileError: the mesh is not the one that the regressor was trained on.
    """

    def __init__(self, model: LipModel, take: CoarseTake, settings: CorrectionSettings):
        model.check_topology(take.triangles)
        detail_mm = settings.detail_mm if len(model.vertices) else 0.0
        self.model, self.neutral_mm, self.settings = model, take.neutral_mm, settings
        self.integrator = LayerIntegrator(
            take.neutral_mm, take.triangles, model.mask, settings.seam_mm, detail_mm
        )
        layers, displacements_mm = model.basis(np.asarray(take.neutral_mm, dtype=np.float64))
        self._basis = np.ascontiguousarray(layers.T, dtype=np.float32)
        self._places = self.integrator.weighted_places(displacements_mm) if detail_mm else None
        self._agreement = _agreement(self.integrator, take, settings)

    def correct(self, take: CoarseTake) -> np.ndarray:
        """Corrected meshes (F, V, 3) float64, world, mm, of a take of the same person."""
        rows = take.usable(take.features)
        usable = take[rows]
        head_mm = self.correct_heads(_in_head(usable), usable.features, usable.frames_apart)
        return _in_world(take, rows, head_mm, self._agreement)

    def correct_heads(
        self, coarse_mm: np.ndarray, features: np.ndarray, frames: np.ndarray
    ) -> np.ndarray:
        """Corrected meshes (F, V, 3) float64, head frame, mm, without the image.

        Args:
            coarse_mm: (F, V, 3) head frame, finite.
            features: (F, M), finite.
            frames: (F,) frame numbers, ascending.
        """
        mixture = self._within_span(features)
        mixture = smoothed_over_time(mixture, frames, self.settings.smooth_frames)
        mixture = np.concatenate([mixture, np.ones((len(mixture), 1))], axis=1)
        return self.integrator.integrate_mixture(coarse_mm, mixture, self._basis, self._places)

    def _within_span(self, features: np.ndarray) -> np.ndarray:
        """The model's mixture (F, R) of features (F, M), faded to the training's mean outside the training's span."""
        mixture = self.model.mixture(features, self.neutral_mm)
        limit = self.model.novelty_limit
        if self.settings.fade_power == 0 or not np.isfinite(limit):
            return mixture
        novelty = self.model.novelty(features, self.neutral_mm)[:, None]
        counts = np.minimum(1.0, limit / np.maximum(novelty, 1e-9)) ** self.settings.fade_power
        mean = self.model.estimator.mean_mixture()
        return mean + counts * (mixture - mean)


def _agreement(
    integrator: LayerIntegrator, take: CoarseTake, settings: CorrectionSettings
) -> ImageAgreement | None:
    """What makes meshes of a person agree with their images; None where nothing asks for it."""
    if take.image is None or settings.image is None or not settings.image.used:
        return None
    n_samples = take.image.outer_px.shape[1]
    return ImageAgreement(integrator, take.neutral_mm, take.image.face, n_samples, settings.image)


def _in_head(take: CoarseTake) -> np.ndarray:
    return head_from_world(take.coarse_mm, take.rotation, take.translation_mm)


def _in_world(
    take: CoarseTake, rows: np.ndarray, head_mm: np.ndarray, agreement: ImageAgreement | None
) -> np.ndarray:
    """The coarse meshes (F, V, 3), those at `rows` (F,) bool replaced by corrected ones, head frame."""
    corrected_mm, usable = np.array(take.coarse_mm, dtype=np.float64), take[rows]
    if agreement is None or usable.image is None:
        corrected_mm[rows] = world_from_head(head_mm, usable.rotation, usable.translation_mm)
    else:
        corrected_mm[rows] = agreement.fit(head_mm, usable, usable.image)
    return corrected_mm
