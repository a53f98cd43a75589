"""A personal face model from a scan: files, landmarks, registration and transfer of known shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tests.heads import small_tracker
from vermilion.faces.procedural import tracker_model
from vermilion.geometry.mesh import Mesh, unique_edges
from vermilion.landmarks.detector import Landmarks
from vermilion.scan.fit import standard_unit
from vermilion.scan.landmarks import (
    ScanLandmarks,
    find_landmarks,
    read_scan_landmarks,
    write_scan_landmarks,
)
from vermilion.scan.personal import personal_model, searching_vertices, transferred
from vermilion.scan.read import read_scan
from vermilion.scan.transfer import DeformationTransfer
from vermilion.storage.errors import InputError


@pytest.fixture(scope="module")
def generic():
    return small_tracker()


def person(generic):
    """Neutral (V, 3) of somebody outside the model's identities."""
    neutral = generic.neutral_of(np.array([0.8, -0.5, 0.6, 0.3]))
    x, y, _ = neutral.T
    wave = np.stack([np.sin(y / 35), np.cos(x / 40 + 1), np.sin((x + y) / 45)], axis=1)
    return neutral + 2.5 * wave


def as_scan(vertices, triangles):
    """The same surface in another topology: every triangle cut in four, vertices shuffled."""
    edges = unique_edges(triangles)
    number = {tuple(edge): len(vertices) + k for k, edge in enumerate(edges.tolist())}
    middle = np.array(
        [
            [number[tuple(sorted((t[i], t[(i + 1) % 3])))] for i in range(3)]
            for t in triangles.tolist()
        ]
    )
    a, b, c = triangles.T
    ab, bc, ca = middle.T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    finer = np.concatenate([np.stack(part, axis=1) for part in parts])
    points = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    order = np.random.default_rng(0).permutation(len(points))
    place = np.argsort(order)
    return Mesh(points[order], place[finer].astype(np.int32))


def moved(mesh, landmarks, scale=1.0, turn=(0, 0, 0), shift=(0, 0, 0)):
    rotation = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    place = [scale * points @ rotation.T + shift for points in (mesh.vertices_mm, landmarks)]
    return mesh.with_vertices(place[0]), ScanLandmarks(place[1], np.zeros(66))


def fitted(generic, **move):
    truth = person(generic)
    scan = as_scan(truth, generic.triangles)
    return truth, personal_model(generic, *moved(scan, truth[generic.landmarks], **move))


@pytest.fixture(scope="module")
def still(generic):
    return fitted(generic)


def test_transfer_onto_the_same_neutral_returns_the_same_expressions(generic):
    held = generic.regions["rigid"]
    transfer = DeformationTransfer(generic.neutral_mm, generic.neutral_mm, generic.triangles, held)
    poses = generic.vertices(None, np.eye(generic.n_expressions))
    np.testing.assert_allclose(transfer.transfer(poses), poses, atol=1e-6)


def test_transfer_onto_a_larger_head_enlarges_the_expressions(generic):
    scale = 1.2
    transfer = DeformationTransfer(
        generic.neutral_mm, scale * generic.neutral_mm, generic.triangles, generic.regions["rigid"]
    )
    opened = generic.vertices(None, np.eye(generic.n_expressions))[
        generic.expression_names.index("jawOpen")
    ]
    found = transfer.transfer(opened[None])[0] - scale * generic.neutral_mm
    wanted = scale * (opened - generic.neutral_mm)
    assert np.abs(wanted).max() > 10
    assert np.linalg.norm(found - wanted, axis=1).max() < 0.3


def test_a_known_head_is_recovered(generic, still):
    truth, made = still
    truth = made.fit.head_from_scan.apply(truth)
    skin = searching_vertices(generic)
    away = np.linalg.norm(made.registered.vertices_mm - truth, axis=1)[skin]
    assert np.linalg.norm(truth - generic.neutral_mm, axis=1)[skin].mean() > 2
    assert away.mean() < 0.6  # along the surface a smooth face says little of what is where
    assert made.figures()["distance_mean_mm"] < 0.2
    assert made.quality().valid
    assert made.fit.head_from_scan.scale == pytest.approx(1.0, abs=0.03)
    assert made.model.n_identities == 0
    neutral_away = np.linalg.norm(made.model.neutral_mm - truth, axis=1)[skin]
    assert neutral_away.mean() < 1.0


def test_expressions_of_the_person_are_those_of_the_model_but_for_the_shape(generic, still):
    _, made = still
    for name in ("jawOpen", "mouthSmile_L"):
        k = generic.expression_names.index(name)
        size = np.linalg.norm(generic.expressions_mm[k], axis=1)
        away = np.linalg.norm(made.model.expressions_mm[k] - generic.expressions_mm[k], axis=1)
        assert away.max() < 0.25 * size.max()
        assert away.mean() < 0.15 * size.max()


def test_a_moved_turned_and_scaled_scan_gives_the_same_model(generic):
    """In units that are none: that of a standard unit is kept."""
    _, still = fitted(generic, scale=0.37)
    _, away = fitted(generic, scale=0.013, turn=(70, -130, 20), shift=(3, 9, -20))
    share = away.fit.head_from_scan.scale / still.fit.head_from_scan.scale
    assert share == pytest.approx(0.37 / 0.013, rel=1e-6)
    np.testing.assert_allclose(away.model.neutral_mm, still.model.neutral_mm, atol=1e-3)
    np.testing.assert_allclose(away.model.expressions_mm, still.model.expressions_mm, atol=1e-3)


def test_closed_eyes_open_in_the_neutral(generic):
    names = [n for n in generic.expression_names if "eyeBlink" in n]
    shut = np.isin(generic.expression_names, names).astype(float)
    posed = generic.vertices(None, shut)
    scan, landmarks = as_scan(posed, generic.triangles), posed[generic.landmarks]
    landmarks = ScanLandmarks(landmarks, np.zeros(66))
    made = personal_model(generic, scan, landmarks, closed_eyes=True)
    away = np.linalg.norm(made.model.neutral_mm - generic.neutral_mm, axis=1)
    moving = np.linalg.norm(posed - generic.neutral_mm, axis=1)
    assert moving.max() > 4
    assert away[moving > 2].mean() < 0.2 * moving[moving > 2].mean()


def test_a_registered_pose_of_the_model_itself_transfers_to_itself(generic, still):
    fit = still[1].fit
    again = transferred(generic, fit, generic.vertices(fit.identity, fit.weights))
    np.testing.assert_allclose(again.neutral_mm, generic.neutral_of(fit.identity), atol=1e-6)
    np.testing.assert_allclose(again.expressions_mm, generic.expressions_mm, atol=1e-5)


def test_the_tracker_takes_a_model_without_identities():
    from tests.unit.test_tracking_identity import MODEL, PERSON, sample
    from vermilion.tracking.identity.landmark_identity import fit_identity

    personal = replace(
        MODEL, neutral_mm=MODEL.neutral_of(PERSON), identities_mm=np.zeros((0, 66, 3))
    )
    found = fit_identity(personal, [sample()])
    assert found.identity.shape == (0,)
    assert found.reprojection_px < 1.0


def test_seams_are_welded_and_useless_triangles_left_out(tmp_path, generic):
    doubled = np.concatenate([generic.neutral_mm, generic.neutral_mm])
    seam = generic.triangles.copy()
    seam[::2] += generic.n_vertices
    flat = np.stack([seam[:50, 0], seam[:50, 1], seam[:50, 1]], axis=1)
    path = tmp_path / "head.ply"
    trimesh.Trimesh(doubled, np.concatenate([seam, flat]), process=False).export(path)
    scan = read_scan(path)
    assert len(scan.vertices_mm) == len(np.unique(generic.neutral_mm.astype(np.float32), axis=0))
    assert len(scan.triangles) == len(generic.triangles)


def test_polygons_of_an_obj_are_cut(tmp_path):
    grid = np.arange(20)
    x, y = np.meshgrid(grid, grid)
    lines = [f"v {a} {b} 0" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    for row in range(19):
        for column in range(19):
            k = row * 20 + column + 1
            lines.append(f"f {k} {k + 1} {k + 21} {k + 20}")
    path = tmp_path / "quads.obj"
    path.write_text("\n".join(lines) + "\n")
    assert len(read_scan(path).triangles) == 2 * 19 * 19


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("absent.obj", None, "found no such file"),
        ("head.fbx", "x", "found the suffix '.fbx'; expected one of .obj, .ply, .stl"),
        ("noise.ply", "this is no mesh", "found no mesh that can be read"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "0 triangles"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "0 triangles with an area"),
        ("broken.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "coordinates that are no numbers"),
    ],
)
def test_what_is_no_scan_is_said_so(tmp_path, name, text, message):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=r"subject anna.*file") as error:
        read_scan(path, "anna")
    assert message in str(error.value)


class Blind:
    """A detector that finds nothing."""

    def detect(self, image):
        return Landmarks.none()


def test_a_scan_without_a_face_is_said_so(generic, monkeypatch):
    monkeypatch.setattr("vermilion.scan.landmarks._SIZE_PX", 16)  # whoever is blind needs no more
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = Mesh(np.asarray(ball.vertices), np.asarray(ball.faces))
    with pytest.raises(InputError, match="subject anna: found no face in 168 views"):
        find_landmarks(mesh, Blind(), generic.neutral_mm[generic.landmarks], "anna")


def test_a_surer_face_of_another_shape_is_no_face(generic, monkeypatch):
    """A small detector may be surer of a head on its side, and nothing of it is found from closer."""
    truth, rng = generic.neutral_mm[generic.landmarks], np.random.default_rng(0)
    elsewhere = rng.normal(0.0, 60.0, (66, 3))
    scan = Mesh(generic.neutral_mm, generic.triangles)

    def landmarks(views, camera, detector):
        front, up = -camera.rotation[2], -camera.rotation[1]
        if front[2] > 0.9 and up[1] > 0.5:
            points, confidence = truth, 0.5
        elif front[1] > 0.9 and up[0] < -0.9:
            points, confidence = elsewhere, 0.7
        else:
            return Landmarks.none(), np.full((66, 3), np.nan)
        return Landmarks(camera.project(points), np.full(66, confidence), True), points

    monkeypatch.setattr("vermilion.scan.views.ScanViews.landmarks", landmarks)
    found = find_landmarks(scan, None, truth)
    np.testing.assert_allclose(found.points[17:], truth[17:], atol=1e-9)


def test_a_face_that_is_seen_only_from_the_side_is_found(generic, monkeypatch):
    truth = generic.neutral_mm[generic.landmarks]
    scan = Mesh(generic.neutral_mm, generic.triangles)

    def landmarks(views, camera, detector):
        front, up = -camera.rotation[2], -camera.rotation[1]
        if front[2] < 0.9 or up[1] < 0.5 or abs(front[0]) < 0.1:
            return Landmarks.none(), np.full((66, 3), np.nan)
        return Landmarks(camera.project(truth), np.full(66, 0.5), True), truth

    monkeypatch.setattr("vermilion.scan.views.ScanViews.landmarks", landmarks)
    found = find_landmarks(scan, None, truth)
    np.testing.assert_allclose(found.points[17:], truth[17:], atol=1e-9)


def test_a_scan_of_a_forehead_is_refused(generic):
    truth = generic.neutral_mm
    upper = truth[:, 1] > np.quantile(truth[:, 1], 0.85)
    keep = upper[generic.triangles].all(axis=1)
    points = ScanLandmarks(truth[generic.landmarks], np.zeros(66))
    with pytest.raises(InputError, match="of the face; expected at least half"):
        personal_model(generic, Mesh(truth, generic.triangles[keep]), points)


def test_landmarks_by_hand_come_back_and_are_checked(tmp_path, generic):
    points = generic.neutral_mm[generic.landmarks].copy()
    points[3] = np.nan
    write_scan_landmarks(tmp_path / "l.tsv", ScanLandmarks(points, np.zeros(66)))
    np.testing.assert_allclose(read_scan_landmarks(tmp_path / "l.tsv").points, points, rtol=1e-8)
    (tmp_path / "few.tsv").write_text("landmark\tx\ty\tz\n1\t0\t0\t0\n2\t0\t0\t0\n")
    with pytest.raises(InputError, match="found 2 landmarks; expected at least 6"):
        read_scan_landmarks(tmp_path / "few.tsv", "anna")
    (tmp_path / "wrong.tsv").write_text("landmark\tx\ty\tz\n70\t0\t0\t0\n")
    with pytest.raises(InputError, match=r"found landmarks \[70\]"):
        read_scan_landmarks(tmp_path / "wrong.tsv", "anna")


@pytest.mark.slow
@pytest.mark.data
def test_a_real_head_lying_on_its_back_is_met_within_half_a_millimetre(data_root):
    from vermilion.landmarks.networks import NetworkDetector

    scan = read_scan(data_root / "scan" / "head.obj")
    turn = Rotation.from_euler("xz", [-90, 15], degrees=True).as_matrix()
    scan = scan.with_vertices(7.0 * scan.vertices_mm @ turn.T + [100, 0, 50])
    generic = tracker_model(6000, 10)
    detector = NetworkDetector(data_root / "landmarks66")
    landmarks = find_landmarks(scan, detector, generic.neutral_mm[generic.landmarks])
    made = personal_model(generic, scan, landmarks, closed_eyes=True)
    figures = made.figures()
    assert figures["distance_mean_mm"] < 0.5
    assert figures["met_share"] > 0.95
    assert figures["unit_mm"] == pytest.approx(55.6 / 7.0, rel=0.08)


@pytest.mark.parametrize(
    ("estimated_mm", "unit_mm"),
    [
        (1.07, 1.0),
        (0.93, 1.0),
        (9.4, 10.0),
        (25.0, 25.4),
        (1080.0, 1000.0),
        (2.7, None),
        (55.6, None),
    ],
)
def test_a_unit_near_a_standard_one_is_that_one(estimated_mm, unit_mm):
    assert standard_unit(estimated_mm) == unit_mm


@pytest.mark.slow
def test_a_large_head_in_millimetres_stays_large(generic):
    large = 1.06 * person(generic)
    scan = as_scan(large, generic.triangles)
    made = personal_model(generic, scan, ScanLandmarks(large[generic.landmarks], np.zeros(66)))
    assert made.figures()["unit_mm"] == 1.0


def test_a_ray_through_an_open_eye_hardly_moves_the_registration(generic, still):
    truth, met = still
    found = truth[generic.landmarks].copy()
    found[[37, 38, 40, 41, 43, 44, 46, 47], 2] -= 20.0
    scan = as_scan(truth, generic.triangles)
    missed = personal_model(generic, scan, ScanLandmarks(found, np.full(66, 0.1)), unit_mm=1.0)
    skin = searching_vertices(generic)

    def away_mm(made):
        wanted = made.fit.head_from_scan.apply(truth)
        return np.linalg.norm(made.registered.vertices_mm - wanted, axis=1)[skin].mean()

    assert away_mm(missed) < away_mm(met) + 0.7, (away_mm(met), away_mm(missed))
