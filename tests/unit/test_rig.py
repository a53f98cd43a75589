"""The synthetic rig: ten cameras in pairs, aimed at this actor's face and lips."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from tests.heads import small_tracker
from vermilion.config.studio import StudioConfig
from vermilion.geometry.camera import read_cameras, write_cameras
from vermilion.studio import rig

SETTINGS = rig.RigSettings(
    rig.MULTIVIEW_CAMERAS, 735.0, (512, 512), (480, 384), (640, 480), 245.0, 105.0, 250.0
)


@pytest.fixture(scope="module")
def face():
    return small_tracker()


@pytest.fixture(scope="module")
def cameras(face):
    return rig.lips16_rig(face, face.neutral_mm, SETTINGS)


def test_three_pairs_on_the_face_and_two_on_the_lips(cameras):
    assert len(cameras) == 10
    names = list(cameras)
    for left, right in zip(names[::2], names[1::2], strict=True):
        a, b = cameras[left], cameras[right]
        baseline = np.linalg.norm(a.centre_mm - b.centre_mm)
        assert 80 < baseline < 260  # mm
        angle = np.degrees(np.arccos(a.rotation[2] @ b.rotation[2]))
        assert 6 < angle < 20  # degrees between the axes of a pair


def test_a_smaller_rig_has_the_same_cameras_where_they_were(face, cameras):
    names = ("face1", "face2", "face3", "face4", "lip0", "lip1")
    fewer = rig.lips16_rig(face, face.neutral_mm, replace(SETTINGS, cameras=names))
    assert tuple(fewer) == names == rig.camera_names("tattoo", names)
    assert all(np.array_equal(fewer[name].centre_mm, cameras[name].centre_mm) for name in names)


def test_the_configuration_names_the_cameras_of_the_rig():
    assert tuple(StudioConfig().cameras) == rig.MULTIVIEW_CAMERAS
    for name in rig.FRONTAL_PAIR:
        with pytest.raises(ValidationError, match=f"lacks {name}"):
            StudioConfig(cameras=[other for other in rig.MULTIVIEW_CAMERAS if other != name])
    with pytest.raises(ValidationError, match="cameras lacks face3 of the frontal pair"):
        StudioConfig(cameras=["face2", "lip0"])
    with pytest.raises(ValidationError, match="twice: face2, face3, face2"):
        StudioConfig(cameras=["face2", "face3", "face2"])


def test_lip_cameras_look_at_the_middle_of_the_lips(face, cameras):
    centre = rig.lips_centre(face, face.neutral_mm)
    for name in rig.LIP_ANGLES_DEG:
        camera = cameras[name]
        middle = np.array([camera.width_px, camera.height_px]) / 2
        assert np.linalg.norm(camera.project(centre) - middle) < 0.01  # px
    heights = [cameras[name].centre_mm[1] - centre[1] for name in rig.LIP_ANGLES_DEG]
    assert heights[0] > 0 and heights[2] < 0  # one pair from above, one from below


def test_every_camera_sees_what_it_is_for(face, cameras):
    landmarks = face.neutral_mm[face.landmarks]
    for name in ("face2", "face3"):
        camera = cameras[name]
        assert camera.in_image(camera.project(landmarks), margin_px=5).all()
    for camera in cameras.values():
        lips = camera.project(face.neutral_mm[face.outer_contour])
        assert camera.in_image(lips, margin_px=20).all()


def test_the_rig_follows_the_actor(face, cameras):
    shift = np.array([12.0, -7.0, 5.0])
    moved = rig.lips16_rig(face, face.neutral_mm + shift, SETTINGS)
    for name, camera in cameras.items():
        assert np.allclose(moved[name].centre_mm - camera.centre_mm, shift)


def test_cameras_survive_their_files(cameras, tmp_path):
    write_cameras(tmp_path / "cameras", cameras)
    again = read_cameras(tmp_path / "cameras")
    point = np.array([[10.0, -30.0, 90.0]])
    for name, camera in cameras.items():
        assert np.abs(again[name].project(point) - camera.project(point)).max() < 1e-6  # px
