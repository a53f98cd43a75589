"""Light of a take (Mono13 8): what the mesh hides of it, and one light that fits all frames."""

import numpy as np
import pytest

from tests.unit.test_relief import FACING, clip, dome
from vermilion.appearance.harmonics import harmonics, irradiance
from vermilion.appearance.visibility import light_transfer
from vermilion.detail.relief.light import ClipLight, estimate_light, relit
from vermilion.detail.relief.light_evidence import LightEvidence, fitted_light, frame_evidence
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.geometry.mesh import triangle_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.geometry.rotations import rotation_matrix
from vermilion.geometry.sphere import sphere_points

LIGHT = np.array([[1.0, 0.3, -0.4, 0.5, 0.1, 0.0, 0.05, -0.1, 0.1]]).T * np.ones(3)
#: Irradiance over radiance of each harmonic.
COSINE = np.array([np.pi] + [2 * np.pi / 3] * 3 + [np.pi / 4] * 5)


def floor_and_wall():
    """A point of a floor whose right is a wall, infinitely high for it; world and camera agree."""
    far = 1e5
    floor = [[-far, 0, -far], [0.5, 0, -far], [0.5, 0, far], [-far, 0, far]]
    wall = [[0.5, 0, -far], [0.5, far, -far], [0.5, far, far], [0.5, 0, far]]
    triangles = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]])
    return RayCaster(np.array(floor + wall), triangles)


def test_nothing_hides_light_from_a_dome():
    topology, points = dome()
    normals = np.array([[0.0, 0, 1]])
    middle = points[[len(points) // 2]]
    found = light_transfer(RayCaster(points, topology.triangles), middle, normals, FACING)
    assert found[0] == pytest.approx(np.eye(9), abs=1e-12)


def test_a_wall_takes_the_light_from_its_side():
    normal = np.array([[0.0, 1, 0]])
    found = light_transfer(floor_and_wall(), np.zeros((1, 3)), normal, np.eye(3), 2000)
    directions = sphere_points(20000)
    radiance = harmonics(directions) @ (LIGHT / COSINE[:, None])
    seen = np.maximum(directions[:, 1:2], 0) * (directions[:, :1] < 0)
    true = (radiance * seen).mean(axis=0) * 4 * np.pi
    reached = irradiance(normal, found @ LIGHT)[0]
    assert reached == pytest.approx(true, rel=0.06)
    assert irradiance(normal, LIGHT)[0].min() > 1.8 * true.max()


def frames_of(topology, points, true, turns, rng):
    """Observations of a dome at `turns` (n, 3), with noise of a display value."""
    seen = []
    for turn in turns:
        rotated = points @ rotation_matrix(turn).T
        normals = triangle_normals(rotated, topology.skin) @ FACING.T
        values = true.values(normals) + rng.normal(size=(len(normals), 1))
        seen.append(SkinObservation(values, np.ones(len(normals)), normals))
    return seen


def test_frames_with_a_turned_head_mend_the_light_of_the_first_ones(tmp_path):
    topology, points = dome()
    true = clip(topology)
    centres = points[topology.skin].mean(axis=1)
    true.albedo[:] *= 1 + 0.25 * centres[:, :1] / 30  # paint that looks like light from a side
    rng = np.random.default_rng(4)
    first = frames_of(topology, points, true, np.zeros((10, 3)), rng)
    start = estimate_light(range(10), first, topology, centres, 8.0)
    turns = np.radians(25) * np.sin(np.arange(20) / 3)[:, None] * [0.0, 1, 0.3]
    later = frames_of(topology, points, true, turns, rng)
    found = [(10 + k, *frame_evidence(seen, start)) for k, seen in enumerate(later)]
    for part, name in ((found[:5], "a"), (found[5:], "b")):
        LightEvidence.of(part).save(tmp_path / f"{name}.npz")
    parts = [LightEvidence.load(tmp_path / f"{name}.npz") for name in "ab"]
    light = relit(start, fitted_light(parts, start.light), first, topology, centres, 8.0)

    def slope_error(one: ClipLight):
        return np.abs(one.slopes(first[0].normals) - true.slopes(first[0].normals)).mean()

    assert slope_error(light) < 0.7 * slope_error(start)


def test_no_evidence_leaves_the_light_as_it_was():
    none = LightEvidence.of([])
    assert (fitted_light([none], LIGHT) == LIGHT).all()
