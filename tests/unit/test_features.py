"""Features: the shape space, and contour distances on drawn mouths whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.mouths import crest, draw_mouth, ellipse, facing_camera, mouth_model
from vermilion.contours.curves import inward_normals
from vermilion.features.contour_features import ContourSampler, facing_interocular_px
from vermilion.features.distances import NAMES, contour_distances
from vermilion.features.rings import lip_rings
from vermilion.features.search import SearchSettings, find_inner
from vermilion.features.shape_space import shape_space
from vermilion.features.vector import FeatureTable, feature_names, quality_row
from vermilion.geometry.head_frame import head_from_world
from vermilion.geometry.mesh import vertex_areas
from vermilion.storage.errors import InputError

OUTER_WIDTH = NAMES.index("outer_width")


def ridge_maps(label, size=(240, 240), width_px=1.5):
    """Likelihood maps (inner, outer) with a Gaussian crest on the label's contours."""
    lines = (label.inner, label.outer)
    return tuple(crest(line.dense(0.1), size, width_px) for line in lines)


def sampler(model, **settings):
    return ContourSampler.of(model, 80, SearchSettings(**settings))


def test_rings_start_at_the_right_corner_and_run_over_the_upper_lip():
    model = mouth_model()
    for ring in lip_rings(model, 40):
        points = ring.points(model.neutral_mm)
        assert points[0, 0] == points[:, 0].min()
        assert points[20, 0] == pytest.approx(points[:, 0].max())
        assert (points[1:20, 1] > points[39:20:-1, 1]).all()
        step = np.linalg.norm(np.diff(points[:21], axis=0), axis=1)
        assert step.max() < 1.1 * step.min()


def test_rings_do_not_depend_on_where_the_loop_starts_or_which_way_it_runs():
    from dataclasses import replace

    model = mouth_model()
    turned = replace(model, outer_contour=np.roll(model.outer_contour, 7)[::-1])
    expected = lip_rings(model, 40)[0].points(model.neutral_mm)
    found = lip_rings(turned, 40)[0].points(model.neutral_mm)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_distances_of_known_ellipses():
    angle = np.pi - np.linspace(0, 2 * np.pi, 400, endpoint=False)
    outer = np.stack([50 * np.cos(angle), -20 * np.sin(angle)], axis=1)
    inner = np.stack([50 * np.cos(angle), -5 * np.sin(angle)], axis=1)
    found = dict(zip(NAMES, contour_distances(outer, inner, 200.0), strict=True))
    assert len(found) == 20
    assert found["outer_width"] == pytest.approx(0.5)
    assert found["outer_height_5"] == pytest.approx(0.2, rel=0.01)
    assert found["upper_lip_5"] == pytest.approx(0.075, rel=0.01)
    assert found["lower_lip_5"] == pytest.approx(0.075, rel=0.01)
    height = 2 * 20 * np.sin(0.3 * np.pi) / 200
    assert found["outer_height_3"] == pytest.approx(height, rel=0.02)


def test_contours_are_found_from_a_model_that_is_wrong():
    """The coarse mouth is 20 % too low and too thin; the maps have the right one."""
    _, _, label = draw_mouth(9.0, 26.0)
    model, camera = mouth_model(7.0, 20.0, 49.0), facing_camera()
    found = sampler(model).find(model.neutral_mm, camera, ridge_maps(label))
    assert found.outer_found.mean() > 0.95
    for points, line in ((found.outer_px, label.outer), (found.inner_px[4:37], label.inner)):
        gap = np.linalg.norm(points[:, None] - line.dense(0.1)[None], axis=-1).min(axis=1)
        assert gap.mean() < 0.3
    truth = dict(zip(NAMES, found.distances, strict=True))
    assert truth["outer_height_5"] == pytest.approx(52 / 200, abs=0.004)
    assert truth["upper_lip_5"] == pytest.approx(17 / 200, abs=0.004)


def test_closed_mouth_gives_lips_that_meet():
    _, _, label = draw_mouth(0.3, 20.0)
    model, camera = mouth_model(6.0, 22.0), facing_camera()
    found = sampler(model).find(model.neutral_mm, camera, ridge_maps(label))
    value = dict(zip(NAMES, found.distances, strict=True))
    gap = value["outer_height_5"] - value["upper_lip_5"] - value["lower_lip_5"]
    assert abs(gap) < 0.01


def test_a_weak_ridge_beside_the_teeth_is_not_passed_over_for_the_other_lip():
    """The upper lip's border is faint, the lower one clear, the coarse mouth as open as the true."""
    _, _, label = draw_mouth(9.0, 26.0)
    model, camera = mouth_model(9.0, 26.0), facing_camera()
    inner, outer = ridge_maps(label)
    corner_row = label.inner.points_px[:, 1].mean()
    inner = inner.copy()
    inner[: int(corner_row) - 2] *= 0.05
    found = sampler(model).find(model.neutral_mm, camera, (inner, outer))
    middle = np.arange(12, 29)
    assert (found.inner_px[middle, 1] < corner_row - 4).all()


def test_landmarks_tell_how_thick_a_lip_is_where_the_models_is_another():
    """An upper lip of 3 px above teeth; the model's closed mouth has one of 16 px, near the lower lip's border."""
    model, camera = mouth_model(0.3, 16.0), facing_camera()
    outer, inner = (ellipse((120.0, 150.0), 52.0, height, 80) for height in (16.0, 13.0))
    inner[41:, 1] = 150.0 + 2.0 * (inner[41:, 1] - 150.0) / 13.0
    upper = crest(inner[:41], (240, 240), 1.5)
    maps = (
        np.maximum(0.5 * upper, crest(inner[40:], (240, 240), 1.5)),
        crest(outer, (240, 240), 1.5),
    )
    middle = np.arange(12, 29)
    of_model = sampler(model).find(model.neutral_mm, camera, maps)
    assert of_model.inner_px[middle, 1].mean() > 148
    found = sampler(model).find(model.neutral_mm, camera, maps, lips_px=(outer, inner))
    np.testing.assert_allclose(found.inner_px[middle, 1], inner[middle, 1], atol=1.5)


@pytest.mark.parametrize(
    "view",
    [
        {"shift": (13.3, -7.7)},
        {"scale": 1.6, "size": (400, 400)},
        {"angle": 0.4, "size": (300, 300)},
        {"angle": -0.6, "scale": 1.3, "size": (380, 380)},
    ],
)
def test_distances_do_not_change_when_the_image_moves_grows_or_turns(view):
    _, _, label = draw_mouth(9.0, 26.0)
    model = mouth_model(7.0, 22.0, 50.0)
    expected = sampler(model).find(model.neutral_mm, facing_camera(), ridge_maps(label)).distances
    camera = facing_camera(**view)
    image_view = {k: v for k, v in view.items() if k != "shift"}
    _, _, moved = draw_mouth(9.0, 26.0, **image_view)
    shift = view.get("shift", (0.0, 0.0))
    from vermilion.contours.labels import ContourLabel, Polyline

    moved = ContourLabel(
        *(Polyline(line.points_px + shift, True) for line in (moved.inner, moved.outer))
    )
    maps = ridge_maps(moved, view.get("size", (240, 240)), 1.5 * view.get("scale", 1.0))
    found = sampler(model).find(model.neutral_mm, camera, maps).distances
    np.testing.assert_allclose(found, expected, atol=0.004)


def test_a_lip_is_as_thick_as_the_models_where_only_its_outer_contour_is_seen():
    outer = ellipse((120.0, 150.0), 40.0, 26.0, 80)
    model_outer, model_inner = (
        ellipse((120.0, 150.0), width, height, 80) for width, height in ((52.0, 26.0), (40.0, 14.0))
    )
    nothing = np.zeros((240, 240), dtype=np.float32)
    found = find_inner(nothing, outer, model_inner - model_outer, 200.0, SearchSettings())
    assert not found.found.any()
    thickness = np.linalg.norm(found.points - outer, axis=1)
    np.testing.assert_allclose(thickness, 12.0, atol=1.5)


def test_without_maps_or_without_maxima_the_models_contour_stands_in():
    model, camera = mouth_model(), facing_camera()
    nothing = sampler(model).find(model.neutral_mm, camera, None)
    np.testing.assert_array_equal(nothing.outer_px, nothing.model_outer_px)
    empty = np.zeros((240, 240), dtype=np.float32)
    blank = sampler(model).find(model.neutral_mm, camera, (empty, empty))
    assert not blank.outer_found.any()
    np.testing.assert_allclose(blank.outer_px, blank.model_outer_px, atol=0.5)
    np.testing.assert_allclose(blank.distances, nothing.distances, atol=0.02)
    row = quality_row(3, blank, True, True, 0.6)
    assert not row.valid
    assert "0% of the outer contour" in row.reason


def test_a_speck_does_not_pull_the_ring():
    _, _, label = draw_mouth(9.0, 26.0)
    model, camera = mouth_model(9.0, 26.0), facing_camera()
    inner, outer = ridge_maps(label)
    outer = outer.copy()
    outer[108:112, 118:122] = 1.0  # a bright mole 14 px above the lip
    found = sampler(model).find(model.neutral_mm, camera, (inner, outer))
    gap = np.linalg.norm(found.outer_px[:, None] - label.outer.dense(0.1)[None], axis=-1).min(1)
    assert gap.max() < 1.0


def test_normals_of_a_ring_point_inwards_whichever_way_it_runs():
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(inward_normals(circle), -circle, atol=1e-9)
    np.testing.assert_allclose(inward_normals(circle[::-1]), -circle[::-1], atol=1e-9)


def test_unit_does_not_shrink_when_the_head_turns():
    camera = facing_camera()
    corners = np.array([[-100.0, 80.0, 0.0], [100.0, 80.0, 0.0]])
    yaw = np.radians(35)
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    assert facing_interocular_px(corners, camera) == pytest.approx(200.0)
    assert facing_interocular_px(corners @ turn.T, camera) == pytest.approx(200.0, rel=1e-6)


def test_shape_space_keeps_the_asked_variance_and_reproduces_what_it_spans():
    model = mouth_model()
    space = shape_space(model, 0.99)
    assert space.size == 2  # the third expression hardly moves anything
    assert space.kept > 0.99
    assert shape_space(model, 1.0).size == 3
    weights = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.7, 0.0]])
    displacement = model.vertices(None, weights) - model.neutral_mm
    coefficients = space.coefficients(displacement)
    np.testing.assert_allclose(coefficients[0], 0, atol=1e-12)
    area = vertex_areas(model.neutral_mm, model.triangles)
    size = np.sqrt((displacement**2).sum(-1) @ (area / area.sum()))
    np.testing.assert_allclose(np.linalg.norm(coefficients, axis=1), size, rtol=0.01)


def test_displacement_forgets_the_pose():
    model = mouth_model()
    weights = np.array([[0.4, 0.2, 0.0]])
    local = model.vertices(None, weights)
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = np.array([[10.0, -4.0, 900.0]])
    world = local @ turn.T + shift
    found = head_from_world(world, turn[None], shift) - model.neutral_mm
    np.testing.assert_allclose(found, local - model.neutral_mm, atol=1e-9)


def test_feature_table_comes_back_as_written(tmp_path):
    model, camera = mouth_model(), facing_camera()
    found = sampler(model).find(model.neutral_mm, camera, None)
    table = FeatureTable.of((2, 3), np.ones((2, 3)), [found, found], [True, False])
    table.save(tmp_path / "0.npz")
    read = FeatureTable.load(tmp_path / "0.npz")
    assert read.frames.tolist() == [2, 3]
    assert read.features.shape == (2, 23)
    assert read.names.tolist() == feature_names(3).tolist()
    assert read.valid.tolist() == [True, False]
    assert read.outer_found.shape == read.outer_px.shape[:2]
    assert not read.outer_found.any() and not read.inner_found.any()  # no maps were given
    (tmp_path / "0.npz").write_bytes(b"PK damaged")
    with pytest.raises(InputError, match="unreadable feature file"):
        FeatureTable.load(tmp_path / "0.npz")
