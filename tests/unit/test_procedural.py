"""Facts about the generated head: a closed skin, an adult's proportions, regions and contours."""

from __future__ import annotations

import numpy as np
import pytest

from tests import heads
from vermilion.faces import procedural, procedural_layout
from vermilion.faces.model import REGIONS, FaceModel
from vermilion.faces.procedural import tracker_model
from vermilion.geometry.mesh import boundary_edges, triangle_areas, unique_edges, vertex_normals


@pytest.fixture(params=["studio", "template", "tracker"])
def part(request) -> FaceModel:
    return getattr(heads, request.param)()


# -- topology ------------------------------------------------------------------------------------


def test_every_edge_joins_two_triangles_consistently_or_lies_on_a_rim(part):
    t = part.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    assert len(np.unique(directed, axis=0)) == len(directed), "an edge runs the same way twice"
    starts = boundary_edges(t)[:, 0]
    assert len(np.unique(starts)) == len(starts), "two rims touch"
    assert len(np.unique(t)) == part.n_vertices, "a vertex without a triangle"


def test_rims_are_the_neck_the_lids_and_the_end_of_the_fold(studio, template):
    def rims(model: FaceModel) -> int:
        after = dict(boundary_edges(model.triangles).tolist())
        loops = 0
        while after:
            loops += 1
            at = next(iter(after))
            while at in after:
                at = after.pop(at)
        return loops

    assert rims(studio) == 3  # the socket is closed
    assert rims(template) == 4


def test_triangles_face_outwards(studio, tracker):
    for model in (studio, tracker):
        skin = ~(model.regions["mouth_inner"] | model.regions["eyes"] | model.regions["teeth"])
        used = np.zeros(model.n_vertices, dtype=bool)
        used[model.landmarks[:36]] = True
        normals = vertex_normals(model.neutral_mm, model.triangles)
        outward = (normals * (model.neutral_mm - [0, 0, 20])).sum(axis=1)
        assert (outward[used & skin] > 0).all()
        tip = model.landmarks[30]
        assert normals[tip, 2] > 0.3


def test_parts_have_their_own_topologies(studio, template, tracker):
    assert 12_000 <= studio.n_vertices <= 25_000
    assert 6_000 <= template.n_vertices <= 11_000
    assert 2_500 <= tracker.n_vertices <= 4_000
    assert abs(len(tracker.triangles) - 6000) < 300
    assert template.n_expressions == 0
    assert not any("Roll" in n or "Press" in n or "Funnel" in n for n in tracker.expression_names)
    assert set(tracker.expression_names) < set(studio.expression_names)


def test_building_twice_gives_the_same_model():
    a = heads.small_tracker()
    for kept in (procedural._tracker_layout, procedural_layout._border_places):
        kept.cache_clear()
    b = tracker_model(2500, n_identities=4)
    np.testing.assert_array_equal(a.neutral_mm, b.neutral_mm)
    np.testing.assert_array_equal(a.triangles, b.triangles)
    np.testing.assert_array_equal(a.expressions_mm, b.expressions_mm)


# -- proportions ---------------------------------------------------------------------------------


def test_proportions_are_an_adults(studio):
    p = studio.neutral_mm[studio.landmarks]
    assert 145 < np.ptp(studio.neutral_mm[studio.regions["face"], 0]) < 160
    pupils = np.linalg.norm((p[36] + p[39]) / 2 - (p[42] + p[45]) / 2)
    assert pupils == pytest.approx(63, abs=2)
    assert np.linalg.norm(p[58] - p[62]) == pytest.approx(52, abs=1)
    assert 105 < p[27, 1] - p[8, 1] < 125  # nasion to menton


def test_landmarks_are_symmetric_and_in_order(part):
    p = part.neutral_mm[part.landmarks]
    pairs = [(k, 16 - k) for k in range(8)] + [(17 + k, 26 - k) for k in range(5)]
    pairs += [(31, 35), (32, 34), (36, 45), (37, 44), (38, 43), (39, 42), (40, 47), (41, 46)]
    pairs += [(48, 52), (49, 51), (57, 53), (56, 54), (58, 62), (59, 61), (65, 63)]
    right, left = p[[a for a, _ in pairs]], p[[b for _, b in pairs]]
    # Skin vertices are the nearest of a mesh that need not be symmetric; the jaw's are far apart.
    spacing_mm = 9.0 if part.n_vertices < 5000 else 5.0
    assert np.linalg.norm(right * [-1, 1, 1] - left, axis=1).max() < spacing_mm
    assert (right[:, 0] < 0).all()
    np.testing.assert_allclose(right[-15:] * [-1, 1, 1], left[-15:], atol=0.6)  # eyes and lips
    assert len(np.unique(part.landmarks)) == 66


def test_regions_are_plausible(part):
    assert set(part.regions) == set(REGIONS)
    areas = triangle_areas(part.neutral_mm, part.triangles)

    def area(name: str) -> float:
        return float(areas[part.regions[name][part.triangles].all(axis=1)].sum())

    assert 350 < area("vermilion_upper") < 550  # mm2
    assert 400 < area("vermilion_lower") < 650
    assert 25_000 < area("face") < 60_000
    assert area("rigid") > 1_000
    assert not (part.regions["mouth_inner"] & part.regions["face"]).any()


def test_contours_are_closed_loops_of_edges_with_the_corners(part):
    edges = {tuple(e) for e in unique_edges(part.triangles).tolist()}
    for loop in (part.outer_contour, part.inner_contour):
        steps = np.sort(np.stack([loop, np.roll(loop, -1)], axis=1), axis=1)
        assert all(tuple(step) in edges for step in steps.tolist())
    assert {part.landmarks[58], part.landmarks[62]} <= set(part.outer_contour)


def test_uv_lie_in_the_unit_square_and_do_not_fold_on_face_and_lips(part):
    assert part.uv.min() >= 0 and part.uv.max() <= 1
    skin = part.regions["face"] | part.regions["mouth_inner"]
    a, b, c = (part.uv[part.triangles[skin[part.triangles].all(axis=1)][:, k]] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (signed > 0).mean() > 0.995


def test_the_same_face_at_three_resolutions(studio, template, tracker):
    for k in (30, 48, 50, 55, 58, 62):
        points = [m.neutral_mm[m.landmarks[k]] for m in (studio, tracker)]
        assert np.linalg.norm(points[0] - points[1]) < 2.0
    assert template.n_identities == tracker.n_identities == studio.n_identities


def test_a_saved_model_comes_back(tmp_path, tracker):
    path = tmp_path / "tracker.npz"
    tracker.save(path)
    loaded = FaceModel.load(path)
    np.testing.assert_array_equal(loaded.triangles, tracker.triangles)
    np.testing.assert_allclose(loaded.neutral_mm, tracker.neutral_mm)
    assert loaded.expression_names == tracker.expression_names
    for name in REGIONS:
        np.testing.assert_array_equal(loaded.regions[name], tracker.regions[name])
