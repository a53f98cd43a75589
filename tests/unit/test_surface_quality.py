"""Flipped triangles, inner mouth before the lips, a ragged inner edge: each seen where it is made."""

from __future__ import annotations

import numpy as np
import pytest

from tests import lip_patch
from vermilion.correction.surface_quality import SEEN_MM, LipSurface, parabola_residuals
from vermilion.geometry.mesh import adjacency

from .test_image_contours import CAMERA, FACE


@pytest.fixture(scope="module")
def lips():
    return LipSurface(FACE)


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


def test_a_vertex_drawn_over_its_neighbours_folds_triangles(lips):
    mesh = lip_patch.vertices_at(1.8, 0.0)
    vertex = middle(mesh, FACE.regions["vermilion_upper"])
    near = adjacency(FACE.triangles, FACE.n_vertices)[[vertex]].indices
    over = mesh.copy()
    neighbour = near[np.argmax(np.abs(mesh[near, 0] - mesh[vertex, 0]))]
    over[vertex] += 3.0 * (mesh[neighbour] - mesh[vertex])
    found = quality(lips, over)
    assert found.folded[0] >= 2
    assert "flipped or folded" in found.reasons()[0]
    assert quality(lips, over, over).folded[0] == 0  # the base track's own are not the correction's


def test_inner_mouth_drawn_before_the_lip_is_seen(lips):
    mesh = lip_patch.vertices_at(1.8, 0.0)
    before = mesh.copy()
    row = np.arange(FACE.n_vertices) // lip_patch.COLUMNS  # the first are the innermost
    lower = (row < lip_patch.INNER_ROWS) & (mesh[:, 1] < 0)
    before[lower] += (lip_patch.INNER_ROWS - row[lower])[:, None] * np.array([0.0, -2.0, 4.0])
    found = quality(lips, before)
    assert found.inner_mouth[0] and found.hidden_share[0] > 0.05
    assert "inner mouth in front of" in found.reasons()[0]


def test_teeth_in_the_inner_edge_are_rough_and_another_opening_is_not(lips):
    base = lip_patch.vertices_at(1.8, 0.0)
    side = np.sign(base[:, 1])
    teeth = base.copy()
    teeth[:, 1] += 0.3 * np.cos(2.5 * base[:, 0])
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
    fine, seen = base.copy(), base.copy()
    fine[:, 1] += 0.06 * np.cos(2.5 * base[:, 0])
    seen[:, 1] += 0.3 * np.cos(2.5 * base[:, 0])
    assert quality(lips, fine, base).roughness_ratio[0] > 1.3
    assert (
        quality(lips, fine, base).roughness_mm[0]
        < SEEN_MM
        < quality(lips, seen, base).roughness_mm[0]
    )
    assert quality(lips, fine, base).reasons() == [""]
    assert quality(lips, seen, base).reasons() != [""]


def test_a_parabola_leaves_nothing():
    along = np.linspace(-1, 1, 40)
    left = parabola_residuals(40, 6) @ np.stack([3 * along**2 - along, np.cos(40 * along)], axis=1)
    assert np.abs(left[:, 0]).max() < 1e-12
    assert np.abs(left[:, 1]).max() > 0.5
