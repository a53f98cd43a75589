"""The contour baseline: which lip shapes, on whom, and their fit to contours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.heads import small_tracker
from vermilion.baselines.contour_tracker import ContourTracker
from vermilion.baselines.lip_shapes import LipShapes, medoids
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.layers import correction_layers
from vermilion.features.rings import lip_rings
from vermilion.geometry.camera import look_at, pinhole

FRONT = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def model():
    return small_tracker()


def test_medoids_stand_for_their_clusters_and_the_neutral_needs_none():
    rng = np.random.default_rng(0)
    middles = np.array([[9.0, 0.0], [0.0, 9.0], [-9.0, 0.0]])
    points = np.concatenate([m + 0.3 * rng.normal(size=(20, 2)) for m in [*middles, [0.0, 0.0]]])
    chosen = medoids(points, 3)
    assert (chosen // 20).tolist() == [0, 1, 2]
    assert np.linalg.norm(points[chosen] - middles, axis=1).max() < 0.2
    assert medoids(points[:2], 30).tolist() == [0, 1]


def pose_of(model, name):
    return model.neutral_mm + model.expressions_mm[model.expression_names.index(name)]


def mask_of(model, radius_mm=45.0):
    mouth = model.neutral_mm[model.outer_contour].mean(axis=0)
    near = np.linalg.norm(model.neutral_mm - mouth, axis=1) < radius_mm
    return np.flatnonzero(near[model.triangles].all(axis=1))


def test_a_shape_returns_to_the_identity_that_it_came_from(model):
    mask = mask_of(model)
    mesh = model.neutral_mm.copy()
    inside = np.unique(model.triangles[mask_of(model, 25.0)])
    mesh[inside] += 2.0 * np.random.default_rng(0).normal(size=(len(inside), 3))
    layers = correction_layers(model.neutral_mm, mesh[None], model.triangles[mask])
    shapes = LipShapes(np.array(["s/rom"]), np.array([3]), mask, layers)
    moved = shapes.on(model.neutral_mm, model.triangles, 0.0)
    tolerance_mm = 1e-4
    assert np.abs(moved[0] - (mesh - model.neutral_mm)).max() < tolerance_mm


def contours_of(model, camera, vertices):
    """What a perfect detector finds: the rings' own projections, the mouth open."""
    outer, inner = (camera.project(ring.points(vertices))[None] for ring in lip_rings(model, 80))
    found = np.ones((1, 80), dtype=bool)
    return ImageContours(model, camera, outer, inner, found, found)


def test_fitted_lips_lie_on_the_contours_and_stay_where_there_are_none(model):
    shape = pose_of(model, "mouthPucker") - model.neutral_mm
    tracker = ContourTracker(model, 1.2 * shape[None], 80, 1e-5)
    open_mm = model.vertices(None, 0.3 * (np.array(model.expression_names) == "jawOpen"))
    truth = open_mm + 0.6 * shape
    mouth = model.neutral_mm[model.outer_contour].mean(axis=0)
    camera = pinhole("cam", 900.0, 640, 480, look_at(mouth + 500 * FRONT, mouth, (0, 1, 0)))
    found = contours_of(model, camera, truth)
    still = np.eye(3)[None], np.zeros((1, 3))
    take = CoarseTake(
        np.zeros(1, int), open_mm[None], model.triangles, model.neutral_mm, *still, np.zeros((1, 0)),
        np.ones(1, bool),
    )  # fmt: skip
    weights = 0.3 * (np.array(model.expression_names) == "jawOpen")[None]
    fitted = tracker.track(take, found, weights)[0]
    ring = lip_rings(model, 80)[0]
    before, after = (
        np.linalg.norm(camera.project(ring.points(mesh)) - found.outer_px[0], axis=1).mean()
        for mesh in (open_mm, fitted)
    )
    assert after < 0.25 * before
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    assert (
        np.linalg.norm((fitted - truth)[lips], axis=1).mean()
        < 0.5 * np.linalg.norm((open_mm - truth)[lips], axis=1).mean()
    )

    nothing = np.zeros((1, 80), dtype=bool)
    lost = replace(found, outer_found=nothing, inner_found=nothing)
    np.testing.assert_allclose(tracker.track(take, lost, weights)[0], open_mm, atol=1e-9)
