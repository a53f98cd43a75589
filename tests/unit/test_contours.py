"""Lip contour detectors: what they find on drawn mouths whose contours are known."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.unit.mouths import draw_mouth
from vermilion.contours.boosting import BoostingSettings, bin_edges, fit_forest
from vermilion.contours.channels import LEVELS, PAD, image_channels, integral_images
from vermilion.contours.curves import loop_spline
from vermilion.contours.detector_file import load_detector
from vermilion.contours.labelled_frames import LabelledFrame
from vermilion.contours.labels import contact_lines, dark_valley, read_contour_label
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.paths import cheapest_ring
from vermilion.contours.pool import random_pool
from vermilion.contours.region import mouth_region
from vermilion.contours.training import ContourTrainingSettings, train_detector
from vermilion.storage.errors import InputError, ModelFileError

SMALL = ContourTrainingSettings(
    n_features=300,
    variants=1,
    max_samples=5000,
    boosting=BoostingSettings(n_trees=40, features_per_tree=64),
)


@pytest.fixture(scope="module")
def detector():
    frames = [
        LabelledFrame(*draw_mouth(opening, height, seed=seed), seed)
        for seed, (opening, height) in enumerate(((2.0, 20.0), (12.0, 28.0), (7.0, 24.0)))
    ]
    return train_detector(frames, SMALL)


def crest_distance_px(likelihood, line, threshold=0.35):
    """Mean distance of strong pixels of a map to a contour, weighted by likelihood.

    A perfect ridge of a deviation of 1.5 px has 1.0 px, its own half width.
    """
    rows, columns = np.nonzero(likelihood > threshold)
    assert len(rows) > 100
    distance, _ = cKDTree(line.dense()).query(np.stack([columns, rows], axis=1) + 0.5)
    return np.average(distance, weights=likelihood[rows, columns])


def covered_share(likelihood, line, threshold=0.3):
    points = line.dense(1.0)
    rows, columns = np.floor(points[:, 1]).astype(int), np.floor(points[:, 0]).astype(int)
    return (likelihood[rows, columns] > threshold).mean()


def test_boosted_detector_finds_contours_of_a_mouth_it_has_not_seen(detector):
    image, landmarks, label = draw_mouth(9.0, 26.0, seed=9)
    inner, outer = detector.likelihood(image, landmarks)
    assert crest_distance_px(outer, label.outer) < 1.2
    assert crest_distance_px(inner, label.inner) < 1.6
    assert covered_share(outer, label.outer) > 0.95
    assert covered_share(inner, label.inner) > 0.9


def test_detection_follows_scale_and_roll_of_the_face(detector):
    image, landmarks, label = draw_mouth(9.0, 26.0, scale=1.7, angle=0.5, size=(420, 420), seed=9)
    inner, outer = detector.likelihood(image, landmarks)
    assert crest_distance_px(outer, label.outer) < 1.7 * 1.2
    assert crest_distance_px(inner, label.inner) < 1.7 * 1.6
    assert covered_share(outer, label.outer) > 0.9


def test_closed_mouth_gives_one_inner_line(detector):
    image, landmarks, label = draw_mouth(1.0, 20.0, seed=4)
    inner, _ = detector.likelihood(image, landmarks)
    assert crest_distance_px(inner, label.inner) < 1.5


def test_saved_detector_answers_the_same(detector, tmp_path):
    detector.save(tmp_path / "detector.npz")
    again = load_detector(tmp_path / "detector.npz")
    image, landmarks, _ = draw_mouth(seed=5)
    for a, b in zip(
        detector.likelihood(image, landmarks), again.likelihood(image, landmarks), strict=True
    ):
        np.testing.assert_array_equal(a, b)


def test_training_is_repeatable(detector, tmp_path):
    frames = [LabelledFrame(*draw_mouth(6.0, 24.0, seed=1), 1)]
    small = ContourTrainingSettings(
        n_features=50, variants=2, max_samples=500, boosting=BoostingSettings(n_trees=4)
    )
    for name in ("a", "b"):
        train_detector(frames, small, seed=3).save(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_damaged_or_newer_detector_is_refused(detector, tmp_path):
    path = tmp_path / "detector.npz"
    detector.save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ModelFileError, match="unreadable"):
        load_detector(path)
    with open(path, "wb") as stream:
        np.savez(stream, format_version=99, kind="boosted")
    with pytest.raises(ModelFileError, match="format 99"):
        load_detector(path)


def test_landmark_ridge_moves_from_biased_landmarks_to_the_lips():
    image, landmarks, label = draw_mouth(10.0, 26.0, seed=2)
    mouth = landmarks[48:66].mean(axis=0)
    landmarks[48:58] = mouth + (landmarks[48:58] - mouth) * [1.0, 1.25]  # 6 px too high and low
    inner, outer = LandmarkRidgeDetector().likelihood(image, landmarks)
    assert crest_distance_px(outer, label.outer) < 2.0
    assert crest_distance_px(inner, label.inner) < 3.0


def test_landmark_ridge_on_a_flat_image_is_the_landmarks_curve():
    _, landmarks, _ = draw_mouth()
    flat = np.full((240, 240, 3), 0.2, dtype=np.float32)
    _, outer = LandmarkRidgeDetector(edge_weight=0.0).likelihood(flat, landmarks)
    loop = loop_spline(landmarks[[58, 48, 49, 50, 51, 52, 62, 53, 54, 55, 56, 57]])
    rows, columns = np.nonzero(outer > 0.3 * outer.max())
    distance, _ = cKDTree(loop).query(np.stack([columns, rows], axis=1) + 0.5)
    assert distance.max() < 4.0


def test_features_are_exact_box_sums():
    rng = np.random.default_rng(0)
    channels = rng.random((3, 30, 40)).astype(np.float32)
    pool = random_pool(60, 3, 16, rng)
    values = pool.evaluate(integral_images(channels), np.array([12, 20]), np.array([15, 9]))
    padded = np.pad(np.rint(channels * LEVELS), ((0, 0), (PAD, PAD), (PAD, PAD)), mode="edge")
    for f in range(len(pool)):
        for i, (x, y) in enumerate(((12, 15), (20, 9))):
            expected = 0.0
            for (left, top, right, bottom), weight in zip(
                pool.boxes[f], pool.weights[f], strict=True
            ):
                rows = slice(y + PAD + top, y + PAD + bottom)
                columns = slice(x + PAD + left, x + PAD + right)
                expected += weight * padded[pool.channel[f]][rows, columns].sum()
            assert values[f, i] == pytest.approx(expected, abs=1e-2)


def test_channels_do_not_depend_on_exposure():
    image = np.random.default_rng(1).uniform(0.05, 0.3, (40, 40, 3)).astype(np.float32)
    np.testing.assert_allclose(image_channels(image), image_channels(0.5 * image), atol=2e-3)


def test_boosting_learns_an_interaction_that_no_single_split_can():
    """Exclusive or of two box means: separable at depth two, not at depth one."""
    rng = np.random.default_rng(2)
    channels = rng.random((2, 64, 64)).astype(np.float32)
    pool = random_pool(1, 2, 8, rng)
    pool = type(pool)(
        np.array([0, 1], dtype=np.int16),
        np.tile(np.array([[0, 0, 1, 1], [0] * 4, [0] * 4, [0] * 4], dtype=np.int16), (2, 1, 1)),
        np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (2, 1)),
    )
    from vermilion.contours.boosting import bin_features

    integrals = integral_images(channels)
    rows, columns = (a.ravel() for a in np.mgrid[0:64, 0:64])
    labels = ((channels[0] > 0.5) != (channels[1] > 0.5)).ravel().astype(float)
    edges = bin_edges(pool.evaluate(integrals, columns, rows))
    codes = bin_features(pool, edges, integrals, columns, rows)
    wrong = {}
    for depth in (1, 3):
        settings = BoostingSettings(n_trees=40, depth=depth, sample_share=1.0, l2=1.0)
        forest = fit_forest(pool, codes, edges, labels, np.ones(len(labels)), settings, keep=1.0)
        wrong[depth] = ((forest.log_odds(integrals, columns, rows) > 0) != (labels > 0.5)).mean()
    assert wrong[3] < 0.05
    assert wrong[1] > 0.3


def test_ring_path_is_the_best_of_all_closed_paths():
    rng = np.random.default_rng(3)
    cost, smooth = rng.random((5, 4)) * 3, np.full(5, 0.4)
    paths = np.stack(np.meshgrid(*[np.arange(4)] * 5, indexing="ij"), axis=-1).reshape(-1, 5)
    total = cost[np.arange(5), paths].sum(axis=1)
    total += (smooth * (np.roll(paths, -1, axis=1) - paths) ** 2).sum(axis=1)
    found = cheapest_ring(cost, smooth)
    value = cost[np.arange(5), found].sum() + (smooth * (np.roll(found, -1) - found) ** 2).sum()
    assert value <= np.sort(total)[2]  # tied at one sample of the free optimum: near the best


def test_region_maps_there_and_back():
    _, landmarks, _ = draw_mouth(angle=0.3, scale=1.3, size=(300, 300))
    region = mouth_region(landmarks, 200.0, 0.16)
    points = np.random.default_rng(0).uniform(50, 250, (10, 2))
    np.testing.assert_allclose(region.to_image(region.to_region(points)), points, atol=1e-9)
    assert region.scale == pytest.approx(1.3)
    corners = region.to_region(landmarks[[36, 45]])
    np.testing.assert_allclose(corners[1] - corners[0], [200.0, 0.0], atol=1e-9)


def test_pasted_region_lies_where_it_was_cut():
    _, landmarks, _ = draw_mouth(angle=0.2)
    region = mouth_region(landmarks, 200.0, 0.16)
    y, x = np.mgrid[0:240, 0:240] + 0.5
    image = np.stack([x, y, x + y], axis=-1).astype(np.float32)
    back = region.paste(region.crop(image)[..., 0], (240, 240))
    assert np.abs(back - x)[140:160, 100:140].max() < 0.05


def test_dark_valley_follows_a_bent_dark_line_and_ends_where_it_ends():
    y, x = np.mgrid[0:60, 0:100] + 0.5
    centre = 30 + 3 * np.sin(x / 15)
    plane = 1 - 0.5 * np.exp(-0.5 * ((y - centre) / 1.5) ** 2) * (x < 70)
    line = dark_valley(plane, np.array([10.0, 31.0]), np.array([90.0, 30.0]), 6.0)
    assert 66 < line[:, 0].max() < 75
    assert np.abs(line[4:, 1] - (30 + 3 * np.sin(line[4:, 0] / 15))).mean() < 1.0


def test_contact_lines_run_from_the_opening_to_the_corners():
    _, _, label = draw_mouth(width=52.0, centre=(120.0, 150.0))
    left, right = contact_lines(label, np.array([1.0, 0.0]))
    np.testing.assert_allclose(left, [[81, 150], [68, 150]], atol=0.1)
    np.testing.assert_allclose(right, [[159, 150], [172, 150]], atol=0.1)


@pytest.mark.parametrize(
    "content, message",
    [
        ("{", "Expecting property name"),
        ('{"inner": {"points": [[1, 2]]}}', "inner: 1 point"),
        ('{"outer": {"points": []}}', "no contour 'inner'"),
    ],
)
def test_an_unusable_label_says_why(tmp_path, content, message):
    path = tmp_path / "000003.json"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        read_contour_label(path, camera="cam", frame=3)


def test_a_label_is_read(tmp_path):
    path = tmp_path / "000003.json"
    square = [[0, 0], [4, 0], [4, 4], [0, 4]]
    path.write_text(
        json.dumps(
            {
                "unit": "px",
                "outer": {"closed": True, "points": square},
                "inner": {"closed": False, "points": square[:2]},
            }
        )
    )
    label = read_contour_label(path)
    assert not label.inner.closed
    assert label.outer.dense(1.0)[-1] == pytest.approx([0, 0])
