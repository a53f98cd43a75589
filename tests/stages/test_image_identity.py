"""The stage that finds a person in images: from files to files."""

import json

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.image_fit_scene import CAMERA, image_of, mesh_of, motion
from tests.unit.test_joint_identity import PERSON, model_with_identities
from vermilion.config.tracking import TrackingConfig
from vermilion.geometry.camera import write_cameras
from vermilion.imaging.images import read_image, write_image
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.errors import InputError
from vermilion.tracking.result import Identity

pytestmark = pytest.mark.slow
N_FRAMES = 8


def capture(root):
    """A take of a known person; returns inputs and parameters of the job."""
    model, rows = model_with_identities(), motion(N_FRAMES)
    rows[0, 6:] = 0.0
    offsets = np.tensordot(PERSON, model.identities_mm, axes=1)
    meshes = [mesh_of(model, row, offsets) for row in rows]
    for frame, mesh in enumerate(meshes):
        write_image(root / f"frames/cam/{frame:06d}.png", image_of(model, mesh))
    points = np.stack([CAMERA.project(mesh[model.landmarks]) for mesh in meshes])
    valid = np.arange(N_FRAMES) != 5
    points[5] = np.nan
    track = LandmarkTrack(np.arange(N_FRAMES), points, np.full((N_FRAMES, 66), 0.9), valid)
    track.save(root / "landmarks.npz")
    write_cameras(root / "cameras", {"cam": CAMERA})
    (root / "cameras.json").write_text(json.dumps({"calibrated": True}))
    model.save(root / "tracker.npz")
    inputs = {
        "tracker": root / "tracker.npz",
        "landmarks": [root / "landmarks.npz"],
        "cameras": [root / "cameras"],
        "calibration": [root / "cameras.json"],
    }
    cfg = {f"tracking.{k}": v for k, v in TrackingConfig().model_dump(mode="json").items()}
    take = {"take": "t", "camera": "cam", "neutral": 0, "chunks": 1, "source": str(root)}
    return inputs, {"cfg": cfg, "takes": [take]}


def run(root, inputs, params):
    run_script(
        "tracking/image_identity",
        wildcards={"subject": "s"},
        params=params,
        input=inputs,
        output={"identity": root / "identity.npz", "overlay": root / "identity.png"},
    )


def test_a_person_from_files_with_a_frame_lost(tmp_path):
    inputs, params = capture(tmp_path)
    run(tmp_path, inputs, params)
    found = Identity.load(tmp_path / "identity.npz")
    assert np.abs(found.identity - PERSON).max() < 0.4
    assert found.takes.tolist() == ["t"]
    height, width = read_image(tmp_path / "identity.png").shape[:2]
    assert height == pytest.approx(4 / 3 * width, rel=0.2)  # frames down; image, two errors across


def test_a_image_that_is_gone_is_named(tmp_path):
    inputs, params = capture(tmp_path)
    (tmp_path / "frames/cam/000007.png").unlink()
    with pytest.raises(InputError, match="000007"):
        run(tmp_path, inputs, params)
