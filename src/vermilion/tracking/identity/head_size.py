"""The size of a head from a measured distance of its pupils.

One camera cannot distinguish a small near head from a large far one; a length that somebody measured can.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.landmarks.scheme import EYE_LEFT, EYE_RIGHT
from vermilion.storage.errors import InputError

#: Sizes, against the face model's, beyond which a measurement must be wrong.
_LEAST, _MOST = 0.75, 1.3


def pupil_distance_mm(model: FaceModel, neutral_mm: np.ndarray) -> float:
    """Distance of the pupils that look far ahead, in a neutral (V, 3) mm: each midway between its eye's corners."""
    points = np.asarray(neutral_mm)[model.landmarks]
    right, left = (points[[eye[0], eye[3]]].mean(axis=0) for eye in (EYE_RIGHT, EYE_LEFT))
    return float(np.linalg.norm(left - right))


def sized_model(model: FaceModel, identity: np.ndarray, eye_distance_mm: float) -> FaceModel:
    """A face model in which a person's pupils are so far apart as they were measured to be.

    All of it is scaled, expressions too: a larger face moves by more. The images say the same of it.

    Args:
        model: everybody's.
        identity: (I,) the person in it, standard deviations.
        eye_distance_mm: measured.

    Raises:
        InputError: no head has that size.
    """
    found = pupil_distance_mm(model, model.neutral_of(identity))
    scale = eye_distance_mm / found
    if not _LEAST <= scale <= _MOST:
        raise InputError(
            f"eye_distance_mm {eye_distance_mm:g}, where the face model has {found:.1f} for this face",
            f"{_LEAST * found:.0f} to {_MOST * found:.0f}",
            "Correct it in the take sheet: the distance of the pupils, looking far ahead, in millimetres.",
        )
    return replace(
        model,
        neutral_mm=model.neutral_mm * scale,
        expressions_mm=(model.expressions_mm * scale).astype(np.float32),
        identities_mm=(model.identities_mm * scale).astype(np.float32),
    )
