"""Rigs as they come: lens distortion, mixed resolutions, exposures and files; three cameras or ten."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests import lip_patch
from tests.stages.multiview_jobs import POSES, make_capture, reconstruct, surface_error_mm
from vermilion.geometry.camera import look_at, pinhole
from vermilion.imaging.images import linear_to_srgb, write_image
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table

UP = np.array([0.0, 1.0, 0.0])
#: Camera -> exposure against the others.
EXPOSURES = {"front": 0.5, "left": 1.0, "right": 1.4}


def mixed_rig():
    """The three cameras with lenses of three COLMAP models and three image sizes."""
    rig = lip_patch.cameras()
    front = rig["front"].resized(1.25)
    f, _, cx, cy = rig["left"].params
    left = replace(rig["left"], model="OPENCV", params=(f, f, cx, cy, 0.4, -0.5, 1e-3, -2e-3))
    right = rig["right"].resized(0.8)
    f, _, cx, cy = right.params
    right = replace(right, model="SIMPLE_RADIAL", params=(f, cx, cy, -0.3))
    return {"front": front, "left": left, "right": right}


def wide_rig():
    """Ten cameras on an arc, in two rows."""
    places = [(x, y) for y in (-60, 60) for x in np.linspace(-220, 220, 5)]
    return {
        f"cam{i}": pinhole(
            f"cam{i}", 1500.0, 240, 180, look_at(np.array([*xy, 500.0]), np.zeros(3), UP)
        )
        for i, xy in enumerate(places)
    }


def save_mixed(image, name, folder, stem):
    """16-bit PNG, linear EXR and JPEG, each at another exposure."""
    image = np.clip(image * EXPOSURES[name], 0, 1)
    if name == "front":
        folder.mkdir(parents=True, exist_ok=True)
        pixels = np.rint(linear_to_srgb(image) * 65535).astype(np.uint16)
        assert cv2.imwrite(str(folder / f"{stem}.png"), pixels[..., ::-1])
    else:
        write_image(folder / f"{stem}{'.exr' if name == 'left' else '.jpg'}", image)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "save", "limit_mm"),
    [
        pytest.param(mixed_rig, save_mixed, 0.2, id="mixed"),
        pytest.param(wide_rig, None, 0.1, id="ten cameras"),
    ],
)
def test_the_lips_are_found_with_any_rig(tmp_path, rig, save, limit_mm):
    make_capture(tmp_path, rig(), save=save)
    reconstruct(tmp_path)
    meshes = read_sequence(tmp_path / "H/000000-000003.npy").astype(float)
    for vertices, pose in zip(meshes, POSES, strict=True):
        assert np.median(surface_error_mm(vertices, pose)) < limit_mm
    table = read_table(tmp_path / "quality/000000-000003.tsv")
    assert table["valid"].tolist() == [1, 1, 1, 1]
    assert (table["missing_cameras"] == 0).all()
