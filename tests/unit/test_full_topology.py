"""The full face model in the place of the tracker's mesh: what it must give back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vermilion.correspondence.models import bind_models
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.full_topology import FullFace
from vermilion.export.shape_basis import shape_basis
from vermilion.faces import procedural
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.polygons import Polygons


@pytest.fixture(scope="module")
def scene():
    """Studio and tracker of the embedded model, a person, three frames of the tracker's own shapes."""
    studio = procedural.studio_model(1.2, 6)
    tracker = procedural.tracker_model(3000, 6)
    identity = np.array([1.0, -0.7, 0.5, 0, 0.3, 0])
    weights = np.zeros((3, tracker.n_expressions))
    names = tracker.expression_names
    weights[1, names.index("jawOpen")] = 0.6
    weights[2, names.index("mouthSmile_L")] = 0.9
    head = HeadFrame(np.tile(np.eye(3), (3, 1, 1)), np.tile([5.0, 1.0, -600.0], (3, 1)))
    local = tracker.vertices(identity, weights)
    shapes = NamedShapes(names, tracker.expressions_mm, weights)
    coarse = Animation(
        np.arange(3), 25.0, local + head.translation_mm[:, None],
        Polygons.of_triangles(tracker.triangles), tracker.neutral_of(identity), head, shapes, 1.0,
    )  # fmt: skip
    full = FullFace.of(studio, tracker, coarse.neutral_mm, identity, shapes)
    return studio, tracker, identity, coarse, full


def test_shapes_of_the_track_give_the_full_models_shapes(scene):
    studio, tracker, identity, coarse, full = scene
    by_name = np.zeros((3, studio.n_expressions))
    for k, name in enumerate(tracker.expression_names):
        by_name[:, studio.expression_names.index(name)] = coarse.shapes.weights[:, k]
    expected = studio.vertices(identity, by_name) + coarse.head.translation_mm[:, None]
    for row in range(3):
        off = np.linalg.norm(full.vertices_mm(coarse, row) - expected[row], axis=1)
        # The studio's own head is a little asymmetric, which the tracker's is not.
        assert np.median(off) < 0.2
        # Elsewhere it keeps to the tracker's surface, which is coarser.
        assert np.percentile(off, 99) < 1.5


def test_a_point_of_the_full_model_moves_as_the_trackers_vertex_that_it_is_bound_to(scene):
    studio, tracker, identity, _, _ = scene
    bound = bind_models(studio, tracker)
    moved = []
    for model in (studio, tracker):
        weights = np.zeros(model.n_expressions)
        weights[model.expression_names.index("jawOpen")] = 0.6
        moved.append(model.vertices(identity, weights) - model.neutral_of(identity))
    off = np.linalg.norm(bound.sample(moved[0], studio.triangles) - moved[1], axis=1)
    lips = tracker.regions["vermilion_upper"] | tracker.regions["vermilion_lower"]
    # The lower lip drops by over 10 mm: none of its vertices is bound to the upper one.
    assert np.linalg.norm(moved[1][lips], axis=1).max() > 10.0
    assert off[lips].max() < 2.0 and np.median(off[lips]) < 0.2


def test_a_correction_of_the_lips_moves_the_full_models_lips_as_much(scene):
    studio, tracker, _, coarse, full = scene
    lips = tracker.regions["vermilion_lower"]
    moved = np.array(coarse.vertices_mm)
    moved[0, lips, 1] -= 2.0
    before = full.vertices_mm(coarse, 0)
    after = full.vertices_mm(replace(coarse, vertices_mm=moved), 0)
    change = (after - before)[:, 1]
    assert np.median(change[studio.regions["vermilion_lower"]]) == pytest.approx(-2.0, abs=0.1)
    corners = studio.neutral_mm[studio.inner_contour][:, 0]
    middle = np.abs(studio.neutral_mm[:, 0]) < 0.6 * corners.max()
    assert np.abs(change[studio.regions["vermilion_upper"] & middle]).max() < 0.05
    assert np.abs(change[studio.regions["teeth"] | studio.regions["eyes"]]).max() == 0.0


def test_blend_shapes_of_the_full_face_give_back_its_sequence(scene):
    _, _, _, coarse, full = scene
    rng = np.random.default_rng(0)
    shaken = replace(coarse, vertices_mm=coarse.vertices_mm + rng.normal(0, 0.3, (3, 1, 3)))
    basis = full.basis(shape_basis(shaken, 0.01))
    for row in range(3):
        back = shaken.head.to_world(row, basis.vertices_mm(row))
        assert np.linalg.norm(back - full.vertices_mm(shaken, row), axis=1).max() < 0.05


def test_the_full_surface_lies_on_the_trackers(scene):
    """The coarse mesh is on the full one, and it stays there when the person is not the model's."""
    studio, tracker, identity, coarse, _ = scene
    other = tracker.neutral_of(identity) + np.array([0.0, 0.0, 4.0])
    full = FullFace.of(studio, tracker, other, identity, coarse.shapes)
    off = Surface(full.neutral_mm, studio.triangles).closest(other).distance_mm
    assert np.percentile(off, 95) < 0.5
