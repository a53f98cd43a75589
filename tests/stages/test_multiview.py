"""The multiview stage on a tiny capture of three cameras: its scripts from files to files."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests import lip_patch
from tests.stages.multiview_jobs import (
    CFG,
    LOST,
    PLACE,
    POSES,
    anchors,
    clip,
    join,
    make_capture,
    reconstruct,
    refine,
    surface_error_mm,
)
from tests.stages.run_script import run_script
from vermilion.geometry.camera import write_cameras
from vermilion.geometry.mesh_files import read_mesh
from vermilion.imaging.images import image_size
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """A reconstructed take of four frames."""
    root = tmp_path_factory.mktemp("multiview")
    make_capture(root, lip_patch.cameras(), LOST)
    reconstruct(root)
    return root


def test_the_neutral_lies_on_the_true_surface(take):
    vertices = np.load(take / "neutral.npz")["vertices_mm"]
    error = surface_error_mm(vertices, POSES[0])
    assert np.median(error) < 0.1
    assert np.percentile(error, 95) < 0.5
    assert (take / "cloud_neutral.ply").stat().st_size > 10_000
    surface = read_mesh(take / "surface_neutral.ply").vertices_mm
    assert np.abs(surface - vertices.mean(axis=0)).max() < 60
    assert image_size(take / "neutral.png")[0] > 240


def test_every_frame_lies_on_the_true_surface(take):
    meshes = read_sequence(take / "H/000000-000003.npy")
    assert meshes.dtype == np.float32
    for vertices, pose in zip(meshes, POSES, strict=True):
        error = surface_error_mm(vertices.astype(float), pose)
        assert np.median(error) < 0.15
        assert np.percentile(error, 95) < 0.8


def test_vertices_stay_on_their_material_points(take):
    meshes = read_sequence(take / "H/000000-000003.npy").astype(float)
    model = lip_patch.face_model()
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    rest = lip_patch.vertices_at(*POSES[0])
    _, near = cKDTree(rest).query(meshes[0])
    for vertices, pose in zip(meshes, POSES, strict=True):
        motion = (lip_patch.vertices_at(*pose) - rest)[near]
        drift = np.linalg.norm(vertices - meshes[0] - motion, axis=1)[lips]
        assert drift.mean() < 0.4


def test_clips_between_anchors_join_into_a_track_that_passes_through_them(take):
    found = anchors(take, [[2, 3]])
    frame = int(np.load(found[0])["frame"])
    assert frame == 2  # more like the neutral than frame 3
    join(take, [clip(take, index, found) for index in (0, 1)], found, "joined")
    joined, single = (np.load(take / f"{name}.npz") for name in ("joined", "track"))
    assert joined["frames"].tolist() == [0, 1, 2, 3]
    assert joined["anchors"].tolist() == [True, False, True, False]
    assert np.isfinite(joined["similarity"]).tolist() == [True, False, True, True]
    anchor = np.load(found[0])["vertices_mm"].astype(np.float32)
    assert np.array_equal(joined["coarse_mm"][2], anchor)
    off = np.linalg.norm(joined["coarse_mm"] - single["coarse_mm"], axis=2)
    assert np.median(off) < 0.2


def test_a_border_without_an_anchor_joins_its_clips(take):
    """Frames that cannot be read are no anchors."""
    (take / "dark").mkdir(exist_ok=True)
    for camera in lip_patch.cameras():
        folder = take / f"dark/frames/{camera}"
        folder.mkdir(parents=True)
        whole = take / f"rom/frames/{camera}/000000.png"
        (folder / "000000.png").write_bytes(whole.read_bytes())
    found = anchors(take, [[2, 3]], source="dark")
    assert int(np.load(found[0])["frame"]) == -1
    clips = [clip(take, index, found, source="dark") for index in (0, 1)]
    join(take, clips, found, "dark_track")
    track = np.load(take / "dark_track.npz")
    assert track["anchors"].tolist() == [True, False, False, False]
    assert track["reasons"][0] == "" and all("frame" in why for why in track["reasons"][1:])


def test_topology_and_visibility_lie_beside_the_meshes(take):
    topology = read_mesh(take / "topology.ply")
    assert np.array_equal(topology.triangles, lip_patch.face_model().triangles)
    seen = np.load(take / "visibility/000000-000003.npy")
    assert seen.shape == (4, len(topology.vertices_mm))
    lips = lip_patch.face_model().regions["vermilion_lower"]
    assert (seen[:, lips] > 0).mean() > 0.5
    assert seen.max() <= 3


def test_a_camera_that_misses_a_frame_is_named_and_the_frame_kept(take):
    table = read_table(take / "quality/000000-000003.tsv")
    assert table["valid"].tolist() == [1, 1, 1, 1]
    assert table["missing_cameras"].tolist() == [0, 0, 1, 0]
    assert "camera left" in table["reason"][2]
    assert (table["residual_px"] < 1).all()
    assert (table["cloud_distance_mm"] < 0.5).all()
    assert (table["contact_left_mm"] < 0.1).all()


def test_chunk_size_changes_nothing(take):
    whole = read_sequence(take / "H/000000-000003.npy")
    refine(take, [2, 3], "000002-000003")
    assert np.array_equal(read_sequence(take / "H/000002-000003.npy"), whole[2:])


def test_an_unreadable_frame_is_flagged_and_the_rest_go_on(take):
    (take / "torn/frames").mkdir(parents=True)
    for camera in lip_patch.cameras():
        folder = take / f"torn/frames/{camera}"
        folder.mkdir()
        for path in (take / f"rom/frames/{camera}").iterdir():
            whole = path.read_bytes()
            torn = path.stem == "000001"
            (folder / path.name).write_bytes(whole[: len(whole) // 3] if torn else whole)
    refine(take, [1, 2], "000001-000002", source="torn")
    table = read_table(take / "quality/000001-000002.tsv")
    assert table["valid"].tolist() == [0, 1]
    assert "0 readable images" in table["reason"][0]
    assert np.isfinite(read_sequence(take / "H/000001-000002.npy")).all()


def test_a_chunk_without_a_readable_frame_still_ends(take):
    (take / "empty").mkdir()
    for camera in lip_patch.cameras():
        (take / f"empty/frames/{camera}").mkdir(parents=True)
        whole = take / f"rom/frames/{camera}/000000.png"
        (take / f"empty/frames/{camera}/000000.png").write_bytes(whole.read_bytes())
    refine(take, [3], "000003-000003", source="empty")
    table = read_table(take / "quality/000003-000003.tsv")
    assert table["valid"].tolist() == [0]
    assert (take / "overlay/000003-000003.png").is_file()


def test_the_neutral_frame_is_the_neutral(take):
    neutral = np.load(take / "neutral.npz")["vertices_mm"].astype(np.float32)
    assert np.array_equal(read_sequence(take / "H/000000-000003.npy")[0], neutral)


def later_neutral(take, root, rig, first):
    """The neutral of a later take in `root`; `first` as the rule's parameter says it."""
    run_script(
        "multiview/multiview_neutral",
        wildcards={**PLACE, "take": "rom2"},
        params={"cfg": CFG, "source": str(root / "rom"), "frame": 0, "first": first},
        input={
            "template": root / "template.npz",
            "cameras": root / "cameras",
            "landmarks": root / "views.npz",
            "first_neutral": take / "neutral.npz",
            "first_cameras": take / "cameras",
        },
        output={
            "neutral": root / "neutral.npz",
            "cloud": root / "cloud_neutral.ply",
            "surface": root / "surface_neutral.ply",
            "overlay": root / "neutral.png",
        },
    )
    return dict(np.load(root / "neutral.npz"))


@pytest.fixture(scope="module")
def later_take(take, tmp_path_factory):
    """Another take of the same person: the head is elsewhere, landmarks are marked otherwise."""
    root = tmp_path_factory.mktemp("later")
    turn = cv2.Rodrigues(np.radians([2.0, -4.0, 3.0]))[0]
    shift = np.array([1.5, -1.0, 2.0])
    along = np.array([1.5, 0.5, 0.0])
    make_capture(root, lip_patch.cameras(), placed=lambda v: v @ turn.T + shift, marks_mm=along)
    first = {"take": "rom", "frame": 0, "source": str(take / "rom"), "cfg": CFG}
    return root, first, turn, shift


def test_a_later_take_carries_the_points_of_the_first(take, later_take):
    root, first, turn, shift = later_take
    alone = later_neutral(take, root, lip_patch.cameras(), {})
    found = later_neutral(take, root, lip_patch.cameras(), first)
    goal = np.load(take / "neutral.npz")["vertices_mm"] @ turn.T + shift
    face = lip_patch.face_model().regions["face"]
    off, slid = (
        np.linalg.norm(neutral["vertices_mm"] - goal, axis=1)[face] for neutral in (found, alone)
    )
    assert np.median(off) < 0.1 and np.percentile(off, 95) < 0.4
    assert np.median(slid) > 3 * np.median(off)  # the template by itself marks other places
    assert found["first_take"] == "rom" and alone["first_take"] == ""
    assert np.allclose(
        found["moved_mm"], np.linalg.norm(found["vertices_mm"] - alone["vertices_mm"], axis=1)
    )


def test_a_rig_with_other_cameras_keeps_its_own_neutral_and_says_so(take, later_take, capsys):
    root, first, _, _ = later_take
    other = take / "other_cameras"
    write_cameras(
        other, {f"x{n}": replace(c, name=f"x{n}") for n, c in lip_patch.cameras().items()}
    )
    for name in lip_patch.cameras():
        (take / f"rom/frames/x{name}").symlink_to(take / f"rom/frames/{name}")
    alone = later_neutral(take, root, lip_patch.cameras(), {})
    (take / "cameras").rename(take / "kept_cameras")
    other.rename(take / "cameras")
    try:
        found = later_neutral(take, root, lip_patch.cameras(), first)
    finally:
        (take / "cameras").rename(other)
        (take / "kept_cameras").rename(take / "cameras")
    assert np.array_equal(found["vertices_mm"], alone["vertices_mm"])
    printed = capsys.readouterr().out
    assert "s1/rom2: found no camera in common" in printed and "overlays" in printed
