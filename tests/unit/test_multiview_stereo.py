"""Pairs, rectification, matching and fusion against surfaces that are known."""

import numpy as np
import pytest

from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.mesh import Mesh
from vermilion.multiview.cloud import fuse, near_mesh, screened_poisson
from vermilion.multiview.pairs import rectify, stereo_pairs
from vermilion.multiview.stereo import Cloud, StereoSettings, match_pair
from vermilion.multiview.views import View, normalise
from vermilion.storage.errors import InputError

UP = np.array([0.0, 1.0, 0.0])
ORIGIN = np.zeros(3)


def camera(name, place, focal=900.0, size=(320, 240)):
    return pinhole(name, focal, *size, look_at(np.array(place, float), ORIGIN, UP))


def rig():
    """Three pairs on the face, two closer pairs on the lips, as Lips16 figure 3."""
    places = {f"face{i}": (x, 20, 600) for i, x in enumerate((-420, -280, -45, 45, 280, 420))}
    lips = {"lip0": (-90, 150, 600), "lip1": (90, 150, 600), "lip2": (-90, -150, 600)}
    cameras = {name: camera(name, place) for name, place in places.items()}
    lips["lip3"] = (90, -150, 600)
    return cameras | {name: camera(name, place, 2400.0) for name, place in lips.items()}


def test_pairs_of_the_papers_rig_are_found_from_the_poses():
    expected = [("face0", "face1"), ("face2", "face3"), ("face4", "face5")]
    assert stereo_pairs(rig(), ORIGIN) == [*expected, ("lip0", "lip1"), ("lip2", "lip3")]


def test_listed_pairs_win_and_unknown_ones_are_named():
    assert stereo_pairs(rig(), ORIGIN, [("face0", "face5")]) == [("face0", "face5")]
    with pytest.raises(InputError, match="nosuch"):
        stereo_pairs(rig(), ORIGIN, [("face0", "nosuch")])


def test_cameras_that_look_from_opposite_sides_make_no_pair():
    with pytest.raises(InputError, match="no stereo pair"):
        stereo_pairs({"a": camera("a", (0, 0, 500)), "b": camera("b", (0, 0, -500))}, ORIGIN)


@pytest.mark.parametrize("other", [(120, 0, 500), (10, 130, 480), (-90, -80, 520)])
def test_rectified_points_share_a_row_and_come_back_from_their_disparity(other):
    pair = rectify(camera("a", (-40, 10, 500)), camera("b", other), ORIGIN, 60.0)
    points = np.random.default_rng(0).uniform(-40, 40, (50, 3))
    left, right = pair.left.project(points), pair.right.project(points)
    assert np.abs(left[:, 1] - right[:, 1]).max() < 1e-9
    disparity = left[:, 0] - right[:, 0]
    assert (disparity >= pair.min_disparity_px).all()
    assert (disparity < pair.min_disparity_px + pair.n_disparities).all()
    assert np.abs(pair.points(left, disparity) - points).max() < 1e-6


def textured_plane(cam, tilt):
    """A view of the plane z = tilt x with a pattern of spots, and the plane's normal."""
    normal = np.array([-tilt, 0.0, 1.0]) / np.hypot(tilt, 1)
    origins, directions = cam.rays(cam.pixel_grid())
    distance = -(origins @ normal) / (directions @ normal)
    x, y, _ = np.moveaxis(origins + distance[..., None] * directions, -1, 0)
    rng = np.random.default_rng(4)
    grey = np.zeros(x.shape)
    for _ in range(60):
        direction = rng.normal(size=2) * rng.uniform(0.5, 4)
        grey += np.sin(direction[0] * x + direction[1] * y + rng.uniform(0, 6))
    grey = (0.5 + 0.04 * grey).astype(np.float32)
    return View(cam, grey, normalise(grey, 8.0, 0.01)), normal


def test_matched_points_lie_on_the_plane_with_its_normal():
    (a, normal), (b, _) = (
        textured_plane(camera(name, (x, 0, 400)), 0.3) for name, x in (("a", -50), ("b", 50))
    )
    settings = StereoSettings(
        pairs=(), reach_mm=60.0, block_px=5, uniqueness_percent=5, consistency_px=1.0,
        speckle_px=50, min_texture=4.0, spacing_mm=2.0,
    )  # fmt: skip
    cloud = match_pair(a, b, ORIGIN, settings)
    assert len(cloud) > 20_000
    mm_per_px = 400.0**2 / (900.0 * 100.0)
    error_px = np.abs(cloud.points_mm @ normal) / mm_per_px
    assert np.median(error_px) < 0.1
    assert np.percentile(error_px, 99) < 0.4
    assert np.median(cloud.normals @ normal) > 0.95
    fused = fuse(cloud, 2.0)
    assert np.median(np.abs(fused.points_mm @ normal)) < 0.08 * mm_per_px
    assert np.median(fused.normals @ normal) > 0.995  # 6 degrees


def sheet(n=31, size_mm=60.0):
    line = np.linspace(-size_mm / 2, size_mm / 2, n)
    x, y = (a.reshape(-1) for a in np.meshgrid(line, line))
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = (k.ravel() for k in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh(np.stack([x, y, 0 * x], axis=1), triangles)


def test_points_behind_the_skin_or_at_the_mouths_inside_are_dropped():
    mesh = sheet()
    points = np.array([[0, 0, 0.5], [0, 0, -9.0], [20, 20, 0.2], [5, 5, 0.1], [300, 0, 0]])
    normals = np.tile([0, 0, 1.0], (5, 1))
    normals[3] = [0, 0, -1]
    allowed = mesh.vertices_mm[:, 0] < 15
    kept = near_mesh(Cloud(points, normals, np.ones(5)), mesh, 3.0, allowed)
    assert kept.points_mm.tolist() == [[0, 0, 0.5]]


def test_poisson_surface_of_a_sheet_is_flat_and_ends_with_its_points():
    mesh = sheet(61)
    normals = np.tile([0, 0, 1.0], (len(mesh.vertices_mm), 1))
    cloud = Cloud(mesh.vertices_mm, normals, np.ones(len(normals)))
    surface = screened_poisson(cloud, 6, 3.0)
    assert np.abs(surface.vertices_mm[:, 2]).max() < 0.2
    assert np.abs(surface.vertices_mm[:, :2]).max() < 33.0
