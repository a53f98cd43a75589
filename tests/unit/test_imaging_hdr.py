"""HDR video looks as the SDR video that it was made from; its curves are those of BT.2100."""

from __future__ import annotations

import av
import numpy as np
import pytest
from av.video.reformatter import Colorspace

from tests.unit.small_videos import mean_difference, scene, write_clip
from vermilion.imaging.tone_mapping import (
    hlg_to_scene,
    light_of,
    pq_to_nits,
    reference_white,
    tone_map,
)
from vermilion.imaging.video import VideoReader

#: Linear BT.2020 and Display P3 from linear BT.709.
TO_2020 = np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]])
TO_P3 = np.array([[0.8225, 0.1775, 0.0], [0.0332, 0.9668, 0.0], [0.0171, 0.0724, 0.9105]])
HDR = {"colorspace": 9, "color_range": 1, "color_primaries": 9}


def pq(nits):
    m1, m2 = 2610 / 16384, 128 * 2523 / 4096
    y = (np.clip(nits, 0, None) / 10000) ** m1
    return ((3424 / 4096 + 32 * 2413 / 4096 * y) / (1 + 32 * 2392 / 4096 * y)) ** m2


def hlg(nits):
    """Signal of display light on a screen of 1,000 nits."""
    luminance = np.maximum(nits @ [0.2627, 0.6780, 0.0593], 1e-9)[..., None] / 1000
    light = np.clip(nits / 1000 * luminance ** (1 / 1.2 - 1), 0, 1)
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    bright = a * np.log(np.maximum(12 * light - b, 1e-9)) + c
    return np.where(light <= 1 / 12, np.sqrt(3 * light), bright)


def hdr_clip(path, images, white_nits, signal, transfer):
    """Images (h, w, 3) uint8 as HDR with their white at `white_nits`."""
    codes = [
        np.rint(signal((image / 255.0) ** 2.4 @ TO_2020.T * white_nits) * 65535).astype(np.uint16)
        for image in images
    ]
    return write_clip(
        path,
        codes,
        pix_fmt="yuv444p10le",
        matrix=Colorspace.BT2020,
        tags={**HDR, "color_trc": transfer},
    )


def with_white(moment):
    image = scene(moment)
    image[40:52, 10:30] = 255
    return image


@pytest.mark.parametrize("white_nits", [100.0, 203.0])
@pytest.mark.parametrize(("signal", "transfer"), [(pq, 16), (hlg, 18)], ids=["PQ", "HLG"])
def test_hdr_gives_the_images_of_the_sdr_video(tmp_path, signal, transfer, white_nits):
    images = [with_white(moment) for moment in range(6)]
    reader = VideoReader(hdr_clip(tmp_path / "a.mp4", images, white_nits, signal, transfer))
    for frame in (4, 1):
        difference = np.abs(reader.read(frame).astype(int) - images[frame])
        assert difference.mean() < 1.5 and np.percentile(difference, 95) <= 4  # display values


def test_white_is_told_by_later_frames_where_the_first_one_is_black(tmp_path):
    images = [np.zeros_like(scene(0))] * 4 + [with_white(moment) for moment in range(30)]
    reader = VideoReader(hdr_clip(tmp_path / "a.mp4", images, 203.0, pq, 16))
    assert np.abs(reader.read(20).astype(int) - images[20]).mean() < 1.5


def test_highlights_are_rolled_off_and_keep_their_order():
    ramp = np.linspace(1.0, 1200.0, 400, dtype=np.float32)
    shown = tone_map(np.repeat(ramp[None, :, None], 3, axis=2), 203.0, 1000.0)[0, :, 0]
    assert (np.diff(shown[ramp < 900]) > 0).all() and abs(shown[ramp >= 1000] - 1).max() < 1e-5
    dark = ramp < 0.2 * 203
    assert np.allclose(shown[dark], (ramp[dark] / 203) ** (1 / 2.4), atol=1e-5)
    assert 0.75 < shown[np.searchsorted(ramp, 203)] < 0.9  # white leaves room for what is brighter
    red = tone_map(np.array([[[900.0, 90.0, 9.0]]], np.float32), 203.0, 1000.0)[0, 0]
    assert np.allclose((red / red[0]) ** 2.4, [1, 0.1, 0.01], rtol=1e-3)  # hue is kept


def test_curves_hold_at_their_known_points():
    assert np.allclose(
        pq_to_nits(np.array([0.0, 0.508078, 0.580689, 1.0])), [0, 100, 203, 10000], rtol=1e-3
    )
    assert np.allclose(hlg_to_scene(np.array([0.0, 0.5, 1.0])), [0, 1 / 12, 1], atol=1e-6)
    grey = light_of(np.full((1, 1, 3), round(0.75 * 65535), np.uint16), "hlg")
    assert np.allclose(grey, 203, rtol=0.01)  # BT.2408: 75 % HLG is white of 203 nits


def test_white_is_that_of_sdr_where_nothing_is_brighter():
    light = np.full((1000, 3), 60.0, np.float32)
    light[:20] = 100.0
    assert reference_white(light) == (100.0, 100.0)
    light[:20] = 400.0
    assert reference_white(light) == (203.0, 400.0)


def test_display_p3_is_converted(tmp_path):
    image = scene(2)
    codes = np.rint(((image / 255.0) ** 2.4 @ TO_P3.T) ** (1 / 2.4) * 65535).astype(np.uint16)
    tags = {"colorspace": 1, "color_range": 1, "color_trc": 1, "color_primaries": 12}
    path = write_clip(tmp_path / "a.mp4", [codes], pix_fmt="yuv444p10le", tags=tags)
    assert mean_difference(VideoReader(path).read(0), image) < 1
    raw = next(av.open(str(path)).decode(video=0)).to_ndarray(format="rgb24")
    assert mean_difference(raw, image) > 2
