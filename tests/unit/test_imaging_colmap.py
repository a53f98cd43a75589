"""COLMAP models: text and binary, rigs, one folder a camera."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest

from vermilion.geometry.camera import look_at, pinhole, read_cameras, write_cameras
from vermilion.geometry.colmap import camera_of_images, model_files
from vermilion.storage.errors import InputError


def rig():
    up = np.array([0.0, 1.0, 0.0])
    return {
        name: pinhole(
            name, 800.0 + i, 640, 480, look_at(np.array([40.0 * i, 5, 700]), np.zeros(3), up)
        )
        for i, name in enumerate(("face0", "face1", "lip0"))
    }


def write_model(folder, name_of, binary):
    """A model with rigs and frames, an image a camera, as COLMAP writes it."""
    write_cameras(folder.parent / "plain", rig())
    text = (folder.parent / "plain/images.txt").read_text()
    for name in rig():
        text = text.replace(f" {name}\n", f" {name_of(name)}\n")
    (folder.parent / "plain/images.txt").write_text(text)
    model = pycolmap.Reconstruction()
    model.read_text(str(folder.parent / "plain"))
    folder.mkdir()
    model.write_binary(str(folder)) if binary else model.write_text(str(folder))
    return folder


def in_folder(name):
    return f"{name}/000000.jpg"


@pytest.mark.parametrize("binary", [True, False], ids=["binary", "text"])
@pytest.mark.parametrize("points", [True, False], ids=["points", "no points"])
def test_models_with_rigs_and_camera_folders_are_read(tmp_path, binary, points):
    folder = write_model(tmp_path / "cameras", in_folder, binary)
    suffix = ".bin" if binary else ".txt"
    assert {f"rigs{suffix}", f"frames{suffix}"} <= {path.name for path in model_files(folder)}
    if not points:
        (folder / f"points3D{suffix}").unlink()
    cameras = read_cameras(folder)
    assert list(cameras) == ["face0", "face1", "lip0"]
    for name, camera in rig().items():
        assert np.allclose(cameras[name].cam_from_world, camera.cam_from_world, atol=1e-9)
        assert cameras[name].params == camera.params and cameras[name].name == name


def test_images_are_named_after_their_camera_or_lie_in_its_folder():
    assert camera_of_images(["a.png", "b"]) == {"a.png": "a", "b": "b"}
    assert camera_of_images(["f/0001.jpg", "g/0001.jpg"]) == {"f/0001.jpg": "f", "g/0001.jpg": "g"}
    assert camera_of_images(["rig/cam1/1.png"]) == {"rig/cam1/1.png": "cam1"}
    assert camera_of_images(["images/face0.jpg", "images/face1.jpg"]) == {
        "images/face0.jpg": "face0",
        "images/face1.jpg": "face1",
    }
    assert camera_of_images(["cam.1", "cam.2"]) == {"cam.1": "cam.1", "cam.2": "cam.2"}


def test_a_camera_of_two_poses_is_named(tmp_path):
    folder = write_model(
        tmp_path / "cameras", lambda name: f"head/{name[-1]}{len(name)}.jpg", False
    )
    with pytest.raises(InputError, match=r"camera head.*different poses.*head/"):
        read_cameras(folder)


def test_half_a_model_is_named(tmp_path):
    folder = write_model(tmp_path / "cameras", in_folder, True)
    (folder / "images.bin").unlink()
    with pytest.raises(InputError, match=r"no images\.bin"):
        read_cameras(folder)
    (folder / "images.bin").write_bytes(b"\x05")
    with pytest.raises(InputError, match=r"cannot be read.*images\.bin"):
        read_cameras(folder)
