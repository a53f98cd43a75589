"""Training of the supervised descent on labelled images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.descent import (
    DescentDetector,
    ImageSimilarity,
    shape_features,
    stage_sizes,
)
from vermilion.landmarks.gradients import grey_of
from vermilion.landmarks.labels import LandmarkLabel, check_landmark_label
from vermilion.landmarks.locate import train_locator
from vermilion.landmarks.scheme import MIRROR, N_LANDMARKS, face_size_px
from vermilion.storage.errors import InputError
from vermilion.storage.frames import evenly_spaced
from vermilion.storage.progress import progress

#: A point this far off (face sizes) is half as sure as one in place.
_SURE_RADIUS = 0.035


@dataclass(frozen=True)
class LandmarkTrainingSettings:
    """As the section `landmarks.training` of the configuration describes them."""

    stages: int = 5
    ridge: float = 0.1
    perturbations: int = 6
    box_shift: float = 0.08
    box_scale: float = 0.1
    box_turn_deg: float = 8.0
    max_frames: int = 400
    found_threshold: float = 0.35
    seed: int = 0


def labelled_images(
    labels: Sequence[tuple[FrameSource, LandmarkLabel]], max_frames: int
) -> tuple[list[np.ndarray], np.ndarray]:
    """Images (linear RGB) and points (N, 66, 2) of at most `max_frames` labels, evenly spread.

    Raises InputError where there are fewer than ten.
    """
    if len(labels) < 10:
        raise InputError(
            f"{len(labels)} labelled images",
            "at least ten, better a hundred",
            "Add files to labels/landmarks/<camera>/ of the takes in landmarks.training_takes.",
        )
    chosen = evenly_spaced(len(labels), max_frames)
    images, points = [], []
    for index in chosen:
        source, label = labels[index]
        image = source.read(label.camera, label.frame)
        check_landmark_label(label, image.shape[1::-1])
        images.append(image)
        points.append(label.points_px)
    return images, np.array(points)


def train_descent(
    images: Sequence[np.ndarray],
    points: np.ndarray,
    settings: LandmarkTrainingSettings | None = None,
) -> DescentDetector:
    """Learn the locator, the mean shape, the steps and the sureness.

    Args:
        images: N images (h, w, 3), linear RGB.
        points: (N, 66, 2) px.
    """
    settings = settings or LandmarkTrainingSettings()
    rng = np.random.default_rng(settings.seed)
    greys = [grey_of(image) for image in images]
    locator = train_locator(greys, points, settings.seed)
    greys, points = with_mirrors(greys, points)
    mean = mean_shape(points)
    owner = np.repeat(np.arange(len(greys)), settings.perturbations)
    shapes = np.stack([_start(points[i], mean, rng, settings) for i in owner])
    steps = []
    for number, size_px in enumerate(stage_sizes(settings.stages)):
        features, moves, frames = [], [], []
        for i, shape in progress(zip(owner, shapes, strict=True), f"stage {number}", len(owner)):
            found, to_image = shape_features(greys[i], shape, mean, size_px)
            inverse = np.linalg.inv(to_image.matrix)
            features.append(found.reshape(-1))
            moves.append(((points[i] - shape) @ inverse.T).reshape(-1))
            frames.append(to_image.matrix)
        table = np.array(features, dtype=np.float32)
        step = ridge_regression(table, np.array(moves), settings.ridge)
        steps.append(step.astype(np.float16))
        predicted = table @ step[:-1] + step[-1]
        predicted = predicted.reshape(len(owner), N_LANDMARKS, 2)
        shapes = shapes + predicted @ np.swapaxes(np.array(frames), 1, 2)
    sureness = _train_sureness(greys, points, mean, stage_sizes(settings.stages)[-1], rng)
    return DescentDetector(
        mean, np.array(steps, np.float32), sureness, locator, settings.found_threshold
    )


def with_mirrors(
    greys: list[np.ndarray], points: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Images `greys` (h, w) with their mirror images, and `points` (N, 66, 2) with theirs (2N, 66, 2)."""
    flipped = points[:, MIRROR].copy()
    widths = np.array([grey.shape[1] for grey in greys])
    flipped[..., 0] = widths[:, None] - flipped[..., 0]
    mirrors = [np.ascontiguousarray(grey[:, ::-1]) for grey in greys]
    return greys + mirrors, np.concatenate([points, flipped])


def mean_shape(points: np.ndarray, rounds: int = 5) -> np.ndarray:
    """Mean (66, 2) of shapes `points` (N, 66, 2) after similarity alignment: size 1, box about the origin."""
    mean = _normalised(points[0])
    for _ in range(rounds):
        aligned = [ImageSimilarity.between(shape, mean)(shape) for shape in points]
        mean = _normalised(np.mean(aligned, axis=0))
    # Upright: what is left of the first shape's turn is taken out by symmetry.
    mirror = mean[MIRROR] * [-1, 1]
    return _normalised(0.5 * (mean + ImageSimilarity.between(mirror, mean)(mirror)))


def _normalised(shape: np.ndarray) -> np.ndarray:
    return (shape - 0.5 * (shape.min(axis=0) + shape.max(axis=0))) / face_size_px(shape)


def _start(
    shape: np.ndarray,
    mean: np.ndarray,
    rng: np.random.Generator,
    settings: LandmarkTrainingSettings,
) -> np.ndarray:
    """The mean shape in the face's box, misplaced as a locator would."""
    size = face_size_px(shape)
    centre = 0.5 * (shape.min(axis=0) + shape.max(axis=0))
    centre = centre + rng.normal(size=2) * settings.box_shift * size
    size = size * np.exp(rng.normal() * settings.box_scale)
    angle = np.radians(rng.normal() * settings.box_turn_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return mean @ turn.T * size + centre


def ridge_regression(features: np.ndarray, targets: np.ndarray, ridge: float) -> np.ndarray:
    """Weights (P + 1, Q) of least squares with offset, in the dual: N samples, P >> N features.

    Minimises |X w - y|^2 + ridge * trace(X X') |w|^2 with centred X and y: `features` (N, P) and
    `targets` (N, Q).
    """
    centre, middle = features.mean(axis=0), targets.mean(axis=0)
    x = features - centre
    gram = (x @ x.T).astype(np.float64)
    gram[np.diag_indices(len(x))] += ridge * np.trace(gram) / len(x)
    dual = cho_solve(cho_factor(gram, overwrite_a=True), targets - middle)
    weights = x.T.astype(np.float64) @ dual
    return np.concatenate([weights, (middle - centre @ weights)[None]])


def _train_sureness(
    greys: list[np.ndarray],
    points: np.ndarray,
    mean: np.ndarray,
    size_px: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Regress how near each point is to its place, from its patch; (66, 129)."""
    features, nearness = [], []
    for grey, shape in zip(greys, points, strict=True):
        size = face_size_px(shape)
        for sigma in (0.005, 0.02, 0.05, 0.12, 0.25):
            # Partly together, as a shape that has landed wrongly, partly point by point.
            off = rng.normal(size=(1, 2)) * sigma + rng.normal(size=shape.shape) * 0.5 * sigma
            found, _ = shape_features(grey, shape + off * size, mean, size_px)
            features.append(found)
            nearness.append(0.5 ** ((off**2).sum(axis=-1) / _SURE_RADIUS**2))
    x = np.array(features, dtype=np.float64).transpose(1, 0, 2)
    y = np.array(nearness).T
    x = np.concatenate([x, np.ones((*x.shape[:2], 1))], axis=2)
    gram = np.swapaxes(x, 1, 2) @ x
    diagonal = np.arange(x.shape[2] - 1)
    gram[:, diagonal, diagonal] += 0.01 * x.shape[1] / x.shape[2]
    return np.linalg.solve(gram, np.swapaxes(x, 1, 2) @ y[..., None])[..., 0]
