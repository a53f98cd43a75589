"""Training of the boosted contour detectors from a few labelled frames (Lips16 3.2.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import cv2
import numpy as np

from vermilion.contours.boosted import BoostedDetector
from vermilion.contours.boosting import (
    BoostingSettings,
    Forest,
    bin_edges,
    bin_features,
    fit_forest,
)
from vermilion.contours.channels import CHANNELS, image_channels, integral_images
from vermilion.contours.labelled_frames import LabelledFrame
from vermilion.contours.labels import CONTOURS, Polyline, contact_lines, dark_valley, distance_to
from vermilion.contours.pool import FeaturePool, random_pool
from vermilion.contours.region import apply_affine, mouth_region
from vermilion.storage.progress import progress


@dataclass(frozen=True)
class ContourTrainingSettings:
    """How samples are drawn and detectors trained. Lengths are in region pixels.

    Attributes:
        interocular_size_px: inter-ocular distance of the region: the working resolution.
        margin: of the region round the mouth, per inter-ocular distance.
        n_features: size of the pool.
        patch_px: side of the patch that a feature may reach.
        label_px: deviation of the soft labels about the contour.
        variants: samples of each labelled frame: itself, then varied in scale, roll and side.
        far_share: share of the pixels far from any contour that are drawn at first.
        max_samples: pixels at most that a contour's detector is trained on at first.
        hard_rounds: rounds in which false answers of the last detector are added.
        smoothing_px: deviation of the Gaussian on the maps.
        boosting: of the trees.
    """

    interocular_size_px: float = 200.0
    margin: float = 0.16
    n_features: int = 1000
    patch_px: int = 48
    label_px: float = 1.2
    variants: int = 4
    far_share: float = 0.08
    max_samples: int = 30_000
    hard_rounds: int = 1
    smoothing_px: float = 1.0
    boosting: BoostingSettings = field(default_factory=BoostingSettings)

    @property
    def reach_px(self) -> float:
        """How far from a contour its own samples lie; farther pixels are drawn as any other."""
        return 8.0 * self.label_px

    @classmethod
    def of(cls, section) -> ContourTrainingSettings:
        """From a section of the configuration with the same names."""
        given: dict[str, Any] = {f.name: getattr(section, f.name, None) for f in fields(cls)}
        trees = section.boosting.model_dump()
        boosting = BoostingSettings(n_trees=trees.pop("trees"), seed=section.seed, **trees)
        return cls(**given | {"n_features": section.features, "boosting": boosting})


@dataclass(frozen=True)
class _Example:
    """One cropped variant of a frame: integral images, and targets per contour."""

    integrals: np.ndarray
    distance: dict[str, np.ndarray]
    usable: dict[str, np.ndarray]


def train_detector(
    frames: Sequence[LabelledFrame], settings: ContourTrainingSettings, seed: int = 0
) -> BoostedDetector:
    """Train the inner and the outer detector, separately, on labelled frames of one illumination.

    Args:
        frames: labelled ones.
        settings: how samples are drawn and trees grown.
        seed: of the samples and features.

    Raises:
        ValueError: no frames.
    """
    if not frames:
        raise ValueError("contour detectors need at least one labelled frame")
    random = np.random.default_rng(seed)
    examples = [
        example
        for frame in progress(frames, "contour labels")
        for example in _examples(frame, settings, random)
    ]
    pool = random_pool(settings.n_features, len(CHANNELS), settings.patch_px, random)
    forests = {
        name: _train_one(examples, name, pool, settings, random)
        for name in progress(CONTOURS, "contour detectors")
    }
    return BoostedDetector(
        forests, settings.interocular_size_px, settings.margin, settings.smoothing_px
    )


def _examples(
    frame: LabelledFrame, settings: ContourTrainingSettings, random: np.random.Generator
) -> list[_Example]:
    examples = []
    for variant in range(settings.variants):
        jitter = None if variant == 0 else _jitter(random, mirrored=variant % 2 == 1)
        region = mouth_region(
            frame.landmarks_px, settings.interocular_size_px, settings.margin, jitter
        )
        inverse = cv2.invertAffineTransform(region.image_from_region)
        lines = {name: getattr(frame.label, name).dense() for name in CONTOURS}
        distance = {
            name: distance_to(apply_affine(inverse, line), region.size_px, settings.reach_px)
            for name, line in lines.items()
        }
        image = region.crop(frame.linear_rgb)
        channels = image_channels(image)
        usable = {name: region.mask.copy() for name in CONTOURS}
        across = region.image_from_region[:, 0]
        segments = [apply_affine(inverse, line) for line in contact_lines(frame.label, across)]
        _add_contact(distance["inner"], usable["inner"], channels[0], segments, settings)
        examples.append(_Example(integral_images(channels), distance, usable))
    return examples


def _add_contact(
    distance: np.ndarray,
    usable: np.ndarray,
    lightness: np.ndarray,
    segments: Sequence[np.ndarray],
    settings: ContourTrainingSettings,
) -> None:
    """Let the lips' line of contact count as inner contour, in place.

    A label names the opening alone, while a closed mouth's label is its line of contact. So the
    dark line from each end of the opening is taken as contour too, and what lies between the
    line and the surely different is left out.
    """
    reach = 0.03 * settings.interocular_size_px
    for start, end in segments:
        if np.linalg.norm(end - start) < 2 * reach:
            continue
        towards = end - 0.1 * (end - start)  # the corner itself is outer contour
        line = dark_valley(lightness, start, towards, reach)
        straight = Polyline(np.stack([start, end]), False).dense()
        near = np.isfinite(distance_to(straight, len(distance), reach))
        contact = np.full_like(distance, np.inf)
        if len(line):
            contact = distance_to(line, len(distance), settings.reach_px)
        certain = np.minimum(distance, contact) < 1.5 * settings.label_px
        usable &= certain | ~near
        np.minimum(distance, contact, out=distance)


def _jitter(random: np.random.Generator, mirrored: bool) -> np.ndarray:
    """A small change of scale and roll, mirrored or not, (2, 2)."""
    angle, scale = random.normal(0.0, 0.07), np.exp(random.normal(0.0, 0.06))
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return scale * rotation @ np.diag([-1.0 if mirrored else 1.0, 1.0])


def _train_one(
    examples: Sequence[_Example],
    name: str,
    pool: FeaturePool,
    settings: ContourTrainingSettings,
    random: np.random.Generator,
) -> Forest:
    chosen = [_first_samples(example, name, settings, random) for example in examples]
    share = min(1.0, settings.max_samples / max(sum(mask.sum() for mask in chosen), 1))
    chosen = [mask & (random.random(mask.shape) < share) for mask in chosen]
    edges = bin_edges(_some_values(examples, chosen, pool))
    codes, labels = _collect(examples, chosen, name, pool, edges, settings)
    for round_ in range(settings.hard_rounds + 1):
        forest = fit_forest(pool, codes, edges, labels, _balanced(labels), settings.boosting)
        if round_ == settings.hard_rounds:
            break
        hard = [_hard_samples(example, name, forest, settings) for example in examples]
        found = sum(mask.sum() for mask in hard)
        if found < 0.002 * len(labels):
            break
        keep = min(1.0, 0.5 * settings.max_samples / found)
        hard = [mask & (random.random(mask.shape) < keep) for mask in hard]
        more, more_labels = _collect(examples, hard, name, pool, edges, settings)
        codes = np.concatenate([codes, more], axis=1)
        labels = np.concatenate([labels, more_labels])
    return forest


def _first_samples(
    example: _Example, name: str, settings: ContourTrainingSettings, random: np.random.Generator
) -> np.ndarray:
    """Every pixel near the contour, half of those a little farther, a few of the rest."""
    distance = example.distance[name]
    near = distance < 2.0 * settings.label_px
    beside = distance < settings.reach_px
    draw = random.random(distance.shape)
    chosen = near | (beside & (draw < 0.4)) | (draw < settings.far_share)
    return chosen & example.usable[name]


def _hard_samples(
    example: _Example, name: str, forest: Forest, settings: ContourTrainingSettings
) -> np.ndarray:
    """Pixels farther than three deviations from the contour that look like contour."""
    rows, columns = np.nonzero(example.usable[name])
    log_odds = forest.log_odds(example.integrals, columns, rows)
    hard = np.zeros(example.usable[name].shape, dtype=bool)
    hard[rows, columns] = log_odds > 0.0
    return hard & (example.distance[name] > 3.0 * settings.label_px)


def _some_values(
    examples: Sequence[_Example], chosen: Sequence[np.ndarray], pool: FeaturePool
) -> np.ndarray:
    """Features (N, n) of about 4000 of the samples, evenly taken: enough for their quantiles."""
    step = max(sum(int(mask.sum()) for mask in chosen) // 4000, 1)
    values = []
    for example, mask in zip(examples, chosen, strict=True):
        rows, columns = np.nonzero(mask)
        values.append(pool.evaluate(example.integrals, columns[::step], rows[::step]))
    return np.concatenate(values, axis=1)


def _collect(
    examples: Sequence[_Example],
    chosen: Sequence[np.ndarray],
    name: str,
    pool: FeaturePool,
    edges: np.ndarray,
    settings: ContourTrainingSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Binned features (N, n) and soft labels (n,) of the chosen pixels."""
    codes, labels = [], []
    for example, mask in zip(examples, chosen, strict=True):
        rows, columns = np.nonzero(mask)
        codes.append(bin_features(pool, edges, example.integrals, columns, rows))
        distance = example.distance[name][rows, columns]
        labels.append(np.exp(-0.5 * (distance / settings.label_px) ** 2))
    return np.concatenate(codes, axis=1), np.concatenate(labels)


def _balanced(labels: np.ndarray) -> np.ndarray:
    """Weights that give contour and the rest a like share, mean 1."""
    positive, negative = labels.sum(), (1 - labels).sum()
    weights = labels / max(positive, 1e-9) + (1 - labels) / max(negative, 1e-9)
    return weights * len(labels) / weights.sum()
