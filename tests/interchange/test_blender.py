"""Blender opens what is exported: frames, rate, camera, materials, shapes, and the mesh itself."""

from __future__ import annotations

import json
import os
import subprocess

import cv2
import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from tests.interchange.conftest import ENVIRONMENT, ROOT, require
from tests.interchange.scene import COUNT, FIRST

EXACT_MM, SHAPES_MM, PLATE_PX = 1e-3, 0.05, 0.5
KINDS = ("usd", "usd_shapes", "gltf", "alembic", "obj")


@pytest.fixture(scope="session")
def opened(scene, tmp_path_factory):
    """(mesh, kind) -> what Blender says; the folder of its renders under `renders`."""
    python = require(ENVIRONMENT / "bin/python")
    require(next(ENVIRONMENT.glob("lib/python*/site-packages/bpy"), ENVIRONMENT / "bpy"))
    out = tmp_path_factory.mktemp("blender")
    found = {"renders": out}
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    for mesh, kinds in (("tracker", KINDS), ("full", KINDS[:3]), ("head", KINDS)):
        for kind in kinds:
            result = out / f"{mesh}-{kind}.json"
            script = ROOT / "tests/interchange/blender_check.py"
            subprocess.run(
                [python, script, scene / mesh, kind, result], check=True, env=clean,
                stdout=subprocess.DEVNULL,
            )  # fmt: skip
            found[mesh, kind] = json.loads(result.read_text())
    print({key: value for key, value in found.items() if key != "renders"})
    return found


@pytest.mark.parametrize("mesh", ["tracker", "full", "head"])
@pytest.mark.parametrize("kind", ["usd", "usd_shapes", "gltf"])
def test_every_frame_is_the_corrected_mesh(opened, mesh, kind):
    found = opened[mesh, kind]
    assert len(found["error_mm"]) == COUNT
    assert max(found["error_mm"]) < (EXACT_MM if kind == "usd" else SHAPES_MM)
    assert found["moved_mm"] > 5.0


@pytest.mark.parametrize("mesh", ["tracker", "head"])
@pytest.mark.parametrize("kind", ["alembic", "obj"])
def test_alembic_and_obj_are_the_corrected_mesh(opened, mesh, kind):
    assert max(opened[mesh, kind]["error_mm"]) < EXACT_MM


@pytest.mark.parametrize("kind", ["usd", "usd_shapes", "alembic", "obj"])
def test_a_head_of_the_user_keeps_its_quads_and_its_texture_coordinates(opened, kind):
    found = opened["head", kind]
    assert found["sides"] == [3, 4]
    assert found["uv_layers"] == 1


@pytest.mark.parametrize("kind", ["usd", "usd_shapes", "alembic"])
def test_the_scene_has_the_frames_of_the_take(opened, kind):
    found = opened["tracker", kind]
    assert (found["first"], found["last"]) == (FIRST, FIRST + COUNT - 1)


@pytest.mark.parametrize("kind", ["usd", "usd_shapes", "alembic"])
def test_the_camera_sees_the_mesh_where_the_plate_has_it(opened, kind):
    found = opened["tracker", kind]
    assert found["sensor_width_mm"] == pytest.approx(36.0, abs=0.01)
    assert max(found["error_px"]) < PLATE_PX


@pytest.mark.parametrize("kind", ["usd", "alembic"])
def test_the_rendered_silhouette_lies_on_the_plates(scene, opened, kind):
    """Blender's render of the last frame against the plate, which shows the mesh through the lens."""
    last = FIRST + COUNT - 1
    plate = cv2.imread(str(scene / f"tracker/plate/{last:06d}.png"))[..., 0] / 255.0
    render = cv2.imread(str(opened["renders"] / f"tracker-{kind}.png"), cv2.IMREAD_UNCHANGED)
    alpha = render[..., 3] / 255.0
    assert 0.05 < plate.mean() < 0.9
    # Along the border, a pixel of shift is a pixel of coverage.
    border = (distance_transform_edt(plate > 0.5) < 3) & (distance_transform_edt(plate <= 0.5) < 3)
    length = np.count_nonzero(border) / 4.0
    assert np.abs(alpha - plate)[border].sum() / length < PLATE_PX
    moments = [
        np.array([np.average(axis, weights=mask) for axis in np.indices(mask.shape)])
        for mask in (alpha, plate)
    ]
    assert np.abs(moments[0] - moments[1]).max() < 0.1


@pytest.mark.parametrize("kind", ["usd_shapes", "gltf"])
def test_shape_keys_have_the_names_of_the_track(opened, kind):
    names = opened["tracker", kind]["shape_keys"]
    assert {"jawOpen", "mouthSmile_R", "corrective_000"} <= set(names)


@pytest.mark.parametrize("kind", ["usd", "usd_shapes", "gltf"])
def test_the_mesh_has_its_texture(opened, kind):
    found = opened["tracker", kind]
    assert found["materials"] == ["skin"]
    assert any(name.startswith("albedo") for name in found["images"])
    assert found["uv_layers"] == 1
