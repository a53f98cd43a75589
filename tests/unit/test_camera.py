"""Cameras: projection and rays are inverse, files round-trip, COLMAP's conventions hold."""

import numpy as np
import pytest

from vermilion.geometry.camera import Camera, look_at, pinhole, read_cameras, write_cameras
from vermilion.storage.errors import InputError


@pytest.fixture
def cameras():
    pose = look_at(np.array([50.0, 20, 700]), np.zeros(3), np.array([0, 1.0, 0]))
    distorted = Camera(
        "b", "OPENCV", (900.0, 905.0, 320.0, 240.0, -0.1, 0.02, 1e-3, -1e-3), 640, 480, pose
    )
    return {"a": pinhole("a", 800, 640, 480, pose), "b": distorted}


@pytest.mark.parametrize("name", ["a", "b"])
def test_ray_of_a_projection_meets_the_point(cameras, name):
    points = np.random.default_rng(0).uniform(-60, 60, (50, 3))
    origins, directions = cameras[name].rays(cameras[name].project(points))
    off_mm = np.linalg.norm(np.cross(points - origins, directions), axis=1)
    assert off_mm.max() < 1e-4


def test_look_at_puts_target_in_the_middle_and_up_is_up(cameras):
    camera = cameras["a"]
    assert np.allclose(camera.project(np.zeros(3)), [320, 240])
    assert camera.project(np.array([0, 10.0, 0]))[1] < 240  # y of the image points down
    assert np.allclose(camera.centre_mm, [50, 20, 700])


def test_point_behind_the_camera_is_nan(cameras):
    assert np.isnan(cameras["a"].project(np.array([100.0, 40, 1400]))).all()


def test_text_model_round_trips(cameras, tmp_path):
    write_cameras(tmp_path / "rig", cameras)
    back = read_cameras(tmp_path / "rig")
    assert list(back) == ["a", "b"] and back["b"].model == "OPENCV"
    for name, camera in cameras.items():
        assert np.allclose(back[name].cam_from_world, camera.cam_from_world, atol=1e-9)
        assert np.allclose(back[name].params, camera.params, rtol=0, atol=1e-12)


def test_resizing_scales_pixels(cameras):
    points = np.random.default_rng(1).uniform(-60, 60, (10, 3))
    half = cameras["a"].resized(0.5)
    assert np.allclose(half.project(points), cameras["a"].project(points) / 2)


def test_folder_without_cameras_is_named(tmp_path):
    with pytest.raises(InputError, match=r"no cameras.txt.*COLMAP model"):
        read_cameras(tmp_path)


@pytest.mark.parametrize("name", ["a", "b"])  # a pinhole, and a lens that distorts
def test_pixel_jacobian_is_the_derivative_of_the_projection(cameras, name):
    camera, step = cameras[name], 1e-4
    points = np.random.default_rng(3).uniform(-60, 60, (4, 10, 3))
    found = camera.pixel_jacobian(points)
    for axis, move in enumerate(step * np.eye(3)):
        slope = (camera.project(points + move) - camera.project(points - move)) / (2 * step)
        assert np.abs(found[..., axis] - slope).max() < 1e-5
