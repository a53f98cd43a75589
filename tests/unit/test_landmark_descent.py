"""The trained landmark regressor on drawn faces; the networks' heat maps."""

import cv2
import numpy as np
import pytest

from tests.unit.synthetic_face import landmark_layout
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import linear_to_srgb, srgb_to_linear
from vermilion.landmarks.descent import DescentDetector, ImageSimilarity
from vermilion.landmarks.network_input import network_input
from vermilion.landmarks.networks import (
    FACE_FILE,
    NetworkDetector,
    NetworkSettings,
    decode_heat_maps,
)
from vermilion.landmarks.scheme import (
    BROWS,
    EYE_LEFT,
    EYE_RIGHT,
    JAW,
    LIP_INNER,
    LIP_OUTER,
    face_size_px,
)
from vermilion.landmarks.training import (
    LandmarkTrainingSettings,
    labelled_images,
    ridge_regression,
    train_descent,
)
from vermilion.storage.errors import InputError, ModelFileError

SETTINGS = LandmarkTrainingSettings(stages=4, perturbations=4, seed=1)


def drawn_face(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """An image (150, 180, 3), linear RGB, of a drawn face, and its landmarks (66, 2) px."""
    points = landmark_layout()[:, :2] * [1, -1]
    lower = np.array([53, 54, 55, 56, 57, 63, 64, 65])
    points[lower, 1] += rng.uniform(0, 14)
    points[:, 0] *= rng.uniform(0.9, 1.1)
    angle, scale = rng.uniform(-0.2, 0.2), rng.uniform(0.55, 0.72)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = scale * points @ turn.T + [90, 72] + rng.uniform(-15, 15, 2)
    grey = np.full((150, 180), rng.uniform(0.2, 0.5), dtype=np.float32)

    def fill(ids, value):
        polygon = np.rint((points[ids] - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(grey, [polygon], value, cv2.LINE_AA, 4)

    fill(np.concatenate([JAW, BROWS[::-1]]), 0.75)
    for eye in (EYE_RIGHT, EYE_LEFT):
        fill(eye, 0.95)
    fill(LIP_OUTER, 0.45)
    fill(LIP_INNER, 0.1)
    for brow in (BROWS[:5], BROWS[5:]):
        line = np.rint((points[brow] - 0.5) * 16).astype(np.int32)
        cv2.polylines(grey, [line.reshape(-1, 1, 2)], False, 0.25, 2, cv2.LINE_AA, 4)
    for k in (31, 33, 35, 30):
        x, y = np.rint((points[k] - 0.5) * 16).astype(int)
        cv2.circle(grey, (x, y), 24, 0.4, -1, cv2.LINE_AA, 4)
    grey += rng.normal(size=grey.shape).astype(np.float32) * 0.01
    return np.repeat(srgb_to_linear(np.clip(grey, 0, 1))[..., None], 3, axis=2), points


@pytest.fixture(scope="module")
def trained():
    rng = np.random.default_rng(0)
    faces = [drawn_face(rng) for _ in range(30)]
    return train_descent([f for f, _ in faces], np.array([p for _, p in faces]), SETTINGS)


@pytest.mark.slow
def test_faces_not_trained_on_are_found_within_two_hundredths_of_their_size(trained):
    rng = np.random.default_rng(99)
    errors = []
    for _ in range(8):
        image, points = drawn_face(rng)
        found = trained.detect(image)
        assert found.found
        errors.append(
            np.linalg.norm(found.points_px - points, axis=1).mean() / face_size_px(points)
        )
    assert np.median(errors) < 0.02
    assert max(errors) < 0.04


@pytest.mark.slow
def test_a_larger_image_gives_the_same_landmarks_scaled(trained):
    image, points = drawn_face(np.random.default_rng(5))
    large = cv2.resize(image, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)
    found = trained.detect(np.clip(large, 0, 1))
    assert found.found
    assert np.linalg.norm(found.points_px / 3 - points, axis=1).mean() < 2.5  # px


@pytest.mark.slow
def test_no_face_is_found_where_there_is_none(trained):
    rng = np.random.default_rng(1)
    blank = np.full((150, 180, 3), 0.3, dtype=np.float32)
    noise = rng.uniform(0, 1, (150, 180, 3)).astype(np.float32)
    for image in (blank, noise):
        found = trained.detect(image)
        assert not found.found and np.isnan(found.points_px).all()


@pytest.mark.slow
def test_the_model_file_gives_the_same_landmarks_and_is_versioned(trained, tmp_path):
    image, _ = drawn_face(np.random.default_rng(2))
    trained.save(tmp_path / "m.npz")
    again = DescentDetector.load(tmp_path / "m.npz")
    assert np.allclose(again.detect(image).points_px, trained.detect(image).points_px)
    arrays = dict(np.load(tmp_path / "m.npz"))
    arrays["format_version"] = np.array(99)
    np.savez(tmp_path / "new.npz", **arrays)
    with pytest.raises(ModelFileError, match="format 99"):
        DescentDetector.load(tmp_path / "new.npz")


def test_too_few_labels_are_an_error_that_says_where_to_add_them():
    with pytest.raises(InputError, match="labels/landmarks"):
        labelled_images([], 100)


def test_similarity_between_shapes_is_exact():
    points = landmark_layout()[:, :2]
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    target = 2.5 * points @ turn.T + [3.0, -7.0]
    assert np.allclose(ImageSimilarity.between(points, target)(points), target, atol=1e-9)


def test_ridge_regression_in_the_dual_is_that_in_the_primal():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(20, 6)), rng.normal(size=(20, 2))
    weights = ridge_regression(x, y, 0.3)
    xc, yc = x - x.mean(axis=0), y - y.mean(axis=0)
    ridge = 0.3 * np.trace(xc @ xc.T) / len(x)
    primal = np.linalg.solve(xc.T @ xc + ridge * np.eye(6), xc.T @ yc)
    assert np.allclose(weights[:-1], primal, atol=1e-9)
    assert np.allclose(x.mean(axis=0) @ weights[:-1] + weights[-1], y.mean(axis=0))


def test_heat_maps_are_decoded_to_their_cell_and_offset():
    field = np.full((198, 28, 28), 0.01, dtype=np.float32)
    for k in range(66):
        field[k, k % 28, (3 * k) % 28] = 0.9
    field[66:] = 0.5  # no offset
    shift = 0.02
    field[66 + 5, 5, 15] = 1 / (1 + np.exp(-16 * shift))
    points, confidence = decode_heat_maps(field)
    assert np.allclose(confidence, 0.9, atol=1e-6)
    assert np.allclose(points[4], [223 * 12 / 27, 223 * 4 / 27], atol=1e-3)
    assert points[5, 1] == pytest.approx(223 * (5 / 27 + shift), abs=0.01)


def test_networks_take_srgb_at_224_pixels_normalised_whatever_the_image_holds():
    image = np.linspace(-0.2, 1.3, 224 * 224 * 3, dtype=np.float32).reshape(224, 224, 3)
    image[5, 7] = np.nan
    planes = network_input(image)
    image[5, 7] = 0.0
    expected = (linear_to_srgb(image) - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    # A hundredth of a step of 8 bits.
    assert np.abs(planes.transpose(1, 2, 0) - expected).max() < 0.01 / 255 / 0.229
    assert network_input(np.zeros((31, 45, 3), dtype=np.float32)).shape == (3, 224, 224)


def test_missing_networks_are_named(tmp_path):
    with pytest.raises(InputError, match=FACE_FILE):
        NetworkDetector(tmp_path)


@pytest.mark.data
def test_networks_find_a_rendered_face_the_same_wherever_it_lies(data_root):
    detector = NetworkDetector(data_root / "landmarks66")
    source = open_frames(data_root / "capture-sample" / "captures" / "p1" / "phone")
    image = source.read("cam", 0)
    found = detector.detect(image)
    assert found.found and found.confidence.mean() > 0.7
    moved = detector.detect(np.pad(image, ((40, 0), (60, 0), (0, 0)), mode="edge"))
    size = face_size_px(found.points_px)
    settled = NetworkDetector(data_root / "landmarks66", NetworkSettings(passes=6)).detect(image)
    moves = np.linalg.norm(settled.points_px - found.points_px, axis=1)
    assert moves.mean() < 0.02 * size
    away = np.linalg.norm(moved.points_px - [60, 40] - found.points_px, axis=1)
    assert away.mean() < 0.02 * size
    assert not detector.detect(np.full((200, 300, 3), 0.4, dtype=np.float32)).found
