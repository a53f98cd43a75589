"""The photometric residual of a frame: every step of the track should lower it."""

from __future__ import annotations

import numpy as np

from vermilion.appearance.estimate import Appearance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.geometry.rotations import rotation_matrix
from vermilion.imaging.display import to_display_values
from vermilion.tracking.image_fit.frame_fit import FrameView, exposure_gain
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.observation import project


def sample_errors(
    view: FrameView,
    x: np.ndarray,
    face: SampledFace,
    appearance: Appearance,
    offsets_mm: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image minus model, at the frame's exposure, at each sample, display values (0 to 255).

    Args:
        view: the frame.
        x: (6 + K,) rotation vector about `view.reference`, translation, weights.
        face: the person at the samples.
        appearance: of the take, at the same samples.
        offsets_mm: (N, 3) offsets of the samples, head frame.

    Returns:
        errors (N, 3); trust (N,), zero where not seen; place (N, 2) in pixels from the principal
        point.
    """
    rotation = rotation_matrix(x[:3]) @ view.reference
    points = (face.points(x[N_POSE:]) + offsets_mm) @ rotation.T + x[3:6]
    image = project(points, view.focal_px)
    found, _, inside = view.levels[0].sample(image)
    predicted = appearance.colours(face.normals(x[N_POSE:]) @ rotation.T)
    trust = view.trust * inside * (appearance.seen > 0)
    predicted = predicted * exposure_gain(found, predicted, trust)
    return to_display_values(found) - to_display_values(predicted), trust, image


def photometric_residual(errors: np.ndarray, trust: np.ndarray) -> float:
    """Mean of absolute `errors` (N, 3) weighted by `trust` (N,), display values (0 to 255)."""
    return float((trust * np.abs(errors).mean(axis=1)).sum() / max(trust.sum(), 1e-9))
