"""Accuracy and speed of the contour detectors, against named alternatives, on labelled frames.

    python -m benchmarks.bench_contours [data folder]

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

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from sklearn.ensemble import HistGradientBoostingClassifier

from vermilion.contours import training
from vermilion.contours.channels import CHANNELS, image_channels, integral_images
from vermilion.contours.curves import loop_spline
from vermilion.contours.labelled_frames import LabelledFrame
from vermilion.contours.labels import CONTOURS, label_paths, read_label
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.pool import random_pool
from vermilion.contours.region import mouth_region
from vermilion.contours.training import TrainingSettings, train_detector
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
    settings: TrainingSettings

    def likelihood(self, linear_rgb, landmarks_px):
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


def train_peer(frames, settings: TrainingSettings, n_features: int = 300) -> PeerDetector:
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


def contour_error_px(detector, frame: LabelledFrame) -> tuple[dict[str, float], float]:
    """Mean distance of the found rings at a mouth width of 120 px, and CPU seconds of the maps."""
    start = time.process_time()
    inner_map, outer_map = detector.likelihood(frame.linear_rgb, frame.landmarks_px)
    seconds = time.process_time() - start
    unit, settings = float(interocular_px(frame.landmarks_px)), SearchSettings()
    ring = loop_spline(frame.landmarks_px[LIP_OUTER], 80)
    outer = find_outer(outer_map, ring, unit, settings)
    lips = loop_spline(frame.landmarks_px[LIP_INNER], 80) - ring
    inner = find_inner(inner_map, outer.points, lips, unit, settings)
    scale = 120.0 / np.ptp(frame.label.outer.points_px[:, 0])
    ends = frame.label.inner.points_px[:, 0]
    between = (inner.points[:, 0] > ends.min()) & (inner.points[:, 0] < ends.max())
    errors = {}
    for name, points in (("outer", outer.points), ("inner", inner.points[between])):
        line = getattr(frame.label, name).dense(0.2)
        errors[name] = float(cKDTree(line).query(points)[0].mean() * scale)
    return errors, seconds


def labelled_frames(data: Path) -> dict[int, LabelledFrame]:
    capture = data / "capture-sample/captures/p1/phone"
    landmarks = NetworkDetector(data / "landmarks66")
    source, frames = open_frames(capture), {}
    for number, path in label_paths(capture, "cam").items():
        image = source.read("cam", number)
        frames[number] = LabelledFrame(
            image, landmarks.detect(image).points_px, read_label(path), number
        )
    return frames


def main() -> None:
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("../shared/data")
    frames = labelled_frames(data)
    train = [frame for number, frame in frames.items() if number not in HELD_OUT]
    settings = TrainingSettings()
    makers = {
        "landmarks": lambda: LandmarkRidgeDetector(edge_weight=0.0),
        "colour": LandmarkRidgeDetector,
        "boosted": lambda: train_detector(train, settings),
        "scikit-learn": lambda: train_peer(train, settings),
    }
    train_detector(train[:1], TrainingSettings(variants=1, n_features=64))  # compiles
    print("detector\tframe\touter_px\tinner_px\ttraining_s\tmaps_cpu_s")
    for name, make in makers.items():
        start = time.perf_counter()
        detector = make()
        trained = time.perf_counter() - start
        for number in HELD_OUT:
            contour_error_px(detector, frames[number])
            errors, seconds = contour_error_px(detector, frames[number])
            print(
                f"{name}\t{number}\t{errors['outer']:.2f}\t{errors['inner']:.2f}\t"
                f"{trained:.1f}\t{seconds:.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
