"""Flipped triangles, inner mouth before the lips, a ragged inner edge: each seen where it is made."""

from __future__ import annotations

import numpy as np
import pytest

from tests import lip_patch
from vermilion.config.evaluation import SurfaceConfig
from vermilion.correction.surface_quality import parabola_residuals
from vermilion.geometry.mesh import adjacency

from .test_image_contours import CAMERA, FACE, lip_surface


@pytest.fixture(scope="module")
def lips():
    return lip_surface()


def quality(lips, mesh, base=None):
    base = lip_patch.vertices_at(1.8, 0.0) if base is None else base
    return lips.measure(mesh[None], base[None], CAMERA)


def test_a_sound_mesh_has_nothing_to_say(lips):
    for opening_mm in (0.0, 1.8, 6.0):
        mesh = lip_patch.vertices_at(opening_mm, 0.0)
        found = quality(lips, mesh, mesh)
        assert not found.flipped[0] and not found.inner_mouth[0]
        assert found.roughness_ratio[0] == 1.0
        assert found.reasons() == [""]


def middle(mesh, region):
    """The vertex of a region nearest to the middle of its front."""
    ids = np.flatnonzero(region)
    return ids[np.argmax(mesh[ids] @ np.array([0.0, 0.0, 1.0]) - np.abs(mesh[ids, 0]))]


def folded_mesh():
    """A mesh of which one vertex is drawn over its neighbours."""
    mesh = lip_patch.vertices_at(1.8, 0.0)
    vertex = middle(mesh, FACE.regions["vermilion_upper"])
    near = adjacency(FACE.triangles, FACE.n_vertices)[[vertex]].indices
    over = mesh.copy()
    neighbour = near[np.argmax(np.abs(mesh[near, 0] - mesh[vertex, 0]))]
    over[vertex] += 3.0 * (mesh[neighbour] - mesh[vertex])
    return over


def mesh_with_inner_mouth():
    """A mesh whose innermost rows lie in front of the lower lip."""
    mesh = lip_patch.vertices_at(1.8, 0.0)
    row = np.arange(FACE.n_vertices) // lip_patch.COLUMNS  # the first are the innermost
    lower = (row < lip_patch.INNER_ROWS) & (mesh[:, 1] < 0)
    mesh[lower] += (lip_patch.INNER_ROWS - row[lower])[:, None] * np.array([0.0, -2.0, 4.0])
    return mesh


def mesh_with_teeth(height_mm):
    """A mesh whose inner edges have teeth of a height."""
    mesh = lip_patch.vertices_at(1.8, 0.0)
    mesh[:, 1] += height_mm * np.cos(2.5 * lip_patch.vertices_at(1.8, 0.0)[:, 0])
    return mesh


def test_a_vertex_drawn_over_its_neighbours_folds_triangles(lips):
    over = folded_mesh()
    found = quality(lips, over)
    assert found.folded[0] >= 2
    assert "flipped or folded" in found.reasons()[0]
    assert quality(lips, over, over).folded[0] == 0  # the base track's own are not the correction's


def test_inner_mouth_drawn_before_the_lip_is_seen(lips):
    found = quality(lips, mesh_with_inner_mouth())
    assert found.inner_mouth[0] and found.hidden_share[0] > 0.05
    assert "inner mouth in front of" in found.reasons()[0]


@pytest.mark.parametrize(
    ("key", "value", "mesh", "reason"),
    [
        ("folded_deg", 179.9, folded_mesh(), "folded"),
        ("crease_deg", 0.001, folded_mesh(), "folded"),
        ("inner_mouth_mm", 9.9, mesh_with_inner_mouth(), "inner mouth"),
        ("inner_mouth_share", 0.9, mesh_with_inner_mouth(), "inner mouth"),
        ("rough_ratio", 99.0, mesh_with_teeth(0.3), "rough"),
        ("rough_mm", 9.0, mesh_with_teeth(0.3), "rough"),
    ],
)
def test_what_counts_as_wrong_is_what_the_configuration_says(lips, key, value, mesh, reason):
    assert reason in quality(lips, mesh).reasons()[0]
    assert reason not in quality(lip_surface(**{key: value}), mesh).reasons()[0]


def test_teeth_in_the_inner_edge_are_rough_and_another_opening_is_not(lips):
    base = lip_patch.vertices_at(1.8, 0.0)
    side = np.sign(base[:, 1])
    teeth = mesh_with_teeth(0.3)
    assert quality(lips, teeth, base).roughness_ratio[0] > 3
    assert "times as rough" in quality(lips, teeth, base).reasons()[0]
    wider = base.copy()
    wider[:, 1] += side * 2.0 * np.clip(1 - (base[:, 0] / 20) ** 2, 0, None)
    assert quality(lips, wider, base).roughness_ratio[0] < 1.3


def test_the_inside_of_a_corner_that_the_upper_lip_hides_is_no_edge(lips):
    base = lip_patch.vertices_at(4.0, 0.0)
    row = np.arange(FACE.n_vertices) // lip_patch.COLUMNS
    corner = (base[:, 0] < -13) & (base[:, 0] > -19) & (base[:, 1] < 0)
    hidden = base.copy()
    hidden[corner & (row < lip_patch.INNER_ROWS)] += np.array([0.0, 12.0, -6.0])
    found = quality(lips, hidden, base)
    assert np.nanmax(lips.visible_edges_mm(hidden, CAMERA)[1]) < 0
    assert found.roughness_mm[0] < 1.3 * found.base_roughness_mm[0]


def test_an_edge_that_nobody_sees_to_be_rough_is_not_told(lips):
    base = lip_patch.vertices_at(1.8, 0.0)
    fine, seen = mesh_with_teeth(0.06), mesh_with_teeth(0.3)
    assert quality(lips, fine, base).roughness_ratio[0] > 1.3
    assert (
        quality(lips, fine, base).roughness_mm[0]
        < SurfaceConfig().rough_mm
        < quality(lips, seen, base).roughness_mm[0]
    )
    assert quality(lips, fine, base).reasons() == [""]
    assert quality(lips, seen, base).reasons() != [""]


def test_a_parabola_leaves_nothing():
    along = np.linspace(-1, 1, 40)
    left = parabola_residuals(40, 6) @ np.stack([3 * along**2 - along, np.cos(40 * along)], axis=1)
    assert np.abs(left[:, 0]).max() < 1e-12
    assert np.abs(left[:, 1]).max() > 0.5
