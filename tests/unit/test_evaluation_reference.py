"""Nearest points and the way from C to the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.evaluation_face import sheet_face
from vermilion.evaluation.reference import Reference, drift, reference_of, truth_of_vertices
from vermilion.faces.lips import lip_labels
from vermilion.geometry.closest_points import Surface, SurfacePoints, _closest_of
from vermilion.geometry.mesh import vertex_normals
from vermilion.storage.errors import InputError


def brute_force(points, vertices, triangles, samples=40):
    """Nearest of many points sampled on the triangles: never nearer than the truth."""
    u, v = np.meshgrid(np.linspace(0, 1, samples), np.linspace(0, 1, samples))
    keep = u + v <= 1 + 1e-9
    weights = np.stack([1 - u - v, u, v], axis=-1)[keep]
    cloud = np.einsum("sk,tkd->tsd", weights, vertices[triangles]).reshape(-1, 3)
    return np.array([np.linalg.norm(cloud - p, axis=1).min() for p in points])


def test_nearest_point_is_exact_on_a_mesh_with_very_long_triangles():
    model = sheet_face(step_mm=12.0)
    vertices = model.neutral_mm.copy()
    vertices[vertices[:, 1] > 40, 1] += 400
    rng = np.random.default_rng(0)
    points = rng.uniform(-80, 80, (60, 3))
    found = Surface(vertices, model.triangles).closest(points)
    sampled = brute_force(points, vertices, model.triangles)
    assert (found.distance_mm <= sampled + 1e-9).all()
    assert (sampled - found.distance_mm).max() < 6.0  # the samples are up to 11 mm apart
    surface = Surface(vertices, model.triangles)
    everything = np.tile(np.arange(len(surface.corners)), (len(points), 1))
    exact, none = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    _closest_of(
        points, np.zeros_like(points), none, np.arange(len(points)), everything, surface.corners,
        surface.normals, np.zeros(len(surface.corners), np.int64), -2.0, exact, none.copy(),
        np.zeros_like(points),
    )  # fmt: skip
    assert (found.distance_mm == exact).all()
    on = found.on(vertices, model.triangles)
    assert np.abs(np.linalg.norm(points - on, axis=1) - found.distance_mm).max() < 1e-9


def test_no_point_where_no_triangle_faces_the_same_way():
    model = sheet_face()
    surface = Surface(model.neutral_mm, model.triangles)
    normals = vertex_normals(model.neutral_mm, model.triangles)
    assert surface.closest(model.neutral_mm, normals).found.all()
    assert not surface.closest(model.neutral_mm, -normals).found.any()


def test_truth_of_vertices_never_mixes_the_lips():
    """Lips that touch: position alone cannot tell them apart, labels can."""
    coarse, fine = sheet_face(gap_mm=0.0), sheet_face(step_mm=2.0, gap_mm=0.0)
    where = Surface(fine.neutral_mm, fine.triangles).closest(
        coarse.neutral_mm, None, 0.5, lip_labels(coarse), lip_labels(fine)[fine.triangles].max(1)
    )
    labels = lip_labels(coarse)
    found = truth_of_vertices(
        where, fine.neutral_mm, fine.triangles, lip_labels(fine), labels,
        fine.neutral_mm, fine.triangles, 3.0, 0.5,
    )  # fmt: skip
    assert found.found.all()
    corners = lip_labels(fine)[fine.triangles[found.triangle]]
    for side, other in ((1, 2), (2, 1)):
        assert not (corners[labels == side] == other).any()


def test_reference_follows_the_surface():
    model = sheet_face()
    where = Surface(model.neutral_mm, model.triangles).closest(model.neutral_mm)
    frames = model.neutral_mm + np.array([[[0.0, 0, 0]], [[1.0, 2.0, 3.0]]])
    reference = reference_of("truth", where, frames, model.triangles)
    assert np.abs(reference.points_mm - frames).max() < 1e-9
    unknown = SurfacePoints(
        np.where(np.arange(len(where.triangle)) == 5, -1, where.triangle),
        where.barycentric,
        where.distance_mm,
    )
    valid = reference_of("truth", unknown, frames, model.triangles).valid
    assert np.flatnonzero(~valid).tolist() == [5]
    nowhere = replace(where, triangle=np.full_like(where.triangle, -1))
    with pytest.raises(InputError, match="take rom: found no vertex with a point on the surface"):
        reference_of("truth", nowhere, frames, model.triangles, subject="anna", take="rom")


def test_drift_is_the_way_along_the_surface_and_not_off_it():
    model = sheet_face()
    flat = model.neutral_mm * [1.0, 1.0, 0.0]
    truth = np.stack([flat, flat])
    reference = Reference("truth", truth, truth, model.triangles)
    inner = np.abs(flat[:, :2]).max(axis=1) < 40
    inner &= np.abs(flat[:, 1]) > 12  # away from the slit
    slid = np.stack([flat, flat + np.array([0.7, 0.0, 0.5])])
    result = drift(slid, model.triangles, reference, inner, 0.5)
    assert np.abs(result[0, inner]).max() < 1e-9
    assert np.abs(result[1, inner] - 0.7).max() < 1e-9
    assert np.isnan(result[:, ~inner]).all()
