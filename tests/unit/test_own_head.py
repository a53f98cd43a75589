"""A corrected sequence on the user's own head: what must be the same, and what follows what."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.heads import small_studio, small_tracker
from vermilion.config.apply import ApplyConfig
from vermilion.config.own_head import head_checks, missing_heads
from vermilion.config.root import Configuration
from vermilion.config.takes import Take
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.head_binding import bind_head
from vermilion.export.head_file import HeadFile, read_head
from vermilion.export.head_overlay import head_overlay
from vermilion.export.head_transfer import HeadTransfer
from vermilion.export.objs import write_obj
from vermilion.geometry.polygons import Polygons
from vermilion.scan.landmarks import ScanLandmarks
from vermilion.storage.errors import InputError

#: Of the file: a unit of 10 mm, turned and moved.
TURN = Rotation.from_euler("xyz", [20, -40, 10], degrees=True).as_matrix()
PERSON = np.array([0.8, -0.5, 0.3, 0.1])
POSES = ({}, {"jawOpen": 0.6}, {"mouthSmile_L": 0.8}, {"mouthStretch_R": 0.6, "jawOpen": 0.2})


def in_file(vertices_mm):
    return 0.1 * vertices_mm @ TURN.T + [3.0, 50.0, -7.0]


def weights_of(model):
    weights = np.zeros((len(POSES), model.n_expressions))
    for row, pose in enumerate(POSES):
        for name, weight in pose.items():
            weights[row, model.expression_names.index(name)] = weight
    return weights


@cache
def take():
    """A turned head that speaks; lips with a correction that no shape has."""
    tracker = small_tracker()
    weights = weights_of(tracker)
    turn = Rotation.from_euler("y", 5.0 * np.arange(len(POSES))[:, None], degrees=True).as_matrix()
    head = HeadFrame(turn, np.tile([2.0, -3.0, 600.0], (len(POSES), 1)))
    local = tracker.vertices(PERSON, weights)
    world = np.stack([head.to_world(row, mesh) for row, mesh in enumerate(local)])
    shapes = NamedShapes(tracker.expression_names, tracker.expressions_mm, weights)
    return Animation(
        np.arange(len(POSES)), 25.0, world, Polygons.of_triangles(tracker.triangles),
        tracker.neutral_of(PERSON), head, shapes, 1.0, tracker.uv,
    )  # fmt: skip


def transferred(head, landmarks, shape="own"):
    tracker, coarse = small_tracker(), take()
    binding = bind_head(tracker, head, landmarks)
    return binding, HeadTransfer(head, binding, tracker, coarse.neutral_mm, coarse.shapes, shape)


@cache
def studio_head(shape="own", person=True):
    """The studio's head of the same person (or another), another topology with eyes and teeth."""
    studio = small_studio()
    vertices = in_file(studio.neutral_of(PERSON if person else -1.5 * PERSON))
    head = HeadFile(vertices, Polygons.with_quads(studio.triangles), studio.uv)
    landmarks = ScanLandmarks(vertices[studio.landmarks], np.zeros(66))
    return transferred(head, landmarks, shape)


@pytest.mark.parametrize("shape", ["own", "person"])
def test_a_head_of_our_own_topology_and_shape_is_the_sequence_itself(shape):
    tracker, coarse = small_tracker(), take()
    head = HeadFile(in_file(coarse.neutral_mm), Polygons.of_triangles(tracker.triangles))
    _, found = transferred(head, ScanLandmarks(np.zeros((66, 3)), np.zeros(66)), shape)
    assert found.unit_mm == pytest.approx(10.0, abs=1e-6)
    for row in range(len(POSES)):
        off = np.linalg.norm(found.vertices_mm(coarse, row) - coarse.vertices_mm[row], axis=1)
        assert off[found.lips].max() < 1e-3
        assert off.max() < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["own", "person"])
def test_another_topology_moves_as_the_same_face_does(shape):
    """Scaled, turned, finer, with quads; the studio's own motion is the truth."""
    studio, coarse = small_studio(), take()
    binding, found = studio_head(shape)
    figures = binding.figures(small_tracker().triangles)
    assert figures["residual_mean_mm"] < 0.4  # chords of our coarse mesh, whose edges are 6 mm
    assert found.unit_mm == pytest.approx(10.0, rel=0.01)
    weights = np.zeros((len(POSES), studio.n_expressions))
    for row, pose in enumerate(POSES):
        for name, weight in pose.items():
            weights[row, studio.expression_names.index(name)] = weight
    truth = studio.vertices(PERSON, weights)
    poses = np.stack(
        [coarse.head.to_head(r, found.vertices_mm(coarse, r)) for r in range(len(POSES))]
    )
    off = np.linalg.norm((poses - poses[0]) - (truth - truth[0]), axis=2)
    assert np.linalg.norm(truth[1] - truth[0], axis=1)[found.lips].mean() > 5.0
    assert off[:, found.lips].mean(axis=1).max() < 0.25
    assert off[:, found.region("face")].mean(axis=1).max() < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("person", [True, False])
def test_lips_open_and_meet_as_those_of_the_sequence(person):
    coarse = take()
    _, found = studio_head("own", person)
    for row in range(len(POSES)):
        wanted, gaps = found.gaps_mm(coarse, row)
        assert np.abs(gaps - wanted).mean() < 0.03
        assert np.abs(gaps - wanted).max() < 0.2  # our contour has 30 edges
    assert np.abs(found.gaps_mm(coarse, 1)[1]).mean() > 5.0


@pytest.mark.slow
def test_the_rest_of_the_head_is_rigid_and_lower_teeth_follow_the_jaw():
    studio, coarse = small_studio(), take()
    _, found = studio_head()
    opened = coarse.head.to_head(1, found.vertices_mm(coarse, 1))
    moved = np.linalg.norm(opened - found.rest_mm, axis=1)
    back = studio.neutral_mm[:, 2] < -20.0
    assert back.sum() > 100 and moved[back].max() < 0.2
    assert moved[studio.regions["eyes"]].max() < 1e-9
    teeth = studio.regions["teeth"]
    middle = studio.neutral_mm[studio.inner_contour, 1].mean()
    upper = teeth & (studio.neutral_mm[:, 1] > middle + 1.0)
    lower = teeth & (studio.neutral_mm[:, 1] < middle - 8.0)
    assert moved[upper].max() < 1e-9
    assert moved[lower].min() > 2.0
    lengths = np.linalg.norm(np.diff(opened[lower], axis=0), axis=1)
    assert np.allclose(lengths, np.linalg.norm(np.diff(found.rest_mm[lower], axis=0), axis=1))


@pytest.mark.slow
def test_another_persons_head_keeps_its_shape_or_takes_the_persons():
    studio, coarse = small_studio(), take()
    truth = studio.neutral_of(PERSON)
    face = studio.regions["face"]
    away = {}
    for shape in ("own", "person"):
        _, found = studio_head(shape, person=False)
        pose = coarse.head.to_head(0, found.vertices_mm(coarse, 0))
        away[shape] = np.linalg.norm(pose - truth, axis=1)[face].mean()
        if shape == "own":
            assert np.linalg.norm(pose - found.rest_mm, axis=1)[face].mean() < 0.3
    assert away["own"] > 1.5
    assert away["person"] < 0.5 * away["own"]


@pytest.mark.slow
def test_the_overlay_shows_head_distances_and_expressions():
    studio = small_studio()
    vertices = in_file(studio.neutral_of(PERSON))
    head = HeadFile(vertices, Polygons.with_quads(studio.triangles), studio.uv)
    image = head_overlay(small_tracker(), head, studio_head()[0])
    assert image.shape[2] == 3 and image.std() > 20


@pytest.mark.slow
def test_a_ball_is_no_head():
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4, radius=100.0)
    head = HeadFile(np.asarray(ball.vertices), Polygons.of_triangles(np.asarray(ball.faces)))
    places = small_tracker().neutral_mm[small_tracker().landmarks]
    landmarks = ScanLandmarks(
        100.0 * places / np.linalg.norm(places, axis=1)[:, None], np.zeros(66)
    )
    with pytest.raises(
        InputError, match=r"subject anna, file ball\.obj: found .*give them by hand"
    ):
        bind_head(small_tracker(), head, landmarks, subject="anna", path="ball.obj")


def test_only_borders_are_welded():
    tracker = small_tracker()
    whole = Polygons.of_triangles(tracker.triangles)
    assert np.array_equal(HeadFile(tracker.neutral_mm, whole).place, np.arange(tracker.n_vertices))
    # Cut along x = 0, as a texture seam does; an inner vertex lies where another does.
    right = tracker.neutral_mm[tracker.triangles].mean(axis=1)[:, 0] > 0
    apart = tracker.triangles.copy()
    apart[right] += tracker.n_vertices
    vertices = np.concatenate([tracker.neutral_mm, tracker.neutral_mm])
    closed = vertices.copy()
    inner = tracker.landmarks[[59, 65]]
    closed[inner] = closed[inner].mean(axis=0)
    for given in (vertices, closed):
        head = HeadFile(given, Polygons.of_triangles(apart))
        assert len(head.welded.vertices_mm) == tracker.n_vertices
        assert len(head.welded.triangles) == len(tracker.triangles)
        assert (head.place >= 0).sum() > tracker.n_vertices


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent.obj", None, "found no such file; expected a head"),
        ("head.fbx", "x", "found the suffix '.fbx'; expected one of .obj, .ply"),
        ("small.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "found 1 triangles with an area"),
        (
            "uv.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/7\n",
            "texture coordinate beyond",
        ),
    ],
)
def test_what_is_no_head_is_one_sentence(tmp_path, name, text, message):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=r"subject anna, file.*correct apply\.export") as error:
        read_head(path, "anna")
    assert message in str(error.value)


def test_polygons_and_texture_seams_of_an_obj_come_back(tmp_path):
    tracker = small_tracker()
    polygons = Polygons.with_quads(tracker.triangles)
    left = tracker.neutral_mm[polygons.corners, 0] < 0
    uv = np.concatenate([tracker.uv, tracker.uv * 0.5])
    corners = polygons.corners + np.where(left, tracker.n_vertices, 0)
    write_obj(tmp_path / "head.obj", tracker.neutral_mm, polygons, uv, corners)
    head = read_head(tmp_path / "head.obj")
    assert np.array_equal(head.polygons.corners, polygons.corners)
    assert np.array_equal(head.uv_corners, corners)
    assert np.abs(head.uv - uv).max() < 1e-6
    # Cut at the seams, each corner has the texture coordinate of its own.
    cut = replace(
        take(), polygons=head.polygons, uv=head.uv, uv_corners=head.uv_corners
    ).cut_at_seams()
    assert np.array_equal(cut.source[cut.polygons.corners], polygons.corners)
    assert np.allclose(cut.uv[cut.polygons.corners], uv[corners], atol=1e-6)
    assert np.array_equal(cut.source[: tracker.n_vertices], np.arange(tracker.n_vertices))


def test_a_head_that_is_not_there_is_named_for_each_subject(tmp_path):
    (tmp_path / "anna.obj").write_text("v 0 0 0\n")
    head = {"topology": f"{tmp_path}/{{subject}}.obj"}
    configuration = Configuration(apply={"export": head, "takes": ["anna/shot", "ben/shot"]})
    takes = [
        Take(name, "shot", "video", "x.mov", 0, 9, 25.0, "none") for name in ("anna", "ben", "cid")
    ]
    (sentence,) = missing_heads(configuration, takes)
    assert f"apply.export.topology: found no '{tmp_path}/ben.obj'" in sentence
    assert "for subject ben" in sentence


def test_a_head_is_named_by_its_file_and_needs_landmarks():
    apply = ApplyConfig(export={"topology": "heads/{subject}.obj"})
    assert apply.head_of("anna") == "heads/anna.obj"
    assert ApplyConfig(export={"topology": "full"}).head_of("anna") is None
    configuration = Configuration(
        apply=apply,
        landmarks={"detector": "files", "files": {"path": "l.csv"}},
        guided={"takes": {"anna/a": "H"}},
    )
    sentences = list(head_checks(configuration))
    assert "nothing finds landmarks in images" in sentences[0]
    assert "corrects the sequence H of anna/a" in sentences[1]
    with pytest.raises(ValueError, match="topology"):
        ApplyConfig(export={"topology": "head.fbx"})
