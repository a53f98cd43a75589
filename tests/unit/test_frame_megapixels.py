"""Pixels of a frame, which the requests of jobs grow with, from headers alone."""

import numpy as np
import pytest

from tests.unit.small_videos import HEIGHT, WIDTH, scene, write_clip
from vermilion.app.frame_megapixels import frame_megapixels
from vermilion.config.studio import StudioConfig
from vermilion.config.takes import Take
from vermilion.imaging.images import write_srgb8

STUDIO = StudioConfig(face_size_px=(400, 500), lip_size_px=(300, 200), video_size_px=(640, 480))


def megapixels(source, role="tattoo"):
    return frame_megapixels(Take("s1", "rom", role, str(source), 0, 3, 30.0, "none"), STUDIO)


@pytest.mark.parametrize(
    ("role", "expected"), [("tattoo", 6 * [0.2] + 4 * [0.06]), ("video", [0.3072])]
)
def test_of_the_studio_by_the_configuration(role, expected):
    assert megapixels("studio", role) == pytest.approx(expected)


def test_of_a_take_with_images_of_its_own_size():
    own = {"s1": {"takes": {"rom": {"video_size_px": (200, 100)}}}}
    studio = STUDIO.model_copy(update={"subjects": StudioConfig(subjects=own).subjects})
    take = Take("s1", "rom", "video", "studio", 0, 3, 30.0, "none")
    assert frame_megapixels(take, studio) == pytest.approx([0.02])


def test_of_a_capture_each_camera(tmp_path):
    for camera, shape in (("a", (200, 100)), ("b", (300, 400))):
        (tmp_path / "frames" / camera).mkdir(parents=True)
        write_srgb8(tmp_path / "frames" / camera / "000007.png", np.zeros((*shape, 3), np.uint8))
    assert megapixels(tmp_path) == pytest.approx([0.02, 0.12])


def test_of_a_video(tmp_path):
    clip = write_clip(tmp_path / "clip.mp4", [scene(0), scene(1)])
    assert megapixels(clip, "video") == pytest.approx([WIDTH * HEIGHT / 1e6])


def test_what_cannot_be_read_asks_for_nothing_more(tmp_path):
    (tmp_path / "frames" / "a").mkdir(parents=True)
    (tmp_path / "frames" / "a" / "000000.png").write_bytes(b"no image")
    assert megapixels(tmp_path) == []
    assert megapixels(tmp_path / "nowhere") == []
    assert megapixels(tmp_path, "tracked") == []
