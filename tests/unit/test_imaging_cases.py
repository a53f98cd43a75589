"""The case files of the data folder give what its README says."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.unit.small_videos import mean_difference
from vermilion.capture.video_facts import rate_warning, video_facts
from vermilion.external.read import read_tracked
from vermilion.geometry.camera import read_cameras
from vermilion.imaging.frames import list_frames
from vermilion.imaging.images import ImageReading, linear_to_srgb, read_image
from vermilion.imaging.video import VideoReader
from vermilion.storage.errors import InputError

pytestmark = pytest.mark.data


@pytest.fixture(scope="module")
def cases(data_root):
    return data_root / "cases"


@pytest.fixture(scope="module")
def case_video(cases):
    """Reader of a case by its name, kept open."""
    return cache(lambda name: VideoReader(cases / f"{name}.mp4"))


@pytest.fixture(scope="module")
def address(data_root):
    return VideoReader(data_root / "video" / "address.mp4")


def shown(path, **reading):
    return linear_to_srgb(read_image(path, ImageReading(**reading))) * 255


def test_a_portrait_is_the_plain_one(cases):
    tagged = VideoReader(cases / "portrait_tagged.mp4")
    plain = VideoReader(cases / "portrait_plain.mp4")
    assert tagged.size == plain.size == (480, 720) and tagged.n_frames == plain.n_frames
    for frame in (31, 0, 49):
        assert mean_difference(tagged.read(frame), plain.read(frame)) < 2  # display values


@pytest.mark.parametrize(
    ("name", "frame", "same"),
    [  # by frames of the plain one: each reader goes forward, once
        ("hdr_pq", 0, 0),
        ("variable_rate", 2, 4),
        ("hdr_pq", 20, 20),
        ("anamorphic", 20, 20),
        ("interlaced", 10, 20),
        ("variable_rate", 40, 61),
        ("interlaced", 49, 98),
    ],
)
def test_video_gives_the_images_of_the_plain_one(case_video, address, name, frame, same):
    reader = case_video(name)
    assert reader.size == (1280, 720)
    difference = np.abs(reader.read(frame).astype(int) - address.read(same))
    assert difference.mean() < 2.6 and np.percentile(difference, 95) <= 7  # display values


def test_times_of_a_variable_rate_are_kept_and_said(cases):
    facts = video_facts(cases / "variable_rate.mp4")
    assert set(np.rint(np.diff(facts.times_s) * 25).astype(int)) == {1, 2}
    assert "0.040 to 0.080 s apart" in rate_warning(facts, 25)


@pytest.mark.parametrize(
    ("name", "largest"),
    [("rgba.png", 1), ("sixteen_bit.png", 1), ("plain.dpx", 0.1), ("overscan.exr", 0.2)],
)
def test_images_are_the_plain_one(cases, name, largest):
    difference = np.abs(shown(cases / "images" / name) - shown(cases / "images/plain.png"))
    assert difference.max() <= largest  # display values


def test_images_that_are_turned_grey_cut_or_layered(cases):
    images = cases / "images"
    plain = shown(images / "plain.png")
    assert mean_difference(shown(images / "exif_orientation_6.jpg"), plain) < 2
    grey = shown(images / "grey_alpha.png")
    assert grey.shape == plain.shape and (np.ptp(grey, axis=2) == 0).all()
    assert mean_difference(grey.mean(axis=2), plain @ [0.299, 0.587, 0.114]) < 3
    cut = shown(images / "cropped_data_window.exr")
    assert np.abs(cut[20:160, 40:280] - plain[20:160, 40:280]).max() < 0.2
    assert cut[:20].max() == cut[160:].max() == cut[:, :40].max() == cut[:, 280:].max() == 0
    assert np.abs(shown(images / "layers.exr", exr_layer="beauty") - plain).max() < 0.2
    with pytest.raises(InputError, match="'beauty', 'normal'"):
        read_image(images / "layers.exr")


def test_numbered_files_are_found(cases):
    assert list(list_frames(cases / "numbered")) == [1, 2, 3]
    assert read_tracked(cases / "numbered", [0, 1, 2, 3]).vertices_mm.shape[0] == 4


@pytest.mark.parametrize("name", ["colmap_folders", "colmap_binary"])
def test_colmap_models_are_those_of_the_sample(cases, data_root, name):
    expected = read_cameras(data_root / "capture-sample/captures/p1/rom/cameras")
    cameras = read_cameras(cases / name)
    assert list(cameras) == list(expected)
    for camera in expected:
        assert np.allclose(
            cameras[camera].cam_from_world, expected[camera].cam_from_world, atol=1e-6
        )
