"""The attention mesh of mediapipe in its own environment: conventions, independence of frames, no face."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vermilion.faces import procedural
from vermilion.geometry.mesh import Mesh, submesh
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.mediapipe import MediapipeDetector, environment_python
from vermilion.landmarks.sets import MEDIAPIPE478
from vermilion.scan.landmarks import find_landmarks
from vermilion.scan.views import ScanViews, camera_towards
from vermilion.storage.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = Path(os.environ.get("VERMILION_MEDIAPIPE", ROOT / ".venv-mediapipe"))


def unavailable() -> str:
    try:
        environment_python(ENVIRONMENT)
    except InputError as error:
        return str(error)
    return ""


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(unavailable()), reason=unavailable() or "available"),
]


@pytest.fixture(scope="module")
def detector():
    with MediapipeDetector(ENVIRONMENT) as found:
        yield found


@pytest.fixture(scope="module")
def images():
    """A bare head from three sides, (360, 480, 3) linear RGB."""
    model = procedural.tracker_model(6000, 3)
    views = ScanViews(Mesh(model.neutral_mm, model.triangles))
    middle = model.neutral_mm[model.landmarks].mean(axis=0)
    result = []
    for yaw in (-0.3, 0.1, 0.35):
        front = np.array([np.sin(yaw), 0.1, np.cos(yaw)])
        camera = camera_towards(
            middle + np.array([20.0, 8.0, 0.0]), 360.0, front, np.array([0, 1.0, 0]), 480
        )
        result.append(views.image(camera)[60:420].astype(np.float32))
    return result


def test_a_mirror_image_has_the_mirrored_landmarks(detector, images):
    """The centre of the top-left pixel is (0.5, 0.5): else they would be off by a pixel."""
    off = []
    for image in images:
        mirrored = detector.detect(image[:, ::-1]).points_px[MEDIAPIPE478.mirror]
        off.append(mirrored * [-1, 1] + [image.shape[1], 0] - detector.detect(image).points_px)
    assert abs(np.mean(off, axis=(0, 1))).max() < 0.3  # px
    assert np.linalg.norm(off, axis=2).mean() < 0.8


@pytest.mark.parametrize("change", ["moved", "doubled"])
def test_landmarks_move_and_grow_with_the_image(detector, images, change):
    off = []
    for image in images:
        if change == "moved":
            other = np.pad(image, ((17, 0), (40, 0), (0, 0)), mode="edge")
            points = detector.detect(other).points_px - [40, 17]
        else:
            other = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
            points = detector.detect(other).points_px / 2
        off.append(points - detector.detect(image).points_px)
    assert abs(np.mean(off, axis=(0, 1))).max() < 0.3  # px
    assert np.linalg.norm(off, axis=2).mean() < 0.8


def test_a_frame_does_not_depend_on_those_before_it(detector, images):
    """Bit for bit, in whatever chunks a take is cut, and in another process."""
    whole = LandmarkTrack.of(range(3), [detector.detect(images[f]) for f in range(3)])
    with MediapipeDetector(ENVIRONMENT) as other:
        single = other.detect(images[2])
    assert (whole.points_px[2] == single.points_px).all()
    assert (whole.depth_px[2] == single.depth_px).all() and whole.valid.all()


def test_a_blank_image_has_no_face(detector):
    found = detector.detect(np.full((200, 300, 3), 0.4, dtype=np.float32))
    assert not found.found and found.points_px.shape == (478, 2)
    assert np.isnan(found.points_px).all() and (found.confidence == 0).all()


def test_a_small_face_in_a_large_image_is_found(detector, images):
    face = cv2.resize(images[1], (96, 72), interpolation=cv2.INTER_AREA)
    image = np.full((720, 1280, 3), face[0, 0], dtype=np.float32)
    image[500:572, 1000:1096] = face
    expected = (detector.detect(images[1]).points_px) * 0.2 + [1000, 500]
    found = detector.detect(image)
    assert found.found
    assert np.linalg.norm(found.points_px - expected, axis=1).mean() < 1.5  # px


def test_of_several_faces_the_largest_comes_first(detector, images):
    small = cv2.resize(images[0], None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA)
    image = np.full((360, 860, 3), images[0][0, 0], dtype=np.float32)
    image[:252, :336], image[:, 380:] = small, images[0]
    faces = detector.faces(image)
    assert len(faces) == 2
    left = [face.points_px[:, 0].mean() < 360 for face in faces]
    assert left == [False, True]


def test_a_process_that_ends_is_said_with_what_to_do(images):
    detector = MediapipeDetector(ENVIRONMENT)
    detector.detect(images[0])
    detector._process.kill()
    with pytest.raises(InputError, match=r"ended with status.*setup_landmarks.sh"):
        detector.detect(images[0])
    assert detector.detect(images[0]).found  # and is started again
    detector.close()


def test_landmarks_of_a_mesh_are_found_whichever_way_it_lies(detector):
    """A face in metres that lies on its side, as another tracker may give it."""
    model = procedural.tracker_model(6000, 3)
    turn = Rotation.from_euler("xz", [-90, 25], degrees=True)
    kept, triangles = submesh(model.triangles, ~model.regions["teeth"])
    placed = 0.001 * turn.apply(model.neutral_mm) + [0.1, 2.0, -0.3]
    truth, mesh = placed[model.landmarks], Mesh(placed[kept], triangles)
    found = find_landmarks(mesh, detector, model.neutral_mm[model.landmarks])
    away = 1000.0 * np.linalg.norm(found.points - truth, axis=1)
    assert found.known[17:].all()
    assert np.median(away[17:]) < 7.0  # the network's idea of a bare face without brows; it is 4.8
    assert np.median(away[48:]) < 7.0
