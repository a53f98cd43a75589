"""What kind of shape the mouth has in a frame: by the true curves where they are known, else by H."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vermilion.evaluation.lips import aperture_mm, columns_of, lip_gaps
from vermilion.faces.contours import LEFT_CORNER, RIGHT_CORNER
from vermilion.faces.lips import lip_sides
from vermilion.faces.model import FaceModel

KINDS = ("kiss", "roll", "press", "open", "smile", "speech")
#: Kind -> (curves, how they count together, value from which a frame is of this kind).
_CURVES: dict[str, tuple[tuple[str, ...], str, float]] = {
    "kiss": (("mouthPucker", "mouthFunnel"), "max", 0.35),
    "roll": (
        ("mouthRollLower", "mouthRollUpper", "mouthRollOutLower", "mouthRollOutUpper"),
        "max",
        0.3,
    ),
    "press": (("mouthPress_L", "mouthPress_R"), "mean", 0.3),
    "open": (("jawOpen",), "max", 0.25),
    "smile": (("mouthSmile_L", "mouthSmile_R"), "mean", 0.35),
}
#: Where no curves are known: what the lips do against their neutral, from which a frame is of a kind.
#: Like those of the curves they say what the words mean, so they are no options.
_NARROWER = 0.09  # kiss: loss of width between the corners, of the neutral's width
_FORWARD_MM = 0.5  # kiss: how far the lips protrude at least
_THINNER = 0.3  # roll: loss of the red's height, of the neutral's
_THINNER_SHUT = 0.12  # press: the same, of shut lips ...
_PRESS_AT_MOST = 1.01  # ... in multiples of it: what thins more is a roll
_OPEN_MM = 7.0  # open: gap between the lips beyond the neutral's
_WIDER = 0.1  # smile: gain of width
#: Lips are shut where their gap is under half of the neutral's, or under this.
_SHUT_MM = 0.5
#: Vertices of the neutral this near to a corner landmark make the corner's place.
_CORNER_MM = 4.0


def kinds_of_curves(curves: Sequence[Mapping[str, float]]) -> np.ndarray:
    """Kind of each frame (F,) str, by its expression weights (ARKit names).

    The kind whose curves lie furthest over its threshold, in multiples of it; `speech` where none
    does: what lies between the extremes.
    """
    scores = np.zeros((len(curves), len(_CURVES)))
    for k, (names, combine, threshold) in enumerate(_CURVES.values()):
        values = np.array([[frame.get(name, 0.0) for name in names] for frame in curves])
        together = values.max(axis=1) if combine == "max" else values.mean(axis=1)
        scores[:, k] = together / threshold
    return _best(scores)


def kinds_of_shapes(
    points_mm: np.ndarray, neutral_mm: np.ndarray, model: FaceModel, valid: np.ndarray
) -> np.ndarray:
    """Kind of each frame (F,) str, by the shape of its lips against the neutral's.

    Width between the mouth corners, gap between the lips, height of the red of both lips, how far
    they protrude; each over a threshold. Presses and rolls look alike here where the lips are shut:
    those that lose more of their red are rolls.

    Args:
        points_mm: (F, V, 3) on the model's topology, head frame.
        neutral_mm: (V, 3) likewise.
        valid: (V,) bool, vertices that are known.
    """
    frames = _lip_measures(np.concatenate([neutral_mm[None], points_mm]), model, valid)
    width, gap, red, protrusion = (values[1:] for values in frames)
    width0, gap0, red0, protrusion0 = (values[0] for values in frames)
    with np.errstate(divide="ignore", invalid="ignore"):
        wider, thinner = width / width0 - 1.0, 1.0 - red / red0
    forward = protrusion - protrusion0
    shut = gap < max(0.5 * gap0, _SHUT_MM)
    scores = np.stack(
        [
            np.where(forward > _FORWARD_MM, -wider / _NARROWER, 0.0),
            thinner / _THINNER,
            np.where(shut, np.minimum(thinner / _THINNER_SHUT, _PRESS_AT_MOST), 0.0),
            (gap - gap0) / _OPEN_MM,
            wider / _WIDER,
        ],
        axis=1,
    )
    return _best(np.nan_to_num(scores))


def _best(scores: np.ndarray) -> np.ndarray:
    best = scores.argmax(axis=1)
    return np.where(scores.max(axis=1) >= 1.0, np.array(KINDS)[best], "speech")


def _lip_measures(points_mm: np.ndarray, model: FaceModel, valid: np.ndarray):
    """Width, gap, height of the red of both lips, place along z of the lips; (F,) mm each."""
    vermilion = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    corners = []
    for landmark in (RIGHT_CORNER, LEFT_CORNER):
        at = model.neutral_mm[model.landmarks[landmark]]
        near = valid & (np.linalg.norm(model.neutral_mm - at, axis=1) < _CORNER_MM)
        corners.append(points_mm[:, near].mean(axis=1) if near.any() else np.full(3, np.nan))
    columns = np.where(valid, columns_of(model), -1)
    gap = aperture_mm(lip_gaps(points_mm, lip_sides(model, with_inside=True), columns))
    middle = vermilion & (columns >= 0)
    height = points_mm[:, middle, 1]
    red = np.quantile(height, 0.98, axis=1) - np.quantile(height, 0.02, axis=1) - gap
    return (
        np.linalg.norm(corners[1] - corners[0], axis=1),
        gap,
        red,
        points_mm[:, middle, 2].mean(axis=1),
    )
