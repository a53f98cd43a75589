"""Correspondence: back-projection, registration, binding, the mask."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.unit.test_integration import sheet
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.correspondence.binding import bind_vertices, flipped_triangles
from vermilion.correspondence.correspondence import (
    Correspondence,
    CorrespondenceSettings,
    MarkedMesh,
    find_correspondence,
    register_coarse_neutral,
)
from vermilion.correspondence.landmarks import back_project
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.storage.errors import InputError

SETTINGS = CorrespondenceSettings(**CorrespondenceConfig().model_dump(exclude={"landmarks"}))


def test_bound_triangles_never_face_against_their_surface():
    vertices, triangles, _ = sheet(20)
    surface = Mesh(vertices, triangles)
    folded = vertices + np.array([0.0, 0, 0.2])
    middle = np.argmin(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1))
    spacing = np.sort(np.linalg.norm(vertices - vertices[middle], axis=1))[1]
    folded[middle, :2] += [1.6 * spacing, 0.3 * spacing]  # past its neighbour
    registered = Mesh(folded, triangles)
    direct = Surface(vertices, triangles).closest(folded)
    assert flipped_triangles(direct, triangles, surface).any()
    found = bind_vertices(registered, surface, max_distance_mm=5.0, max_angle_deg=70.0)
    assert found.bound.all() and not flipped_triangles(found, triangles, surface).any()
    away = np.linalg.norm(vertices - vertices[middle], axis=1) > 4 * spacing
    kept, wanted = (p.sample(vertices, triangles)[away] for p in (found, direct))
    np.testing.assert_allclose(kept, wanted, atol=1e-9)
    assert found.distance_mm.max() < 3 * spacing


def test_landmarks_come_back_to_where_they_were_seen():
    vertices, triangles, radius = sheet()
    camera = pinhole(
        "front", 800, 400, 400, look_at(np.array([0.0, 0, 700]), np.zeros(3), np.array([0.0, 1, 0]))
    )
    seen = np.flatnonzero(radius < 50)
    mesh = Mesh(vertices, triangles)
    found = back_project(camera.project(vertices[seen]), camera, mesh)
    assert found.bound.all()
    np.testing.assert_allclose(found.sample(vertices, triangles), vertices[seen], atol=0.01)
    outside = back_project(np.array([[2.0, 2.0], [np.nan, 5.0]]), camera, mesh)
    assert not outside.bound.any()


def test_a_grazing_ray_is_no_landmark():
    vertices, triangles, _ = sheet(10)
    flat = Mesh(vertices * [1, 1, 0], triangles)
    low = look_at(np.array([-600.0, 0, 60]), np.zeros(3), np.array([0.0, 0, 1]))
    camera = pinhole("low", 1500, 400, 400, low)
    assert not back_project(camera.project(np.zeros((1, 3))), camera, flat).bound.any()
    assert back_project(camera.project(np.zeros((1, 3))), camera, flat, 89.0).bound.all()


@pytest.fixture(scope="module")
def surfaces():
    """One smooth surface meshed twice, the second one bent, scaled and moved elsewhere."""
    coarse, coarse_triangles, _ = sheet(22)
    fine, fine_triangles, _ = sheet(50, 190.0)
    rotation = Rotation.from_rotvec([0.3, -0.2, 0.1]).as_matrix()

    def bend(points):
        lift = 3.0 * np.sin(points[:, :1] / 35) * [0.2, 0.1, 1.0]
        return 1.05 * (points + lift) @ rotation.T + [20.0, -5.0, 400.0]

    ids = np.argmin(np.linalg.norm(coarse[:, None] - coarse[None, 40::37], axis=2), axis=0)
    found = Surface(fine, fine_triangles).closest(coarse[ids])
    return (
        MarkedMesh(
            Mesh(coarse, coarse_triangles), SurfacePoints.at_vertices(ids, coarse_triangles)
        ),
        MarkedMesh(Mesh(bend(fine), fine_triangles), found),
        bend(coarse),
    )


def test_registration_finds_the_bent_surface(surfaces):
    coarse, fine, truth = surfaces
    registered = register_coarse_neutral(coarse, fine, SETTINGS)
    inner = np.linalg.norm(coarse.mesh.vertices_mm[:, :2], axis=1) < 70
    error = np.linalg.norm(registered.vertices_mm - truth, axis=1)[inner]
    assert np.sqrt((error**2).mean()) < 0.5  # mm
    surface = Surface(fine.mesh.vertices_mm, fine.mesh.triangles)
    distance = surface.closest(registered.vertices_mm).distance_mm
    assert np.percentile(distance[inner], 95) < 0.1  # mm


def test_correspondence_and_its_file(surfaces, tmp_path):
    marked, fine, truth = surfaces
    coarse, accurate_mm = marked.mesh, fine.mesh.vertices_mm
    eye = coarse.vertices_mm[[np.argmin(np.abs(coarse.vertices_mm - [30, 20, 0]).sum(axis=1))]]
    settings = replace(SETTINGS, mask_radius_mm=50.0, eye_gap_mm=9.0)
    found, _ = find_correspondence(marked, fine, np.zeros(3), eye, settings)
    corners = coarse.vertices_mm[coarse.triangles[found.mask]]
    assert np.linalg.norm(corners, axis=2).max() <= 50.0
    assert np.linalg.norm(corners - eye, axis=2).min() > 9.0
    in_mask = np.unique(coarse.triangles[found.mask])
    assert not found.rigid[in_mask].any()
    error = np.linalg.norm(found.on_coarse(accurate_mm) - truth, axis=1)
    assert error[in_mask].mean() < 0.5  # mm
    found.save(tmp_path / "c.npz")
    read = Correspondence.load(tmp_path / "c.npz")
    np.testing.assert_array_equal(read.mask, found.mask)
    np.testing.assert_array_equal(read.on_coarse(accurate_mm), found.on_coarse(accurate_mm))


def test_a_damaged_correspondence_says_so(tmp_path):
    (tmp_path / "c.npz").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(InputError, match="unreadable correspondence"):
        Correspondence.load(tmp_path / "c.npz")


def test_too_few_landmarks_are_refused(surfaces):
    coarse, fine, _ = surfaces
    none = replace(coarse, landmarks=coarse.landmarks.restricted(np.zeros(len(fine.landmarks))))
    with pytest.raises(ValueError, match="at least 6 landmark pairs, got 0"):
        register_coarse_neutral(none, fine, SETTINGS)
