"""Accuracy and speed of the contour detectors on labelled frames, against named alternatives.

The `phone` take of the sample capture: detectors are trained on four labelled frames and measured
on the two others. Landmarks are those of the networks in the data folder. Prints, per detector,
the mean distance of the found contour to the labelled one in pixels at a mouth width of 120 px,
seconds of training, and CPU seconds a frame for both maps.

- `landmarks`: ridges along the landmarks' curves, no image;
- `colour`: ridges at the border of the lips' colour near the landmarks (`kind: landmarks`);
- `boosted`: boosted edge learning (`kind: boosted`);
- `scikit-learn`: the same samples and features through HistGradientBoostingClassifier (soft labels
  as weighted pairs), all features evaluated at every pixel.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from sklearn.ensemble import HistGradientBoostingClassifier

from benchmarks.common import add_data_argument, print_table, timed
from vermilion.contours import training
from vermilion.contours.channels import CHANNELS, image_channels, integral_images
from vermilion.contours.curves import loop_spline
from vermilion.contours.labelled_frames import LabelledFrame
from vermilion.contours.labels import CONTOURS, label_paths, read_contour_label
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.pool import random_pool
from vermilion.contours.region import mouth_region
from vermilion.contours.training import ContourTrainingSettings, train_detector
from vermilion.features.search import SearchSettings, find_inner, find_outer
from vermilion.imaging.frames import open_frames
from vermilion.landmarks.networks import NetworkDetector
from vermilion.landmarks.scheme import LIP_INNER, LIP_OUTER, interocular_px

HELD_OUT = (14, 28)


@dataclass(frozen=True)
class PeerDetector:
    """scikit-learn's boosting on the same pool."""

    pool: object
    models: dict[str, HistGradientBoostingClassifier]
    settings: ContourTrainingSettings

    def likelihood(self, linear_rgb, landmarks_px):
        """The (inner, outer) maps (h, w) of an image (h, w, 3) with landmarks (66, 2) px."""
        region = mouth_region(landmarks_px, self.settings.interocular_size_px, self.settings.margin)
        integrals = integral_images(image_channels(region.crop(linear_rgb)))
        rows, columns = np.nonzero(region.mask)
        values = self.pool.evaluate(integrals, columns, rows).T
        maps = []
        for name in CONTOURS:
            plane = np.zeros(region.mask.shape, dtype=np.float32)
            plane[rows, columns] = self.models[name].predict_proba(values)[:, 1]
            maps.append(region.paste(plane, linear_rgb.shape[:2]))
        return maps


def train_peer(frames, settings: ContourTrainingSettings, n_features: int = 300) -> PeerDetector:
    """Train it on labelled frames."""
    random = np.random.default_rng(0)
    examples = [e for frame in frames for e in training._examples(frame, settings, random)]
    pool = random_pool(n_features, len(CHANNELS), settings.patch_px, random)
    models = {}
    for name in CONTOURS:
        values, labels = [], []
        for example in examples:
            mask = training._first_samples(example, name, settings, random)
            rows, columns = np.nonzero(mask & (random.random(mask.shape) < 0.4))
            values.append(pool.evaluate(example.integrals, columns, rows))
            distance = example.distance[name][rows, columns]
            labels.append(np.exp(-0.5 * (distance / settings.label_px) ** 2))
        values, labels = np.concatenate(values, axis=1).T, np.concatenate(labels)
        model = HistGradientBoostingClassifier(
            max_iter=160, learning_rate=0.15, max_depth=4, early_stopping=False
        )
        weights = training._balanced(labels)
        model.fit(
            np.concatenate([values, values]),
            np.repeat([1, 0], len(labels)),
            sample_weight=np.concatenate([weights * labels, weights * (1 - labels)]),
        )
        models[name] = model
    return PeerDetector(pool, models, settings)


@dataclass(frozen=True)
class FoundContours:
    """Contours of a frame (n, 2) px, and which points met a maximum, (n,) bool."""

    outer_px: np.ndarray
    inner_px: np.ndarray
    outer_found: np.ndarray
    inner_found: np.ndarray


def search_from_landmarks(maps, points_px: np.ndarray) -> FoundContours:
    """Contours in the (inner, outer) maps of a frame from its landmarks `points_px` (66, 2)."""
    unit, settings = float(interocular_px(points_px)), SearchSettings()
    start = loop_spline(points_px[LIP_OUTER], 80)
    lips = loop_spline(points_px[LIP_INNER], 80) - start
    outer = find_outer(maps[1], start, unit, settings)
    inner = find_inner(maps[0], outer.points, lips, unit, settings)
    return FoundContours(outer.points, inner.points, outer.found, inner.found)


def errors_px(found: FoundContours, frame: LabelledFrame) -> dict[str, float]:
    """Mean distance of the found contours to the labelled ones at a mouth width of 120 px."""
    scale = 120.0 / np.ptp(frame.label.outer.points_px[:, 0])
    ends, across = frame.label.inner.points_px[:, 0], found.inner_px[:, 0]
    between = (across > ends.min()) & (across < ends.max())
    errors = {}
    for name, points in (("outer", found.outer_px), ("inner", found.inner_px[between])):
        line = getattr(frame.label, name).dense(0.2)
        errors[f"{name}_px"] = float(cKDTree(line).query(points)[0].mean() * scale)
    return errors


def labelled_frames(data: Path) -> dict[int, LabelledFrame]:
    """Frame number -> labelled frame of the sample capture's `phone` take."""
    capture = data / "capture-sample/captures/p1/phone"
    landmarks = NetworkDetector(data / "landmarks66")
    source, frames = open_frames(capture), {}
    for number, path in label_paths(capture, "cam").items():
        image = source.read("cam", number)
        frames[number] = LabelledFrame(
            image, landmarks.detect(image).points_px, read_contour_label(path), number
        )
    return frames


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read."""
    add_data_argument(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    frames = labelled_frames(arguments.data)
    train = [frame for number, frame in frames.items() if number not in HELD_OUT]
    settings = ContourTrainingSettings()
    makers = {
        "landmarks": lambda: LandmarkRidgeDetector(edge_weight=0.0),
        "colour": LandmarkRidgeDetector,
        "boosted": lambda: train_detector(train, settings),
        "scikit-learn": lambda: train_peer(train, settings),
    }
    train_detector(train[:1], ContourTrainingSettings(variants=1, n_features=64))  # compiles
    rows = []
    for name, make in makers.items():
        fitted = timed(make)
        for number in HELD_OUT:
            frame = frames[number]
            task = partial(fitted.result.likelihood, frame.linear_rgb, frame.landmarks_px)
            maps = timed(task, warm_up=True)
            found = search_from_landmarks(maps.result, frame.landmarks_px)
            rows.append(
                {"detector": name, "frame": number}
                | errors_px(found, frame)
                | {"training_s": fitted.wall_s, "maps_cpu_s": maps.cpu_s}
            )
    print_table(rows, {"training_s": 1, "maps_cpu_s": 3})
