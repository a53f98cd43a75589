"""Images and frames: linear light, exact frames, errors that name the place."""

import time

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vermilion.imaging.display import srgb8
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import (
    image_size,
    linear_to_srgb,
    read_channels,
    read_image,
    srgb_to_linear,
    write_channels,
    write_image,
    write_srgb8,
)
from vermilion.imaging.video import VideoReader, write_video
from vermilion.storage.errors import InputError


@given(st.floats(0, 1))
def test_srgb_is_inverted(value):
    assert abs(float(linear_to_srgb(srgb_to_linear(value))) - value) < 1e-5


def test_mid_grey_is_darker_in_linear_light():
    assert np.isclose(float(srgb_to_linear(0.5)), 0.21404, atol=1e-4)


@pytest.mark.parametrize(("suffix", "step"), [(".png", 1 / 255), (".exr", 1e-3)])
def test_image_round_trip(tmp_path, suffix, step):
    linear = np.random.default_rng(0).uniform(0, 1, (17, 23, 3)).astype(np.float32)
    path = tmp_path / f"image{suffix}"
    write_image(path, linear)
    assert image_size(path) == (23, 17)
    assert np.abs(linear_to_srgb(read_image(path)) - linear_to_srgb(linear)).max() <= step


def test_channels_keep_their_names(tmp_path):
    inner = np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)
    write_channels(tmp_path / "map.exr", {"inner": inner, "outer": 1 - inner})
    back = read_channels(tmp_path / "map.exr")
    assert set(back) == {"inner", "outer"}
    assert np.abs(back["inner"] - inner).max() < 1e-3


@pytest.mark.slow
def test_the_same_image_gives_the_same_bytes_at_another_time(tmp_path):
    linear = np.random.default_rng(0).uniform(0, 1, (16, 16, 3))
    suffixes = (".png", ".jpg", ".tif", ".exr", ".hdr")
    for name in ("first", "second"):
        for suffix in suffixes:
            write_image(tmp_path / f"{name}{suffix}", linear)
        write_channels(tmp_path / f"{name}_map.exr", {"inner": linear[..., 0]})
        write_video(tmp_path / f"{name}.mp4", [np.rint(linear * 255).astype(np.uint8)] * 3, 25)
        time.sleep(1.01)  # headers give the time in seconds
    firsts = sorted(tmp_path.glob("first*"))
    assert len(firsts) == len(suffixes) + 2
    for first in firsts:
        second = first.with_name(first.name.replace("first", "second"))
        assert first.read_bytes() == second.read_bytes(), first.name


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".exr"])
def test_an_image_names_no_time_host_user_or_program(tmp_path, suffix):
    write_image(tmp_path / f"a{suffix}", np.zeros((4, 4, 3)))
    image = oiio.ImageInput.open(str(tmp_path / f"a{suffix}"))
    named = {attribute.name for attribute in image.spec().extra_attribs}
    assert not named & {"DateTime", "HostComputer", "Artist", "Copyright", "Software"}


def test_truncated_image_is_named(tmp_path):
    path = tmp_path / "frames" / "face2" / "000004.png"
    path.parent.mkdir(parents=True)
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    write_srgb8(path, noise)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError) as error:
        open_frames(tmp_path, "anna", "rom").read("face2", 4)
    for fact in ("subject anna", "take rom", "camera face2", "frame 4", "000004.png", "truncated"):
        assert fact in str(error.value)


def test_missing_frame_and_camera_are_named(tmp_path):
    write_srgb8(tmp_path / "frames" / "a" / "000001.png", np.zeros((4, 4, 3), np.uint8))
    frames = open_frames(tmp_path, "anna", "rom")
    with pytest.raises(InputError, match=r"frame 2.*no image of this frame"):
        frames.read("a", 2)
    with pytest.raises(InputError, match=r"camera b.*no such folder"):
        frames.read("b", 1)


def test_every_frame_of_a_video_is_the_right_one(tmp_path):
    def image(i):
        return np.full((48, 64, 3), 10 * i + 20, dtype=np.uint8)

    write_video(tmp_path / "clip.mp4", [image(i) for i in range(20)], fps=25)
    reader = VideoReader(tmp_path / "clip.mp4")
    assert (reader.n_frames, reader.size, reader.fps) == (20, (64, 48), 25.0)
    for i in (7, 3, 19, 0, 4, 5, 18):  # forth and back
        assert abs(float(reader.read(i).mean()) - (10 * i + 20)) < 4
    with pytest.raises(InputError, match="a video of 20 frames"):
        reader.read(20)


def test_file_that_is_no_video_is_named(tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"not a video")
    with pytest.raises(InputError, match=r"clip\.mp4.*unreadable video"):
        VideoReader(path)


def test_same_images_give_the_same_video_whatever_lies_in_memory(tmp_path):
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.integers(0, 255, (729, 1133, 3), dtype=np.uint8), (0, 0), 5)
    images = [noise[i : i + 689, i : i + 1093] for i in range(4)]
    path, written = tmp_path / "a.mp4", set()
    for value in range(6):
        litter = [np.full(size, value, np.uint8) for size in rng.integers(1_000, 3_000_000, 30)]
        del litter
        write_video(path, images, fps=30)
        written.add(path.read_bytes())
    assert len(written) == 1
    assert VideoReader(path).size == (1092, 688)


def test_bytes_come_back_from_linear_light_and_what_is_beyond_is_cut_off():
    bytes_ = np.arange(256, dtype=np.uint8)[None, :, None].repeat(3, axis=2)
    np.testing.assert_array_equal(srgb8(srgb_to_linear(bytes_ / 255.0)), bytes_)
    odd = np.array([[[np.nan, -1.0, 7.0]]])
    np.testing.assert_array_equal(srgb8(odd), [[[0, 0, 255]]])
    light = np.linspace(0, 1, 3000).reshape(10, 100, 3)
    exact = np.rint(linear_to_srgb(light) * 255)
    assert np.abs(srgb8(light) - exact).max() <= 1.0


def test_large_images_are_shown_as_small_ones():
    noise = np.random.default_rng(0).normal(0.5, 0.4, (100, 1340, 3)).astype(np.float32)
    noise[3, :7] = np.nan
    large = np.tile(noise, (10, 1, 1))
    np.testing.assert_array_equal(srgb8(large), np.tile(srgb8(noise), (10, 1, 1)))
