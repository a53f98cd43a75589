"""Who a scan shows and with what face: the model fitted to its landmarks (Mono13 6, eqs. 6 to 8)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import Similarity, similarity_alignment
from vermilion.landmarks.scheme import BROWS, EYE_LEFT, EYE_RIGHT, JAW
from vermilion.scan.landmarks import ScanLandmarks

LIDS = np.setdiff1d(np.concatenate([EYE_RIGHT, EYE_LEFT]), [36, 39, 42, 45])  # without corners
_SIGMA_MM, _BROWS_MM, _JAW_MM, _CLOSED_LIDS_MM = 2.5, 4.0, 12.0, 20.0
# A scan is nearly neutral: small weights, but for what `bounds` says.
_WEIGHT_SIGMA, _ROBUST_SIGMAS, _ROUNDS = 0.1, 2.0, 20

#: Deviation of a detected landmark in the registration, over that in the fit of the model.
_DETECTED = 10.0

#: Units that scanners write: millimetre, centimetre, inch, decimetre, metre; and how far from one, as a
#: share, a unit may seem by the size of the head: people's heads differ by that.
_UNITS_MM, _UNIT_SHARE = (1.0, 10.0, 25.4, 100.0, 1000.0), 0.12


def standard_unit(estimated_mm: float) -> float | None:
    """The unit that a scan is in, by the one in which its head is as large as the model's.

    One that is near a standard unit is that unit, or everybody's head would have one size.

    Args:
        estimated_mm: length of the unit in which the head has the model's size.

    Returns:
        length of the standard unit (mm); None: it is none.
    """
    ratios = np.log(np.asarray(_UNITS_MM) / estimated_mm)
    nearest = int(np.argmin(np.abs(ratios)))
    return _UNITS_MM[nearest] if abs(ratios[nearest]) < np.log1p(_UNIT_SHARE) else None


@dataclass(frozen=True)
class ScanFit:
    """The head frame of a scan, and the model that looks like it.

    Attributes:
        head_from_scan: from the scan's unit and frame to the head frame in mm.
        identity: (I,) in standard deviations.
        weights: (K,) expression weights of the face in the scan (eyes closed, lips closed).
        points_mm: (66, 3) the landmarks in the head frame, NaN where unknown.
        sigma_mm: (66,) their deviations as guides of a registration.
    """

    head_from_scan: Similarity
    identity: np.ndarray
    weights: np.ndarray
    points_mm: np.ndarray
    sigma_mm: np.ndarray


def fit_landmarks(
    model: FaceModel,
    landmarks: ScanLandmarks,
    unit_mm: float | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    closed_eyes: bool = False,
) -> ScanFit:
    """Alternate similarity and box-constrained coefficients.

    Args:
        model: of the tracker.
        landmarks: of the scan.
        unit_mm: length of the scan's unit; None: the model says how large a head is.
        bounds: least and largest weight of some expressions; those of the others are 0 and 1.
        closed_eyes: the lids are shut; detectors see them half open, so that their landmarks but
            the corners count little.
    """
    known = landmarks.known
    seen, ids = landmarks.points[known], model.landmarks[known]
    neutral = model.neutral_mm[ids]
    shapes = np.concatenate([model.identities_mm[:, ids], model.expressions_mm[:, ids]])
    shapes = shapes.astype(np.float64).reshape(len(shapes), -1).T
    n_identities = model.n_identities
    prior = np.concatenate([np.ones(n_identities), np.full(model.n_expressions, _WEIGHT_SIGMA)])
    bounds = dict(bounds or {})
    if closed_eyes:
        bounds |= {name: (1.0, 1.0) for name in model.expression_names if "eyeBlink" in name}
    box = np.array([bounds.get(name, (0.0, 1.0)) for name in model.expression_names])
    low = np.concatenate([np.full(n_identities, -3.0), box[:, 0]]) - 1e-9
    high = np.concatenate([np.full(n_identities, 3.0), box[:, 1]]) + 1e-9
    base = np.full(len(model.landmarks), _SIGMA_MM)
    base[BROWS], base[JAW] = _BROWS_MM, _JAW_MM
    if closed_eyes:
        base[LIDS] = _CLOSED_LIDS_MM
    sigma = base[known]
    coefficients, robust = np.zeros(len(prior)), np.ones(len(seen))
    for _ in range(_ROUNDS):
        now = neutral + (shapes @ coefficients).reshape(-1, 3)
        head_from_scan = similarity_alignment(seen, now, robust / sigma**2, unit_mm)
        aligned = head_from_scan.apply(seen)
        spread = head_from_scan.scale * landmarks.spread[known]
        sigma = np.hypot(base[known], spread)
        away = np.linalg.norm(aligned - now, axis=1) / sigma
        robust = 1.0 / (1.0 + (away / _ROBUST_SIGMAS) ** 2)
        row = np.repeat(np.sqrt(robust) / sigma, 3)
        matrix = np.concatenate([shapes * row[:, None], np.diag(1.0 / prior)])
        right = np.concatenate([(aligned - neutral).ravel() * row, np.zeros(len(prior))])
        coefficients = lsq_linear(matrix, right, (low, high), tol=1e-8).x
    points, all_sigma = np.full((len(known), 3), np.nan), base.copy()
    # The registration heeds surfaces: a detector marks other places than the model names, by 5 mm, and
    # a ray through an open eye meets what lies behind. Landmarks given by hand are exact.
    guiding = sigma / robust * np.where(landmarks.spread[known] > 0, _DETECTED, 1.0)
    points[known], all_sigma[known] = aligned, guiding
    identity, weights = np.split(coefficients, [n_identities])
    return ScanFit(head_from_scan, identity, weights, points, all_sigma)
