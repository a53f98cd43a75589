"""The way from C to the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.unit.evaluation_face import sheet_face
from vermilion.evaluation.reference import (
    MatchTolerance,
    Reference,
    drift,
    reference_of,
    truth_of_vertices,
)
from vermilion.faces.lips import lip_sides, triangle_sides
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh
from vermilion.storage.errors import InputError


def test_truth_of_vertices_never_mixes_the_lips():
    """Lips that touch: position alone cannot tell them apart, labels can."""
    coarse, fine = sheet_face(gap_mm=0.0), sheet_face(step_mm=2.0, gap_mm=0.0)
    sides, of_fine = lip_sides(coarse), lip_sides(fine)
    where = Surface(fine.neutral_mm, fine.triangles).closest(
        coarse.neutral_mm, None, 0.5, sides, triangle_sides(fine.triangles, of_fine)
    )
    mesh = Mesh(fine.neutral_mm, fine.triangles)
    found = truth_of_vertices(where, mesh, of_fine, sides, mesh, MatchTolerance(3.0, 60.0))
    assert found.bound.all()
    corners = of_fine[fine.triangles[found.triangle]]
    for side in (1, -1):
        assert not (corners[sides == side] == -side).any()


def test_reference_follows_the_surface():
    model = sheet_face()
    where = Surface(model.neutral_mm, model.triangles).closest(model.neutral_mm)
    frames = model.neutral_mm + np.array([[[0.0, 0, 0]], [[1.0, 2.0, 3.0]]])
    reference = reference_of("truth", where, frames, model.triangles)
    assert np.abs(reference.points_mm - frames).max() < 1e-9
    unknown = where.restricted(np.arange(len(where)) != 5)
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
