"""Views, triangulation, anchors and contact: identities and synthetic truth."""

import numpy as np
import pytest

from vermilion.geometry.camera import look_at, pinhole
from vermilion.multiview.anchors import anchor_window, choose_anchor, clip_frames_of, n_clips
from vermilion.multiview.contact import Lips, resolve_contact
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.triangulate import triangulate_landmarks
from vermilion.multiview.views import (
    load_frame,
    normalise,
)
from vermilion.storage.errors import InputError

UP = np.array([0.0, 1.0, 0.0])


def camera(name, x, y=0.0):
    return pinhole(name, 800.0, 160, 120, look_at(np.array([x, y, 500.0]), np.zeros(3), UP))


RIG = {name: camera(name, x) for name, x in (("a", -150), ("b", -30), ("c", 60), ("d", 170))}
POINTS = np.random.default_rng(0).uniform(-20, 20, (66, 3))


def seen_points():
    return np.stack([RIG[name].project(POINTS) for name in RIG])


def triangulate(points_px, confidence, distance_mm=1.0):
    return triangulate_landmarks(
        RIG, list(RIG), points_px, confidence, min_confidence=0.3, max_distance_mm=distance_mm
    )


def test_a_view_that_disagrees_is_left_out():
    pixels, confidence = seen_points(), np.full((4, 66), 0.9)
    pixels[2, 40:] += [0.0, 9.0]
    found = triangulate(pixels, confidence)
    assert np.abs(found.points_mm - POINTS).max() < 1e-6
    assert found.valid.all()
    assert (found.weights[40:] < found.weights[:40].min()).all()


def test_points_that_fewer_than_two_views_trust_are_unknown():
    confidence = np.full((4, 66), 0.9)
    confidence[1:, 5] = 0.1
    found = triangulate(seen_points(), confidence)
    assert not found.valid[5]
    assert np.isnan(found.points_mm[5]).all()
    assert found.valid.sum() == 65


class Source:
    """A frame source whose cameras can fail."""

    def __init__(self, broken=(), small=()):
        self.broken, self.small = broken, small

    def read(self, camera, frame):
        if camera in self.broken:
            raise InputError("a truncated image", "a whole image", "Export it.", camera=camera)
        size = (60, 80, 3) if camera in self.small else (120, 160, 3)
        return np.full(size, 0.5, np.float32)


def test_cameras_without_a_usable_image_are_noted_and_the_rest_go_on():
    frame = load_frame(Source(broken=("b",), small=("d",)), RIG, 7, 8.0, 0.01)
    assert list(frame.views) == ["a", "c"]
    assert "truncated" in frame.missing["b"]
    assert "80 x 60" in frame.missing["d"]


def test_a_frame_with_one_camera_left_is_an_error_with_its_number():
    with pytest.raises(InputError, match="frame 7"):
        load_frame(Source(broken=("a", "b", "c")), RIG, 7, 8.0, 0.01)


def test_the_anchor_is_the_readable_frame_most_like_the_neutral():
    similarity = np.array([0.5, np.nan, 0.85, 0.88, 0.84])
    assert choose_anchor(similarity, 0.8) == 3
    assert choose_anchor(similarity, 0.95) is None
    assert choose_anchor(np.array([np.nan]), 0.0) is None


@pytest.mark.parametrize(
    ("first", "last", "size"), [(0, 46, 24), (5, 5, 24), (0, 24, 24), (3, 99, 6)]
)
def test_windows_of_anchors_lie_in_the_take_and_apart(first, last, size):
    windows = [anchor_window(first, last, size, k) for k in range(1, n_clips(first, last, size))]
    seen = [frame for window in windows for frame in window]
    assert len(seen) == len(set(seen))
    assert all(first < frame <= last for frame in seen)


@pytest.mark.parametrize("anchors", [[8, 17, 22], [-1, 17, -1], [8, -1, -1], [-1, -1, -1]])
def test_clips_cover_a_take_once_whichever_anchors_are_missing(anchors):
    clips = [clip_frames_of(2, 30, anchors, index) for index in range(4)]
    assert [frame for frames, _ in clips for frame in frames] == list(range(2, 31))
    for frames, end in clips:
        if end is not None:
            assert anchors[end - 1] == frames[-1] + 1


def test_flow_that_does_not_lead_back_is_measured_in_pixels():
    there = np.full((20, 30, 2), [3.0, 4.0], np.float32)
    assert FlowMatcher().round_trip(there, -there).max() < 1e-5
    assert FlowMatcher().round_trip(there, 0 * there) == pytest.approx(5.0)


def plates(gap_mm):
    """Two facing plates 20 mm wide: the upper looks down, the lower looks up."""
    line = np.linspace(-10, 10, 21)
    x, y = (a.reshape(-1) for a in np.meshgrid(line, line))
    ids = np.arange(441).reshape(21, 21)
    a, b, c, d = (k.ravel() for k in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]))
    up = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    bulge = 0.5 * np.exp(-(x**2 + y**2) / 20)
    lower = np.stack([x, y, bulge], axis=1)
    upper = np.stack([x, y, gap_mm - bulge + 1.0], axis=1)
    lips = Lips(np.arange(441), np.arange(441, 882))
    return np.concatenate([upper, lower]), np.concatenate([up[:, ::-1], up + 441]), lips


def test_lips_apart_are_left_alone():
    vertices, triangles, lips = plates(0.1)
    found = resolve_contact(vertices, triangles, lips, np.ones(882))
    assert found.penetrating == 0
    assert np.array_equal(found.vertices_mm, vertices)


def test_lips_that_pass_through_each_other_are_parted_and_counted():
    vertices, triangles, lips = plates(-0.4)
    mobility = np.concatenate([np.full(441, 1.0), np.full(441, 0.2)])
    found = resolve_contact(vertices, triangles, lips, mobility)
    assert found.penetrating > 10
    assert found.deepest_mm == pytest.approx(0.4, abs=0.02)
    gap = found.vertices_mm[:441, 2] - found.vertices_mm[441:, 2]
    assert gap.min() > -0.05
    moved = np.abs(found.vertices_mm - vertices)[:, 2]
    assert moved[:441].max() > 3 * moved[441:].max()  # what cameras see moves less
    assert moved.max() < 0.6


def test_exposure_changes_nothing_where_there_is_texture():
    rng = np.random.default_rng(0)
    grey = (0.4 + 0.15 * rng.normal(size=(80, 90))).clip(0, 1).astype(np.float32)
    a, b = normalise(grey, 6.0, 0.005), normalise(0.6 * grey + 0.1, 6.0, 0.005)
    assert np.abs(a.astype(int) - b).mean() < 1.5  # grey levels of 255
    assert a.std() > 25
