"""Blinks and closing lips stay whole, still faces stay still, cuts are not smoothed across."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests import heads
from vermilion.tracking.image_fit.smooth_over_time import smooth_over_time
from vermilion.tracking.landmark_fit.expression import N_POSE, LandmarkFitSettings, fit_motion
from vermilion.tracking.landmark_fit.observation import Observations, project
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.landmark_fit.timeline import Timeline

FOCAL_PX, FPS, N_FRAMES = 1400.0, 25.0, 40
SETTINGS = LandmarkFitSettings()
#: As before fast motion was let through.
PLAIN = LandmarkFitSettings(weight_acceleration=60.0, fast_limit=1e9, lid_weight_sigma=0.5)
#: Noise of a sharp video, in the landmarks' deviations.
QUIET = 0.3
BLINK = [0.0, 0.6, 1.0, 0.5, 0.0]


@cache
def shape() -> LandmarkShape:
    return LandmarkShape.of(heads.small_tracker())


def names() -> tuple[str, ...]:
    return shape().expression_names


def lids() -> list[int]:
    return [k for k, name in enumerate(names()) if name.startswith("eyeBlink")]


def jaw() -> int:
    return names().index("jawOpen")


def blinking():
    weights = np.zeros((N_FRAMES, len(names())))
    weights[17:22, lids()] = np.array(BLINK)[:, None]
    return weights


def closing():
    """An open mouth whose lips close for one frame."""
    weights = np.zeros((N_FRAMES, len(names())))
    weights[:, jaw()] = 0.25
    weights[20, jaw()] = 0.0
    return weights


def images(weights, noise=0.0, seed=0, depth_mm=700.0):
    points = shape().points(weights) * [1, -1, -1] + np.array([0, 0, 1.0]) * depth_mm
    image = project(points, FOCAL_PX)
    sigma_px = shape().sigma_mm(SETTINGS.noise)[:, None] * FOCAL_PX / 700.0
    image = image + noise * sigma_px * np.random.default_rng(seed).normal(size=image.shape)
    n = len(image)
    return Observations(image, np.ones((n, 66)), np.ones(n, dtype=bool))


def fitted(weights, noise=0.0, settings=SETTINGS, seed=0):
    return fit_motion(shape(), images(weights, noise, seed), FOCAL_PX, FPS, settings).weights


@cache
def blink_and_closing(noise, settings=SETTINGS):
    """Lids and jaw, (F,) each, of a take in which the eyes blink at frame 10 and the lips close at frame 30."""
    seen = np.roll(blinking(), -9, axis=0) + np.roll(closing(), 10, axis=0)
    found = fitted(seen, noise, settings)
    return found[:, lids()].mean(axis=1), found[:, jaw()]


def jitter(weights):
    return float(np.abs(np.diff(weights, n=2, axis=0)).mean())


@pytest.mark.parametrize("noise", [0.0, QUIET])
def test_a_blink_comes_back(noise):
    found = blink_and_closing(noise)[0][8:13]
    assert np.abs(found - BLINK).max() < 0.05
    assert blink_and_closing(noise, PLAIN)[0][10] < 0.7  # smoothness alone loses it


@pytest.mark.parametrize("noise", [0.0, QUIET])
def test_lips_that_close_for_one_frame_close(noise):
    found = blink_and_closing(noise)[1][29:32]
    assert np.abs(found - [0.25, 0.0, 0.25]).max() < 0.05
    assert blink_and_closing(noise, PLAIN)[1][30] > 0.06


@pytest.mark.parametrize("noise", [QUIET, 1.0])
def test_a_still_face_does_not_shake_more_than_with_smoothness_alone(noise):
    still = np.zeros((N_FRAMES, len(names())))
    shaken = [jitter(fitted(still, noise, seed=seed)) for seed in range(2)]
    before = [jitter(fitted(still, noise, PLAIN, seed)) for seed in range(2)]
    assert np.mean(shaken) < np.mean(before)


def joined(weights, settings, piece=None):
    """Frames that images tell of, each by itself, joined over time as after the image fit."""
    x = np.concatenate([np.zeros((len(weights), N_POSE)), weights], axis=1)
    matrices = np.tile(400.0 * np.eye(x.shape[1]), (len(x), 1, 1))
    known = np.ones(len(x), dtype=bool)
    timeline = Timeline.of(len(x), FPS, piece)
    smooth = settings.smoothness(shape(), timeline, known, weights)
    return smooth_over_time(matrices, 400.0 * x, x, known, smooth)[:, N_POSE:]


def test_the_join_of_the_image_fit_keeps_both():
    join = replace(SETTINGS, weight_acceleration=15.0, translation_acceleration_mm=200.0)
    noise = 0.01 * np.random.default_rng(1).normal(size=(N_FRAMES, len(names())))
    found = joined(np.clip(blinking() + noise, 0, 1), join)[17:22, lids()].mean(axis=1)
    assert np.abs(found - BLINK).max() < 0.05
    assert abs(joined(np.clip(closing() + noise, 0, 1), join)[20, jaw()]) < 0.05
    still = np.abs(noise)
    held = replace(join, fast_limit=1e9)
    assert jitter(joined(still, join)) < 1.02 * jitter(joined(still, held)) < 0.1 * jitter(still)
    assert joined(blinking(), held)[19, lids()].max() < 0.7


def test_nothing_is_smoothed_across_a_cut():
    weights = np.zeros((N_FRAMES, len(names())))
    weights[:20, names().index("browOuterUp_L")] = 0.8  # slow shapes too
    seen = images(weights, depth_mm=np.where(np.arange(N_FRAMES) < 20, 700.0, 900.0)[:, None, None])
    piece = np.repeat([0, 1], 20)
    cut = fit_motion(shape(), seen, FOCAL_PX, Timeline.of(N_FRAMES, FPS, piece), SETTINGS)
    alone = [
        fit_motion(shape(), seen[np.arange(*part)], FOCAL_PX, FPS, SETTINGS)
        for part in ((0, 20), (20, 40))
    ]
    depth = np.concatenate([part.translation_mm[:, 2] for part in alone])
    assert np.abs(cut.translation_mm[:, 2] - depth).max() < 0.5
    assert np.abs(cut.weights - np.concatenate([part.weights for part in alone])).max() < 0.01
    whole = fit_motion(shape(), seen, FOCAL_PX, FPS, SETTINGS)
    assert np.abs(whole.translation_mm[:, 2] - depth).max() > 5.0


def test_frames_without_a_face_are_filled_from_their_own_piece():
    seen = images(
        np.zeros((N_FRAMES, len(names()))),
        depth_mm=np.where(np.arange(N_FRAMES) < 20, 700.0, 900.0)[:, None, None],
    )
    for rows in (slice(15, 20), slice(20, 24)):
        seen.valid[rows], seen.trust[rows] = False, 0.0
    timeline = Timeline.of(N_FRAMES, FPS, np.repeat([0, 1], 20))
    depth = fit_motion(shape(), seen, FOCAL_PX, timeline, SETTINGS).translation_mm[:, 2]
    assert np.abs(depth[15:20] - depth[10]).max() < 2.0
    assert np.abs(depth[20:24] - depth[30]).max() < 2.0


def test_uneven_frames_are_smoothed_over_their_times():
    times = np.arange(60)[np.arange(60) % 3 != 2] / 25.0  # every third frame is missing
    timeline = Timeline.of(len(times), 25.0, times_s=times)
    parabola = 3.0 * times**2
    stencil = timeline.stencils
    found = sum(stencil[:, k] * parabola[k : len(times) - 2 + k] for k in range(3))
    assert np.allclose(found, 6.0)
    even = Timeline.of(5, 25.0).stencils
    assert np.allclose(even, 625.0 * np.array([1, -2, 1]))
