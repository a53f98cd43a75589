"""Our labels on another topology, and its space of shapes."""

from functools import cache

import numpy as np
import pymeshlab
import pytest

from benchmarks.foreign_tracker import ForeignTracker
from tests.heads import SLIGHTLY_OPEN, small_studio, small_tracker
from vermilion.external.shape_modes import (
    has_modes,
    mode_weights,
    with_blend_shapes,
    with_modes,
)
from vermilion.external.topology import label_topology
from vermilion.geometry.mesh import Mesh, submesh, unique_edges
from vermilion.scan.landmarks import ScanLandmarks
from vermilion.storage.errors import InputError

pytestmark = pytest.mark.slow

PERSON = np.array([0.5, -1.0, 0.8, 0.3])
#: The tracker's own frame: turned, and away from the origin.
TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
AWAY_MM = np.array([30.0, -20.0, 400.0])


@cache
def foreign(opening=SLIGHTLY_OPEN):
    """A simulated tracker, its labelled topology, and the neutral in our head frame."""
    studio = small_studio()
    tracker = ForeignTracker.of(studio, 7000)
    weights = np.zeros(studio.n_expressions)
    weights[studio.expression_names.index("jawOpen")] = opening
    face = studio.vertices(PERSON, weights)
    landmarks = ScanLandmarks(face[studio.landmarks] @ TURN.T + AWAY_MM, np.zeros(66))
    mesh = Mesh(tracker.sample(face) @ TURN.T + AWAY_MM, tracker.triangles)
    found = label_topology(small_tracker(), mesh, landmarks, least_opening=-SLIGHTLY_OPEN)
    return tracker, found.model, tracker.sample(face), face


def test_simulated_topology_does_not_depend_on_an_earlier_decimation():
    studio = small_studio()
    before = ForeignTracker.of(studio, 3000)
    other = pymeshlab.MeshSet(verbose=False)
    other.create_sphere(subdiv=3)
    # Its parameters become the defaults of the next call in this process.
    other.meshing_decimation_quadric_edge_collapse(
        targetfacenum=300, planarquadric=True, qualityweight=True, optimalplacement=False
    )
    after = ForeignTracker.of(studio, 3000)
    assert np.array_equal(before.triangles, after.triangles)


@pytest.mark.parametrize("opening", [0.0, SLIGHTLY_OPEN])
def test_labels_of_our_model_come_to_another_topology(opening):
    tracker, model, own_mm, face = foreign(opening)
    studio = small_studio()
    assert model.n_vertices == len(own_mm)
    assert np.array_equal(model.triangles, tracker.triangles)
    # Its neutral is the mesh itself, rigidly in our head frame.
    edges = unique_edges(model.triangles)
    for vertices in (own_mm,):
        lengths = np.linalg.norm(np.diff(vertices[edges], axis=1)[:, 0], axis=1)
        found = np.linalg.norm(np.diff(model.neutral_mm[edges], axis=1)[:, 0], axis=1)
        assert np.allclose(lengths, found, atol=1e-6)
    for name, least in {
        "face": 0.95, "vermilion_upper": 0.75, "vermilion_lower": 0.75, "mouth_inner": 0.9,
        "eyes": 0.99, "rigid": 0.6,
    }.items():  # fmt: skip
        ours = tracker.sample(studio.regions[name][:, None].astype(float))[:, 0] > 0.5
        theirs = model.regions[name]
        assert (ours & theirs).sum() / (ours | theirs).sum() > least, name
    away = np.linalg.norm(own_mm[model.landmarks] - face[studio.landmarks], axis=1)[17:]
    assert away.mean() < 1.5 and away.max() < 5.0  # mm; edges are 3 mm long


@pytest.mark.parametrize("opening", [0.0, SLIGHTLY_OPEN])
def test_contours_are_closed_loops_of_edges_and_lips_are_never_mixed(opening):
    tracker, model, own_mm, face = foreign(opening)
    studio = small_studio()
    edges = set(map(tuple, unique_edges(model.triangles).tolist()))
    upper = tracker.sample(studio.regions["vermilion_upper"][:, None].astype(float))[:, 0]
    lower = tracker.sample(studio.regions["vermilion_lower"][:, None].astype(float))[:, 0]
    for loop, ring in (
        (model.outer_contour, studio.outer_contour), (model.inner_contour, studio.inner_contour),
    ):  # fmt: skip
        assert len(set(loop.tolist())) == len(loop) > 20
        steps = np.sort(np.stack([loop, np.roll(loop, -1)], axis=1), axis=1)
        assert all(tuple(step) in edges for step in steps.tolist())
        line = np.concatenate([face[ring], 0.5 * (face[ring] + face[np.roll(ring, -1)])])
        away = np.linalg.norm(own_mm[loop][:, None] - line[None], axis=2).min(axis=1)
        assert away.mean() < 1.0 and away.max() < 3.0  # mm
    # A closed mouth has an upper and a lower part of the inner contour all the same.
    inner = model.inner_contour
    assert (upper[inner] > lower[inner]).sum() > 6 and (lower[inner] > upper[inner]).sum() > 6


def test_a_mask_whose_mouth_is_a_hole_is_labelled_as_well():
    _, model, own_mm, face = foreign()
    studio = small_studio()
    kept = ~(model.regions["mouth_inner"] | model.regions["eyes"] | model.regions["teeth"])
    ids, triangles = submesh(model.triangles, kept)
    landmarks = ScanLandmarks(face[studio.landmarks] @ TURN.T + AWAY_MM, np.zeros(66))
    mesh = Mesh(own_mm[ids] @ TURN.T + AWAY_MM, triangles)
    mask = label_topology(small_tracker(), mesh, landmarks, least_opening=-SLIGHTLY_OPEN).model
    for name in ("vermilion_upper", "vermilion_lower", "face"):
        ours, theirs = model.regions[name][ids], mask.regions[name]
        assert (ours & theirs).sum() / (ours | theirs).sum() > 0.9, name
    for name in ("mouth_inner", "teeth", "eyes"):
        assert not mask.regions[name].any(), name


def test_what_has_no_face_or_no_mouth_is_one_sentence():
    studio = small_studio()
    points = ScanLandmarks(studio.neutral_mm[studio.landmarks], np.zeros(66))
    mouth = studio.neutral_mm[studio.landmarks[48:]].mean(axis=0)
    without_mouth = np.linalg.norm(studio.neutral_mm - mouth, axis=1) > 45
    for kept, found in (
        (studio.neutral_mm[:, 1] > 20, "a scan that covers .* of the face"),
        (without_mouth, "a mesh (without edges round the lips|that lies)"),
    ):
        ids, triangles = submesh(studio.triangles, kept)
        words = f"take shot, frame 3: found {found}.*; expected the neutral face.*landmarks"
        with pytest.raises(InputError, match=words):
            label_topology(
                small_tracker(),
                Mesh(studio.neutral_mm[ids], triangles),
                points,
                take="shot",
                frame=3,
            )


def take_of_shapes(model, seed=0, count=40):
    """Displacements (F, V, 3) of three smooth shapes of our own, and their weights (F, 3)."""
    rng = np.random.default_rng(seed)
    x, y, _ = model.neutral_mm.T
    shapes = np.stack(
        [np.stack([np.sin(x / a), np.cos(y / a), 0 * x], axis=1) for a in (20.0, 31.0, 47.0)]
    )
    weights = rng.uniform(size=(count, 3))
    return np.tensordot(weights, shapes, axes=1), weights, shapes


def test_modes_hold_the_training_frames_and_their_weights_lie_in_0_1():
    _, model, _, _ = foreign()
    moved, _, _ = take_of_shapes(model)
    made = with_modes(model, moved, 0.9999, 40)
    assert has_modes(made) and made.n_expressions == 6
    weights = mode_weights(made, moved)
    assert weights.min() == 0.0 and weights.max() <= 1.0
    back = np.tensordot(weights, made.expressions_mm, axes=1)
    assert np.abs(back - moved).max() < 1e-3  # mm
    assert with_modes(model, moved, 0.9999, 2).n_expressions == 4


def test_the_trackers_own_shapes_follow_from_its_weights():
    _, model, _, _ = foreign()
    moved, weights, shapes = take_of_shapes(model)
    made = with_blend_shapes(model, moved, weights, ["a", "b", "c"])
    assert made.expression_names == ("a", "b", "c") and not has_modes(made)
    assert np.abs(made.expressions_mm - shapes).max() < 1e-2  # mm
