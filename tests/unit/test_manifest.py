"""The capture manifest: what is wrong is named, and the take goes on where it can."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

from vermilion.capture.board import Board
from vermilion.capture.calibrate import CalibrationSettings
from vermilion.capture.manifest import capture_manifest, load_manifest, quality_rows
from vermilion.capture.rig import image_sizes, rig_cameras
from vermilion.geometry.camera import look_at, pinhole, write_cameras
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import write_video
from vermilion.storage.errors import ForbiddenInputError, InputError

FRAMES = range(4)
CAMERAS = ("a", "b", "c")


def image(seed: int, size=(24, 32)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 255, (*size, 3), dtype=np.uint8)


@pytest.fixture
def capture(tmp_path):
    for i, camera in enumerate(CAMERAS):
        for frame in FRAMES:
            write_srgb8(tmp_path / "frames" / camera / f"{frame:06d}.png", image(10 * i + frame))
    up = np.array([0.0, 1.0, 0.0])
    rig = {
        name: pinhole(name, 40.0, 32, 24, look_at(np.array([i * 50.0, 0, 500]), np.zeros(3), up))
        for i, name in enumerate(CAMERAS)
    }
    write_cameras(tmp_path / "cameras", rig)
    return tmp_path


def manifest_of(capture, frames=FRAMES, **more):
    return capture_manifest(capture, "s1", "t1", list(frames), **more)


def test_a_sound_capture_has_nothing_bad(capture, tmp_path):
    manifest = manifest_of(capture)
    assert manifest.bad == {}
    assert manifest.cameras["b"] == {"width_px": 32, "height_px": 24, "channels": 3, "bits": 8}
    facts = manifest.frames["c"][2]
    assert facts["file"] == "frames/c/000002.png" and len(facts["sha256"]) == 64
    manifest.save(tmp_path / "m.json")
    assert load_manifest(tmp_path / "m.json") == manifest


def test_chunks_say_what_the_whole_take_says(capture):
    (capture / "frames/b/000002.png").unlink()
    whole = manifest_of(capture)
    parts = [manifest_of(capture, part) for part in ([0, 1], [2, 3])]
    for camera in CAMERAS:
        joined = {**parts[0].frames[camera], **parts[1].frames[camera]}
        assert joined == whole.frames[camera]
    assert parts[1].bad == whole.bad == {"b": {2: "missing"}}


def test_every_bad_image_is_named_and_the_take_goes_on(capture):
    frames = capture / "frames"
    (frames / "a/000001.png").unlink()
    whole = (frames / "b/000002.png").read_bytes()
    (frames / "b/000002.png").write_bytes(whole[: len(whole) // 2])
    (frames / "b/000003.png").write_bytes(b"")
    write_srgb8(frames / "c/000000.png", image(1, (20, 32)))
    shutil.copy(__file__, frames / "c/000003.png")
    manifest = manifest_of(capture)
    assert manifest.bad["a"] == {1: "missing"}
    assert "truncated" in manifest.bad["b"][2] and manifest.bad["b"][3] == "empty file"
    assert manifest.bad["c"][0] == "size 32x20, expected 32x24"
    assert "unreadable" in manifest.bad["c"][3]
    rows = quality_rows(manifest, FRAMES, needed=["c"])
    assert [row.valid for row in rows] == [False, True, True, False]
    assert rows[1].reason == "a: missing" and rows[3].figures["cameras_bad"] == 2


def test_everything_that_stops_a_take_is_listed_at_once(capture):
    shutil.rmtree(capture / "frames/a")
    for frame in FRAMES:
        write_srgb8(capture / f"frames/c/{frame:06d}.png", image(frame, (48, 64)))
    with pytest.raises(InputError) as error:
        manifest_of(capture)
    message = str(error.value)
    assert "2 problem(s)" in message and "subject s1, take t1" in message
    assert "camera a" in message and "no image" in message
    assert "camera c" in message and "images of 64x48" in message and "32x24" in message


def test_a_video_is_checked_frame_by_frame(tmp_path):
    path = tmp_path / "clip.mp4"
    write_video(path, [image(i, (48, 64)) for i in range(5)], fps=25)
    manifest = capture_manifest(path, "s1", "t1", [2, 3, 4, 5], ["cam"], hash_decoded=True)
    assert manifest.kind == "video" and manifest.video["frames"] == 5
    assert manifest.cameras["cam"]["width_px"] == 64
    assert list(manifest.bad["cam"]) == [5] and "5 frames" in manifest.bad["cam"][5]
    assert len(manifest.frames["cam"][2]["sha256_rgb8"]) == 64


def test_given_cameras_are_checked_and_kept(capture):
    sizes = image_sizes([manifest_of(capture)])
    rig = rig_cameras(capture, sizes, "b", Board("charuco", (9, 7), 20.0, 15.0))
    assert rig.method == "given" and list(rig.cameras) == list(CAMERAS)
    with pytest.raises(InputError, match="camera b is calibrated at 32x24"):
        rig_cameras(capture, {**sizes, "b": (64, 48)}, "b", Board("checkerboard", (9, 8), 20.0))


def test_one_camera_gets_an_assumed_focal_and_several_an_error(tmp_path):
    board = Board("checkerboard", (9, 8), 20.0)
    rig = rig_cameras(
        tmp_path, {"cam": (1280, 720)}, "cam", board, CalibrationSettings(assumed_focal=1.2)
    )
    assert rig.summary()["calibrated"] is False and rig.method == "assumed"
    assert rig.cameras["cam"].params[:2] == (1536.0, 1536.0)
    upright = rig_cameras(tmp_path, {"cam": (720, 1280)}, "cam", board)
    assert upright.cameras["cam"].params[:2] == (1536.0, 1536.0)  # the same lens
    known = rig_cameras(tmp_path, {"cam": (720, 1280)}, "cam", board, focal=0.8)
    assert known.summary()["calibrated"] and known.cameras["cam"].params[0] == 1024.0
    with pytest.raises(InputError, match=r"2 cameras without a calibration.*cameras/"):
        rig_cameras(tmp_path, {"a": (8, 8), "b": (8, 8)}, "a", board)


def test_image_that_may_not_be_read_stops_the_job(capture, monkeypatch):
    """Lost permission is no fault of the frame: it is not given up in silence."""
    path = capture / "frames" / "a" / "000002.png"
    may = os.access
    monkeypatch.setattr(os, "access", lambda file, mode: file != path and may(file, mode))
    with pytest.raises(ForbiddenInputError, match=r"000002\.png: found no permission to read"):
        capture_manifest(capture, "s", "t", FRAMES)
