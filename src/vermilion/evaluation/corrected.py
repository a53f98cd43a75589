"""Corrected meshes of held-out frames, with the time they took."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from vermilion.correction.correct import Corrector, correct_with_layers
from vermilion.correction.image_agreement import ImageAgreement
from vermilion.correction.image_contours import ImageContours
from vermilion.geometry.head_frame import head_from_world, world_from_head
from vermilion.regression.model import LipModel
from vermilion.regression.training import VARIANTS


@dataclass(frozen=True)
class CoarseTake:
    """The coarse track of some frames.

    Attributes:
        frames: (F,) frame numbers, ascending.
        coarse_mm: (F, V, 3) world; triangles: (T, 3); neutral_mm: (V, 3) of the subject.
        rotation, translation_mm: `world_from_head`, (F, 3, 3) and (F, 3).
        features: (F, M); NaN where a frame has none.
        seam_mm, detail_mm, smooth_frames: of the integration.
        image: of the same frames; None for the paper, which has no such thing.
    """

    frames: np.ndarray
    coarse_mm: np.ndarray
    triangles: np.ndarray
    neutral_mm: np.ndarray
    rotation: np.ndarray
    translation_mm: np.ndarray
    features: np.ndarray
    seam_mm: float
    detail_mm: float = 0.0
    smooth_frames: int = 0
    image: ImageContours | None = None

    def __getitem__(self, rows: np.ndarray) -> CoarseTake:
        """The same of some frames."""
        names = ("frames", "coarse_mm", "rotation", "translation_mm", "features")
        image = None if self.image is None else self.image[rows]
        return replace(self, **{name: getattr(self, name)[rows] for name in names}, image=image)

    def as_in_paper(self) -> CoarseTake:
        """Without the image, which Lips16 leaves to future work, each frame by itself."""
        return replace(self, image=None, smooth_frames=0)


def corrected_by(model: LipModel, take: CoarseTake) -> tuple[np.ndarray, float]:
    """Corrected meshes (F, V, 3) in the world, and seconds a frame from features to vertices.

    The factorisation, once a person, is not in the time. Frames without features stay as they are.
    """
    corrector = Corrector(
        model, take.neutral_mm, take.triangles, take.seam_mm, take.detail_mm, take.smooth_frames
    )
    usable = np.isfinite(take.features).all(axis=1)
    pose = take.rotation[usable], take.translation_mm[usable]
    corrected = np.array(take.coarse_mm, dtype=np.float64)
    if not usable.any():
        return corrected, np.nan
    coarse, features, frames = corrected[usable], take.features[usable], take.frames[usable]
    fit = None
    if take.image is not None and take.image.settings.used:
        fit = ImageAgreement.of(corrector.integrator, take.neutral_mm, take.image)
        image = take.image[usable]

    def correct(rows: slice) -> np.ndarray:
        of_rows = pose[0][rows], pose[1][rows]
        head = head_from_world(coarse[rows], *of_rows)
        head = corrector.correct(head, features[rows], frames[rows])
        if fit is None:
            return world_from_head(head, *of_rows)
        return fit.fit(head, coarse[rows], *of_rows, image[rows])

    correct(slice(1))  # compiles and warms what a long take pays for once
    start = time.perf_counter()
    corrected[usable] = correct(slice(None))
    return corrected, (time.perf_counter() - start) / int(usable.sum())


def corrected_by_truth(
    mask: np.ndarray,
    layers: np.ndarray,
    displacement_mm: np.ndarray,
    valid: np.ndarray,
    take: CoarseTake,
) -> np.ndarray:
    """The oracle: true layers (F, T, 9) of the triangles `mask` (T,) and displacements, (F, V, 3)."""
    return correct_with_layers(
        mask, layers, take.coarse_mm, take.triangles, take.neutral_mm, take.rotation,
        take.translation_mm, valid=valid, seam_mm=take.seam_mm,
        displacement_mm=displacement_mm, detail_mm=take.detail_mm, image=take.image,
    )  # fmt: skip


def measure_name(file_stem: str) -> str:
    """Name in `measures.tsv` of a model file: `PS-s1-affine` -> `PS-s1/affine`."""
    for variant in filter(None, VARIANTS):
        if file_stem.endswith(f"-{variant}"):
            return f"{file_stem.removesuffix(f'-{variant}')}/{variant}"
    return file_stem
