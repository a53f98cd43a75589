"""Relief that is always there is told apart from paint (Mono13 8, geometry of the first frames)."""

import numpy as np
import pytest

from tests.unit.test_relief import FACING, bump, clip, degrees_apart, dome
from vermilion.detail.relief.frames import ReliefScene
from vermilion.detail.relief.light import estimate_light
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.detail.relief.standing_relief import with_standing_relief
from vermilion.geometry.camera import pinhole
from vermilion.geometry.mesh import triangle_normals, vertex_normals

SETTINGS = ReliefSettings(detail_mm=20.0, standing_share=1.0)
POSE = np.column_stack([FACING, [0.0, 0.0, 700.0]])


@pytest.fixture(scope="module")
def skin():
    return dome()


def found_on(skin, height_mm, paint):
    """The take's light after two frames that all show the same relief and paint (Q, 3)."""
    topology, points = skin
    true = clip(topology)
    true.albedo[:] *= paint
    normals = vertex_normals(points, topology.skin)
    shape = triangle_normals(points + height_mm[:, None] * normals, topology.skin) @ FACING.T
    smooth = triangle_normals(points, topology.skin) @ FACING.T
    rng, n = np.random.default_rng(3), len(topology.skin)
    first = {
        frame: SkinObservation(true.values(shape) + rng.normal(size=(n, 1)), np.ones(n), smooth)
        for frame in range(2)
    }
    camera = pinhole("cam", 1400.0, 960, 720, POSE)
    scene = ReliefScene(topology, camera, lambda _: np.zeros((1, 1, 3)), lambda _: points, 640)
    centres = points[topology.skin].mean(axis=1)
    light = estimate_light(range(2), list(first.values()), topology, centres, SETTINGS.detail_mm)
    return with_standing_relief(light, scene, first, SETTINGS)


def test_a_bump_that_never_moves_is_found_below_speckled_paint(skin):
    topology, points = skin
    speckle = 1 + 0.05 * np.random.default_rng(5).normal(size=(len(topology.skin), 1))
    light = found_on(skin, bump(points), speckle)
    normals = vertex_normals(points, topology.skin)
    true = vertex_normals(points + bump(points)[:, None] * normals, topology.skin)
    found = vertex_normals(points + light.standing_mm[:, None] * normals, topology.skin)
    near = np.hypot(points[:, 0] - 5, points[:, 1]) < 12
    before = degrees_apart(normals, true)[near].mean()
    assert degrees_apart(found, true)[near].mean() < 0.8 * before


def test_a_mole_of_another_hue_is_paint(skin):
    topology, points = skin
    centres = points[topology.skin].mean(axis=1)
    mole = np.exp(-(((centres[:, :2] - [8, -6]) / 2.5) ** 2).sum(axis=1) / 2)
    normals, tilt = vertex_normals(points, topology.skin), []
    for darker in ([0.3, 0.5, 0.6], [0.47, 0.47, 0.47]):
        light = found_on(skin, np.zeros(len(points)), 1 - mole[:, None] * darker)
        found = vertex_normals(points + light.standing_mm[:, None] * normals, topology.skin)
        tilt.append(degrees_apart(found, normals).max())
    assert tilt[0] < 0.5 * tilt[1]
