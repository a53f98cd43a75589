"""Pose and blend weights of a known face under known motion."""

import numpy as np
import pytest

from tests.unit.synthetic_face import synthetic_model
from vermilion.geometry.rotations import rotation_matrix, rotation_vector
from vermilion.storage.errors import InputError
from vermilion.tracking.landmark_fit.expression import LandmarkFitSettings, fit_motion
from vermilion.tracking.landmark_fit.observation import Observations, project
from vermilion.tracking.landmark_fit.shape import LandmarkShape

FOCAL_PX, FPS, N_FRAMES = 1400.0, 30.0, 40
SHAPE = LandmarkShape.of(synthetic_model())
LOOSE = LandmarkFitSettings(
    weight_sigma=100.0,
    weight_acceleration=1e9,
    rotation_acceleration_deg=1e9,
    translation_acceleration_mm=1e9,
    jaw_slide=1.0,
)


def true_motion(n_frames=N_FRAMES):
    """A head that turns and nods while it opens its mouth and smiles."""
    t = np.linspace(0, 2 * np.pi, n_frames)[:, None]
    vectors = np.concatenate([0.15 * np.sin(t), 0.35 * np.sin(t + 1), 0.1 * np.cos(t)], axis=1)
    rotation = rotation_matrix(vectors) @ np.diag([1.0, -1.0, -1.0])
    translation = np.concatenate([20 * np.sin(t), 10 * np.cos(t), 700 + 30 * np.sin(t)], axis=1)
    phases = np.arange(6)
    weights = np.clip(0.5 + 0.6 * np.sin(2 * t + phases), 0, 1)
    return rotation, translation, weights


def images(rotation, translation, weights, noise_px=0.0, seed=0):
    points = SHAPE.points(weights) @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    image = project(points, FOCAL_PX)
    image = image + noise_px * np.random.default_rng(seed).normal(size=image.shape)
    n = len(image)
    return Observations(image, np.ones((n, 66)), np.ones(n, dtype=bool))


def angle_deg(a, b):
    return np.degrees(np.linalg.norm(rotation_vector(a @ np.swapaxes(b, 1, 2)), axis=1))


def test_clean_landmarks_give_pose_and_weights_back():
    truth = true_motion()
    found = fit_motion(SHAPE, images(*truth), FOCAL_PX, FPS, LOOSE)
    assert angle_deg(found.rotation, truth[0]).max() < 0.05
    assert np.abs(found.translation_mm - truth[1]).max() < 0.5
    assert np.abs(found.weights - truth[2]).max() < 0.01
    assert found.reprojection_px.max() < 0.05


def test_noisy_landmarks_cost_little_with_neutral_settings():
    truth = true_motion()
    found = fit_motion(SHAPE, images(*truth, noise_px=2.0), FOCAL_PX, FPS)
    assert angle_deg(found.rotation, truth[0]).max() < 2.5
    assert np.abs(found.weights - truth[2]).mean() < 0.06
    lateral_mm = np.abs(found.translation_mm - truth[1])[:, :2]
    assert lateral_mm.mean() < 1.5


def test_weights_stay_in_the_box_where_the_face_leaves_it():
    rotation, translation, weights = true_motion()
    weights = 2.5 * weights - 0.75
    found = fit_motion(SHAPE, images(rotation, translation, weights), FOCAL_PX, FPS, LOOSE)
    assert found.weights.min() >= 0.0
    assert found.weights.max() <= 1.0
    assert found.weights.max() == pytest.approx(1.0)


def test_one_bad_landmark_does_not_move_the_head():
    rotation, translation, weights = true_motion()
    seen = images(rotation, translation, weights)
    seen.image[:, 30] += [120.0, -80.0]
    found = fit_motion(SHAPE, seen, FOCAL_PX, FPS)
    clean = fit_motion(SHAPE, images(rotation, translation, weights), FOCAL_PX, FPS)
    assert angle_deg(found.rotation, clean.rotation).max() < 0.6
    assert np.abs(found.weights - clean.weights).mean() < 0.02


def test_smoothing_has_no_lag():
    """The same frames in reverse give the same motion in reverse."""
    truth = true_motion()
    seen = images(*truth, noise_px=2.0)
    settings = LandmarkFitSettings(weight_acceleration=10.0, iterations=60, tolerance_mm=1e-5)
    found = fit_motion(SHAPE, seen, FOCAL_PX, FPS, settings)
    back = fit_motion(SHAPE, seen[np.arange(N_FRAMES)[::-1]], FOCAL_PX, FPS, settings)
    assert np.abs(found.weights - back.weights[::-1]).max() < 1e-3
    assert np.abs(found.translation_mm - back.translation_mm[::-1]).max() < 0.02


def test_smoothing_lowers_jitter():
    truth = true_motion()
    seen = images(*truth, noise_px=2.0)
    rough = fit_motion(SHAPE, seen, FOCAL_PX, FPS, LOOSE)
    smooth = fit_motion(SHAPE, seen, FOCAL_PX, FPS)

    def jitter(motion):
        return np.abs(np.diff(motion.weights, n=2, axis=0)).mean()

    assert jitter(smooth) < 0.7 * jitter(rough)


def test_frames_without_landmarks_are_interpolated():
    rotation, translation, weights = true_motion()
    seen = images(rotation, translation, weights)
    gap = slice(18, 21)
    seen.valid[gap], seen.trust[gap], seen.image[gap] = False, 0.0, 0.0
    found = fit_motion(SHAPE, seen, FOCAL_PX, FPS)
    assert np.isnan(found.reprojection_px[gap]).all()
    assert angle_deg(found.rotation[gap], rotation[gap]).max() < 3.0
    assert np.abs(found.translation_mm[gap] - translation[gap]).max() < 8.0


def test_frames_without_landmarks_at_the_ends_hold_still():
    rotation, translation, weights = true_motion()
    seen = images(rotation, translation, weights)
    seen.valid[-10:], seen.trust[-10:] = False, 0.0
    found = fit_motion(SHAPE, seen, FOCAL_PX, FPS)
    assert np.abs(found.translation_mm[-10:] - found.translation_mm[-11]).max() < 1.0


def test_no_landmarks_at_all_is_an_error_that_says_what_to_do():
    seen = images(*true_motion(3))
    seen.valid[:] = False
    with pytest.raises(InputError, match="landmark overlays"):
        fit_motion(SHAPE, seen, FOCAL_PX, FPS)


def test_a_single_frame_is_enough():
    truth = true_motion(1)
    found = fit_motion(SHAPE, images(*truth), FOCAL_PX, FPS, LOOSE)
    assert np.abs(found.weights - truth[2]).max() < 0.01
