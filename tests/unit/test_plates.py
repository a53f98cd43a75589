"""Plates for other trackers: images without lens distortion, and a camera that all readers agree on."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from vermilion.app.plates import write_plates_of
from vermilion.capture.camera_files.read import read_given_cameras
from vermilion.geometry.camera import Camera, look_at, write_cameras
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import read_image, write_srgb8
from vermilion.storage.errors import InputError

PROJECT = Path(__file__).parents[2]
POSE = look_at(np.array([50.0, 20.0, 900.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
LENS = Camera("face2", "OPENCV", (700.0, 690.0, 158.0, 121.0, -0.2, 0.03, 0.0, 0.0), 320, 240, POSE)
POINTS = np.random.default_rng(1).uniform(-60, 60, (40, 3))
MISSING = 2


@pytest.fixture
def configuration(tmp_path, monkeypatch):
    """The tiny configuration, with inpainted frames of s1/rom: white dots where points are seen."""
    monkeypatch.chdir(PROJECT)
    content = yaml.safe_load(Path("config/tiny.yaml").read_text())
    content["results"] = str(tmp_path / "results")
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(content))
    take = tmp_path / "results" / "takes" / "s1" / "rom"
    write_cameras(take / "cameras", {"face2": LENS})
    (take / "inpaint" / "000000-000007").mkdir(parents=True)
    for frame in range(4):
        if frame != MISSING:
            name = take / "inpaint" / "000000-000007" / f"{frame:06d}.png"
            write_srgb8(name, np.full((240, 320, 3), 60 + 30 * frame, np.uint8))
    return path


def straight_px(folder: Path, points: np.ndarray) -> np.ndarray:
    names = "face2", "camera"
    (camera,) = read_given_cameras(folder, dict.fromkeys(names, (320, 240))).cameras.values()
    return camera.project(points)


def test_plates_and_cameras_agree(configuration, tmp_path, capsys):
    assert write_plates_of(str(configuration), "s1/rom", "png", tmp_path / "out") == 0
    assert "frames without an image" in capsys.readouterr().out
    made = tmp_path / "out" / "s1-rom"
    names = sorted(path.name for path in (made / "frames" / "face2").iterdir())
    assert names == ["000000.png", "000001.png", "000003.png"]
    facts = json.loads((made / "camera.json").read_text())
    assert facts["frames"] == [0, 1, 3]
    # A pinhole with the horizontal focal length both ways.
    pixels = straight_px(made / "cameras", POINTS)
    in_camera = POINTS @ POSE[:, :3].T + POSE[:, 3]
    wanted = 700.0 * in_camera[:, :2] / in_camera[:, 2:] + [158.0, 121.0]
    assert np.abs(pixels - wanted).max() < 1e-6
    stage = made / "usd"
    stage.mkdir()
    (made / "camera.usda").rename(stage / "camera.usda")
    assert np.abs(straight_px(stage, POINTS) - wanted).max() < 1e-2


def test_a_video_keeps_the_place_of_a_missing_frame(configuration, tmp_path):
    assert write_plates_of(str(configuration), "s1/rom", "mov", tmp_path / "out") == 0
    made = tmp_path / "out" / "s1-rom"
    video = open_frames(made / "plate.mov")
    take = tmp_path / "results" / "takes" / "s1" / "rom" / "inpaint" / "000000-000007"
    for shown, source in ((0, 0), (1, 1), (2, 1), (3, 3)):
        wanted = read_image(take / f"{source:06d}.png")[120, 160]
        assert np.abs(video.read("face2", shown)[120, 160] - wanted).max() < 0.01


def test_a_take_without_plates_is_named(configuration, tmp_path, capsys):
    assert write_plates_of(str(configuration), "s2/rom", "exr", tmp_path / "out") == 1
    assert "s2/rom: found no image without tattoo yet" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"no tattoo take s1/phone.*s1/rom"):
        write_plates_of(str(configuration), "s1/phone", "png", tmp_path / "out")
