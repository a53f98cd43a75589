"""Corrected meshes of a take: the interface for evaluation, application and propagation.

    corrected = correct_sequence(model, coarse_mm, triangles, neutral_mm, rotation, translation_mm,
                                 features, valid=valid, seam_mm=16.0, detail_mm=15.0,
                                 smooth_frames=3)  # (F, V, 3), mm

`model` is what `vermilion.regression.model.load_model` reads; `coarse_mm` (F, V, 3) is the tracker's
**C** in the world; `rotation` (F, 3, 3) and `translation_mm` (F, 3) are its `world_from_head`;
`neutral_mm` (V, 3) is the subject's coarse neutral (`identity.npz: neutral_mm`): it sets the weights
of the integration, and by it the regressor knows a person of its training again; `features` (F, M) are
those of the take. With `smooth_frames` what is regressed is made coherent over time (`coherence`).
For known layers and displacements (the oracle):

    corrected = correct_with_layers(mask, layers, coarse_mm, triangles, neutral_mm, rotation,
                                    translation_mm, valid=valid, seam_mm=16.0,
                                    displacement_mm=displacement_mm, detail_mm=15.0)

Where `valid` is False, or the features are not finite, the coarse mesh is returned as it is. To
correct several stretches of one person, use one `Corrector`. With a `image` (`ImageContours`, of the same
frames) the corrected heads are laid on it and their lips made to agree with it: see `image_fit`.
"""

from __future__ import annotations

import numpy as np

from vermilion.correction.coherence import smoothed_over_time
from vermilion.correction.image_agreement import ImageAgreement
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.integration import LayerIntegrator
from vermilion.geometry.head_frame import head_from_world, world_from_head
from vermilion.regression.model import LipModel


class Corrector:
    """A regressor bound to a person's mesh: factors once, corrects any number of frames."""

    def __init__(
        self,
        model: LipModel,
        neutral_mm: np.ndarray,
        triangles: np.ndarray,
        seam_mm: float = 16.0,
        detail_mm: float = 0.0,
        smooth_frames: int = 0,
    ):
        model.check_topology(triangles)
        self.model, self.neutral_mm, self.smooth_frames = model, neutral_mm, smooth_frames
        detail_mm = detail_mm if len(model.vertices) else 0.0
        self.integrator = LayerIntegrator(neutral_mm, triangles, model.mask, seam_mm, detail_mm)
        layers, displacements_mm = model.basis(np.asarray(neutral_mm, dtype=np.float64))
        self._basis = np.ascontiguousarray(layers.T, dtype=np.float32)
        self._places = self.integrator.weighted_places(displacements_mm) if detail_mm else None

    def correct(
        self, coarse_mm: np.ndarray, features: np.ndarray, frames: np.ndarray | None = None
    ) -> np.ndarray:
        """Corrected vertices (F, V, 3), float64, of coarse ones in the head frame.

        `frames` (F,) are their numbers, ascending; None: they follow each other.
        """
        frames = np.arange(len(features)) if frames is None else frames
        mixture = self.model.mixture(features, self.neutral_mm)
        mixture = smoothed_over_time(mixture, frames, self.smooth_frames)
        one = np.ones((len(mixture), 1))
        return self.integrator.integrate_mixture(
            coarse_mm, np.concatenate([mixture, one], axis=1), self._basis, self._places
        )


def correct_sequence(
    model: LipModel,
    coarse_mm: np.ndarray,
    triangles: np.ndarray,
    neutral_mm: np.ndarray,
    rotation: np.ndarray,
    translation_mm: np.ndarray,
    features: np.ndarray,
    *,
    valid: np.ndarray | None = None,
    seam_mm: float = 16.0,
    detail_mm: float = 0.0,
    smooth_frames: int = 0,
    frames: np.ndarray | None = None,
    image: ImageContours | None = None,
) -> np.ndarray:
    """Corrected vertices (F, V, 3), world, mm, float64; see the module's text.

    `frames` (F,) are their numbers, ascending; None: they follow each other.

    Raises ModelFileError where the mesh is not the one that the regressor was trained on.
    """
    corrector = Corrector(model, neutral_mm, triangles, seam_mm, detail_mm, smooth_frames)
    usable = np.isfinite(features).all(axis=1) & np.isfinite(coarse_mm).all(axis=(1, 2))
    if valid is not None:
        usable &= valid
    frames = np.arange(len(features)) if frames is None else np.asarray(frames)
    head = head_from_world(coarse_mm[usable], rotation[usable], translation_mm[usable])
    return _in_world(
        corrector.integrator, corrector.correct(head, features[usable], frames[usable]), usable,
        coarse_mm, neutral_mm, rotation, translation_mm, image,
    )  # fmt: skip


def correct_with_layers(
    mask: np.ndarray,
    layers: np.ndarray,
    coarse_mm: np.ndarray,
    triangles: np.ndarray,
    neutral_mm: np.ndarray,
    rotation: np.ndarray,
    translation_mm: np.ndarray,
    *,
    valid: np.ndarray | None = None,
    seam_mm: float = 16.0,
    displacement_mm: np.ndarray | None = None,
    detail_mm: float = 0.0,
    image: ImageContours | None = None,
) -> np.ndarray:
    """As `correct_sequence`, with given layers (F, T, 9) over the triangles `mask` (T,).

    Args:
        displacement_mm: (F, N, 3) of the mask's corners, needed where `detail_mm` is not 0.
    """
    usable = np.isfinite(coarse_mm).all(axis=(1, 2))
    if valid is not None:
        usable &= valid
    integrator = LayerIntegrator(neutral_mm, triangles, mask, seam_mm, detail_mm)
    places = displacement_mm[usable] if detail_mm > 0 else None
    head = head_from_world(coarse_mm[usable], rotation[usable], translation_mm[usable])
    return _in_world(
        integrator, integrator.integrate(head, layers[usable], places), usable, coarse_mm,
        neutral_mm, rotation, translation_mm, image,
    )  # fmt: skip


def _in_world(
    integrator: LayerIntegrator,
    head: np.ndarray,
    usable: np.ndarray,
    coarse_mm: np.ndarray,
    neutral_mm: np.ndarray,
    rotation: np.ndarray,
    translation_mm: np.ndarray,
    image: ImageContours | None,
) -> np.ndarray:
    """The coarse meshes (F, V, 3), with the corrected ones (usable frames, V, 3) of the head frame."""
    corrected = np.array(coarse_mm, dtype=np.float64)
    pose = rotation[usable], translation_mm[usable]
    if image is None or not image.settings.used:
        corrected[usable] = world_from_head(head, *pose)
    else:
        fit = ImageAgreement.of(integrator, neutral_mm, image)
        corrected[usable] = fit.fit(head, corrected[usable], *pose, image[usable])
    return corrected
