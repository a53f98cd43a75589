"""Correspondence: closest points, back-projection, registration, the mask."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.unit.test_integration import sheet
from vermilion.correspondence.binding import bind_vertices, flipped_triangles
from vermilion.correspondence.correspondence import Correspondence, find_correspondence
from vermilion.correspondence.landmarks import back_project
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.head_frame import align_frames, head_from_world, world_from_head
from vermilion.geometry.mesh import Mesh, topology_hash, vertex_normals
from vermilion.geometry.registration import register, similarity_alignment
from vermilion.geometry.surface_points import (
    SurfaceMap,
    at_vertices,
    closest_barycentric,
    closest_on_surface,
)
from vermilion.storage.errors import InputError


def test_closest_point_of_a_triangle_in_every_region():
    corners = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    cases = {
        (1.0, 1.0, 5.0): (1, 1, 0),  # over the inside
        (2.0, -3.0, 1.0): (2, 0, 0),  # beyond an edge
        (4.0, 4.0, 0.0): (2, 2, 0),  # beyond the long edge
        (-1.0, -1.0, 2.0): (0, 0, 0),  # beyond a corner
        (9.0, -1.0, 0.0): (4, 0, 0),
    }
    points = np.array(list(cases))
    weights = closest_barycentric(points, np.broadcast_to(corners, (5, 3, 3)))
    np.testing.assert_allclose(weights @ corners, np.array(list(cases.values())), atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)


def test_closest_point_agrees_with_brute_force():
    vertices, triangles, _ = sheet(14)
    mesh = Mesh(vertices, triangles)
    rng = np.random.default_rng(0)
    points = vertices[rng.integers(0, len(vertices), 60)] + rng.normal(scale=4.0, size=(60, 3))
    _, distance = closest_on_surface(points, mesh)
    weights = closest_barycentric(points[:, None], vertices[triangles][None])
    found = (weights[..., None] * vertices[triangles]).sum(axis=2)
    plain = np.linalg.norm(found - points[:, None], axis=2).min(axis=1)
    np.testing.assert_allclose(distance, plain, atol=1e-9)


def test_a_surface_that_faces_away_or_is_the_other_lip_is_no_match():
    lower, triangles, _ = sheet(8)
    upper = lower + np.array([0, 0, 2.0])
    both = np.concatenate([lower, upper])
    mesh = Mesh(both, np.concatenate([triangles, triangles[:, ::-1] + len(lower)]))
    points = lower + np.array([0, 0, 1.5])  # nearer to the upper sheet
    free, _ = closest_on_surface(points, mesh)
    assert (free.triangle >= len(triangles)).mean() > 0.9
    facing, _ = closest_on_surface(points, mesh, normals=vertex_normals(lower, triangles))
    assert np.all(facing.triangle < len(triangles))
    sides = np.repeat([-1, 1], len(triangles))
    same_lip, _ = closest_on_surface(
        points, mesh, sides=np.full(len(points), -1), triangle_sides=sides
    )
    assert np.all(same_lip.triangle < len(triangles))


def test_bound_triangles_never_face_against_their_surface():
    vertices, triangles, _ = sheet(20)
    surface = Mesh(vertices, triangles)
    folded = vertices + np.array([0.0, 0, 0.2])
    middle = np.argmin(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1))
    spacing = np.sort(np.linalg.norm(vertices - vertices[middle], axis=1))[1]
    folded[middle, :2] += [1.6 * spacing, 0.3 * spacing]  # past its neighbour
    registered = Mesh(folded, triangles)
    direct, _ = closest_on_surface(folded, surface)
    assert flipped_triangles(direct, triangles, surface).any()
    found, distance = bind_vertices(registered, surface, max_distance_mm=5.0, max_angle_deg=70.0)
    assert found.bound.all() and not flipped_triangles(found, triangles, surface).any()
    away = np.linalg.norm(vertices - vertices[middle], axis=1) > 4 * spacing
    np.testing.assert_array_equal(found.triangle[away], direct.triangle[away])
    assert distance.max() < 3 * spacing


def test_a_bound_point_moves_with_its_mesh():
    vertices, triangles, _ = sheet(8)
    bound, _ = closest_on_surface(vertices[::3] + 0.4, Mesh(vertices, triangles))
    rotation = Rotation.from_rotvec([0.2, 0.5, -0.1]).as_matrix()
    moved = bound.sample(vertices @ rotation.T + 7.0, triangles)
    np.testing.assert_allclose(
        moved, bound.sample(vertices, triangles) @ rotation.T + 7.0, atol=1e-9
    )
    matrix = bound.matrix(triangles, len(vertices))
    np.testing.assert_allclose(matrix @ vertices, bound.sample(vertices, triangles), atol=1e-12)
    np.testing.assert_allclose(
        at_vertices(np.array([3, 40]), triangles).sample(vertices, triangles), vertices[[3, 40]]
    )


def test_unbound_points_are_nan():
    vertices, triangles, _ = sheet(6)
    points = SurfaceMap(np.array([-1, 0]), np.full((2, 3), 1 / 3))
    assert np.isnan(points.sample(vertices, triangles)).all(axis=1).tolist() == [True, False]


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


def test_similarity_is_recovered():
    points = np.random.default_rng(0).normal(size=(20, 3))
    rotation = Rotation.from_rotvec([1.0, 0.3, -2.0]).as_matrix()
    scale, found, translation = similarity_alignment(points, 1.7 * points @ rotation.T + [1, 2, 3])
    assert scale == pytest.approx(1.7)
    np.testing.assert_allclose(found, rotation, atol=1e-12)
    np.testing.assert_allclose(translation, [1, 2, 3], atol=1e-12)


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
    found, _ = closest_on_surface(coarse[ids], Mesh(fine, fine_triangles))
    return (
        Mesh(coarse, coarse_triangles),
        Mesh(bend(fine), fine_triangles),
        at_vertices(ids, coarse_triangles),
        found,
        bend(coarse),
    )


def test_registration_finds_the_bent_surface(surfaces):
    coarse, fine, on_coarse, on_fine, truth = surfaces
    registered = register(coarse, fine, on_coarse, on_fine)
    inner = np.linalg.norm(coarse.vertices_mm[:, :2], axis=1) < 70
    error = np.linalg.norm(registered.vertices_mm - truth, axis=1)[inner]
    assert np.sqrt((error**2).mean()) < 0.5  # mm
    _, distance = closest_on_surface(registered.vertices_mm, fine)
    assert np.percentile(distance[inner], 95) < 0.1  # mm


def test_correspondence_and_its_file(surfaces, tmp_path):
    coarse, fine, on_coarse, on_fine, truth = surfaces
    eye = coarse.vertices_mm[[np.argmin(np.abs(coarse.vertices_mm - [30, 20, 0]).sum(axis=1))]]
    found, _ = find_correspondence(
        coarse, fine, on_coarse, on_fine, np.zeros(3), eye, mask_radius_mm=50.0, eye_gap_mm=9.0
    )
    corners = coarse.vertices_mm[coarse.triangles[found.mask]]
    assert np.linalg.norm(corners, axis=2).max() <= 50.0
    assert np.linalg.norm(corners - eye, axis=2).min() > 9.0
    in_mask = np.unique(coarse.triangles[found.mask])
    assert not found.rigid[in_mask].any()
    error = np.linalg.norm(found.on_coarse(fine.vertices_mm) - truth, axis=1)
    assert error[in_mask].mean() < 0.5  # mm
    found.save(tmp_path / "c.npz")
    read = Correspondence.load(tmp_path / "c.npz")
    np.testing.assert_array_equal(read.mask, found.mask)
    np.testing.assert_array_equal(
        read.on_coarse(fine.vertices_mm), found.on_coarse(fine.vertices_mm)
    )
    assert read.topology == topology_hash(coarse.triangles)


def test_a_damaged_correspondence_says_so(tmp_path):
    (tmp_path / "c.npz").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(InputError, match="unreadable correspondence"):
        Correspondence.load(tmp_path / "c.npz")


def test_too_few_landmarks_are_refused(surfaces):
    coarse, fine, on_coarse, on_fine, _ = surfaces
    none = SurfaceMap(np.full(len(on_coarse.triangle), -1), on_coarse.barycentric)
    with pytest.raises(ValueError, match="at least 6 landmark pairs, got 0"):
        register(coarse, fine, none, on_fine)


def test_head_frame_there_and_back():
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(4, 7, 3))
    rotation = Rotation.from_rotvec(rng.normal(size=(4, 3))).as_matrix()
    translation = rng.normal(size=(4, 3))
    head = head_from_world(vertices, rotation, translation)
    np.testing.assert_allclose(world_from_head(head, rotation, translation), vertices, atol=1e-12)
    point = rotation[2] @ head[2, 5] + translation[2]
    np.testing.assert_allclose(point, vertices[2, 5], atol=1e-12)


def test_heads_are_aligned_by_the_part_that_does_not_move():
    """A fifth of the rigid vertices moves by 5 mm; the alignment does not follow them."""
    rng = np.random.default_rng(0)
    neutral = rng.normal(scale=50, size=(60, 3))
    rotation = Rotation.from_rotvec(0.2 * rng.normal(size=(3, 3))).as_matrix()
    moved = np.repeat(neutral[None], 3, axis=0)
    moved[:, :8] += [0, 5.0, 0]
    moved = moved @ np.swapaxes(rotation, 1, 2) + 30.0
    chosen = np.arange(60) < 50
    aligned, _ = align_frames(moved, neutral, chosen)
    np.testing.assert_allclose(aligned[:, 8:], neutral[None, 8:].repeat(3, 0), atol=0.05)
    assert np.isnan(align_frames(moved * np.nan, neutral, chosen)[0]).all()
