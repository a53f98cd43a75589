"""Landmarks corrected by flow between key frames, on an image that moves as a whole."""

import cv2
import numpy as np
import pytest

from tests.unit.test_landmark_descent import drawn_face
from vermilion.imaging.images import linear_to_srgb
from vermilion.landmarks.correct_key_frames import correct_key_frames
from vermilion.landmarks.correction import (
    FILLED,
    LandmarkCorrectionSettings,
    correct_landmarks,
    flow_points,
)
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.key_frames import BETWEEN, GIVEN, NEUTRAL, KeyFrames, find_key_frames
from vermilion.storage.errors import InputError

N_FRAMES, STEP_PX = 7, np.array([1.5, -0.75])
SETTINGS = LandmarkCorrectionSettings(face_px=90.0)


@pytest.fixture(scope="module")
def clip():
    """Images of a textured face that moves evenly, and its true landmarks."""
    rng = np.random.default_rng(2)
    image, points = drawn_face(rng)
    grey = linear_to_srgb(image).mean(axis=2).astype(np.float32)
    texture = cv2.GaussianBlur(rng.normal(size=grey.shape).astype(np.float32), (0, 0), 1.5)
    grey = np.clip(grey + 0.5 * texture, 0, 1)
    greys, truth = [], []
    for frame in range(N_FRAMES):
        move = np.hstack([np.eye(2), (frame * STEP_PX)[:, None]])
        size = grey.shape[::-1]
        greys.append(cv2.warpAffine(grey, move, size, borderMode=cv2.BORDER_REFLECT))
        truth.append(points + frame * STEP_PX)
    return greys, np.array(truth)


def detected(truth, noise_px=3.0):
    """A track with noise in all frames but the first and the last."""
    noise = np.random.default_rng(7).normal(size=truth.shape) * noise_px
    noise[[0, -1]] = 0
    frames = np.arange(len(truth))
    confidence = np.full(truth.shape[:2], 0.9)
    return LandmarkTrack(frames, truth + noise, confidence, np.ones(len(truth), bool))


def key_frames(points, rows, kinds):
    n = N_FRAMES
    return KeyFrames(
        np.array(rows), points[rows], np.array(kinds), np.arange(n), np.zeros(n), np.zeros(n)
    )


def reader(greys, unreadable=()):
    def read(frame):
        if frame in unreadable:
            raise InputError("a damaged image", "an image", "Export it again.", frame=frame)
        return greys[frame]

    return read


def without_face(track, rows):
    valid = ~np.isin(track.frames, rows)
    points = np.where(valid[:, None, None], track.points_px, np.nan)
    return LandmarkTrack(track.frames, points, track.confidence * valid[:, None], valid)


def test_flow_is_exact_at_key_frames_and_linear_between(clip):
    greys, truth = clip
    keys = key_frames(truth, [0, N_FRAMES - 1], [NEUTRAL, BETWEEN])
    track = detected(truth)
    flow = flow_points(reader(greys), track, keys, np.arange(N_FRAMES), SETTINGS)
    assert np.array_equal(flow.points_px[[0, -1]], truth[[0, -1]])
    assert (flow.confidence[[0, -1]] == 1).all()
    error_px = np.linalg.norm(flow.points_px - truth, axis=-1)
    assert np.median(error_px) < 0.15 and error_px[:, 17:].mean() < 0.3


def test_correction_is_nearer_to_the_truth_and_keeps_the_key_frames(clip):
    greys, truth = clip
    track = detected(truth)
    keys = key_frames(track.points_px, [0, N_FRAMES - 1], [NEUTRAL, BETWEEN])
    found, rows = correct_landmarks(reader(greys), track, keys, track.frames, SETTINGS)
    assert np.allclose(found.points_px[[0, -1]], truth[[0, -1]])
    raw_px = np.linalg.norm(track.points_px - truth, axis=-1)[1:-1]
    left_px = np.linalg.norm(found.points_px - truth, axis=-1)[1:-1]
    assert left_px[:, 48:59].mean() < 0.3 * raw_px[:, 48:59].mean()  # mouth, lambda 0.1
    assert 0.4 < left_px[:, 36:48].mean() / raw_px[:, 36:48].mean() < 0.7  # eyes, lambda 0.5
    assert rows[0].figures["correction_px"] == pytest.approx(0, abs=1e-6)
    assert rows[2].figures["correction_px"] > 1


def test_weights_are_those_of_the_paper_but_on_the_inner_lips():
    weights = LandmarkCorrectionSettings().per_landmark()
    inner = [59, 60, 61, 63, 64, 65]
    outer = np.setdiff1d(np.arange(48, 66), inner)  # with both mouth corners
    assert (weights[outer] == 0.1).all() and (weights[inner] == 0.5).all()
    assert (weights[36:48] == 0.5).all() and (weights[:36] == 0.2).all()


def test_frames_do_not_depend_on_the_chunk(clip):
    greys, truth = clip
    track = detected(truth)
    keys = key_frames(track.points_px, [0, 3], [NEUTRAL, BETWEEN])
    whole, _ = correct_landmarks(reader(greys), track, keys, np.arange(N_FRAMES), SETTINGS)
    for chunk in ([0, 1], [2], [3, 4, 5, 6]):
        part, _ = correct_landmarks(reader(greys), track, keys, np.array(chunk), SETTINGS)
        assert np.array_equal(part.points_px, whole.points_px[chunk])


def test_a_frame_without_a_face_is_filled_and_says_so(clip):
    greys, truth = clip
    track = without_face(detected(truth), [3])
    keys = key_frames(track.points_px, [0, N_FRAMES - 1], [NEUTRAL, BETWEEN])
    found, rows = correct_landmarks(reader(greys), track, keys, track.frames, SETTINGS)
    assert found.valid.all() and rows[3].reason == FILLED
    assert np.linalg.norm(found.points_px[3] - truth[3], axis=-1).mean() < 0.4


def test_a_damaged_image_stays_without_landmarks_and_flow_goes_past_it(clip):
    greys, truth = clip
    track = without_face(detected(truth), [3])
    keys = key_frames(track.points_px, [0], [NEUTRAL])
    found, rows = correct_landmarks(reader(greys, [3]), track, keys, track.frames, SETTINGS)
    assert list(found.valid) == [True] * 3 + [False] + [True] * 3
    assert np.isnan(found.points_px[3]).all() and not rows[3].valid and rows[3].reason
    assert np.linalg.norm(found.points_px[5] - truth[5], axis=-1)[48:].mean() < 1


def test_given_points_count_and_the_detector_loses_its_offset(clip):
    greys, truth = clip
    track = detected(truth + 6.0, noise_px=0.0)
    keys = find_key_frames(reader(greys), track, {0: truth[0]})
    assert list(keys.kinds) == [GIVEN]
    found, _ = correct_landmarks(reader(greys), track, keys, track.frames, SETTINGS)
    assert np.array_equal(found.points_px[0], truth[0])
    assert np.linalg.norm(found.points_px - truth, axis=-1).mean() < 0.3


def test_key_frames_survive_a_file(clip, tmp_path):
    greys, truth = clip
    keys = find_key_frames(reader(greys), detected(truth), {})
    keys.save(tmp_path / "keys.npz")
    back = KeyFrames.load(tmp_path / "keys.npz")
    assert list(back.frames) == [0] and list(back.kinds) == [NEUTRAL]
    assert keys.region_distance[0] == 0 and (keys.region_distance[1:] > 0).all()
    assert np.array_equal(back.points_px, keys.points_px)


@pytest.mark.parametrize("last", [NEUTRAL, BETWEEN])
def test_a_wrong_key_frame_inside_a_clip_ends_near_the_truth(clip, last):
    greys, truth = clip
    track = detected(truth, noise_px=0.0)
    track.points_px[3] += 10.0  # where the patches misled; with `last` between, one way only
    keys = key_frames(track.points_px, [0, 3, N_FRAMES - 1], [NEUTRAL, BETWEEN, last])
    settled = correct_key_frames(reader(greys), track, keys, SETTINGS)
    error_px = np.linalg.norm(settled.points_px[1] - truth[3], axis=-1)
    wrong_px = np.hypot(10, 10)
    assert error_px[48:59].mean() < 0.15 * wrong_px  # lambda 0.1
    assert np.array_equal(settled.points_px[0], keys.points_px[0])
    before, _ = correct_landmarks(reader(greys), track, keys, [2, 4], SETTINGS)
    after, _ = correct_landmarks(reader(greys), track, settled, [2, 4], SETTINGS)
    mouth_px = [
        np.linalg.norm(t.points_px - truth[[2, 4]], axis=-1)[:, 48:59].mean()
        for t in (before, after)
    ]
    assert mouth_px[1] < 0.2 * mouth_px[0]


def test_given_and_neutral_key_frames_are_not_settled(clip):
    greys, truth = clip
    track = detected(truth)
    keys = key_frames(track.points_px, [0, 3, 5], [GIVEN, NEUTRAL, NEUTRAL])
    assert correct_key_frames(reader(greys), track, keys, SETTINGS) is keys


def test_where_flow_is_lost_the_detector_settles(clip):
    greys, truth = clip
    rng = np.random.default_rng(5)
    others = [rng.uniform(size=grey.shape).astype(np.float32) for grey in greys]
    track = detected(truth, noise_px=0.0)
    keys = key_frames(track.points_px, [0, 6], [NEUTRAL, BETWEEN])
    lost = correct_key_frames(
        reader(others), track, keys, LandmarkCorrectionSettings(face_px=90.0, mouth=0.5)
    )
    moved_px = np.linalg.norm(lost.points_px[1] - truth[6], axis=-1)
    assert np.median(moved_px) < 2.0


def test_a_take_without_a_face_stays_as_it_is(clip):
    greys, truth = clip
    track = without_face(detected(truth), list(range(N_FRAMES)))
    keys = find_key_frames(reader(greys), track, {})
    found, rows = correct_landmarks(reader(greys), track, keys, track.frames, SETTINGS)
    assert not found.valid.any() and not any(row.valid for row in rows)
