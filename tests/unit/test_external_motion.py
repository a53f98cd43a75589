"""A foreign sequence in the world of the capture: its place, poses, lost frames, and the way back."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.unit.synthetic_face import synthetic_model
from tests.unit.test_tracking_motion import true_motion
from vermilion.external.motion import external_take, placed_meshes
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement, place_world
from vermilion.external.read import read_tracked
from vermilion.external.weights_file import read_weights
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.polygons import Polygons
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.errors import InputError
from vermilion.tracking.landmark_fit.observation import focal_px, with_focal

MODEL = synthetic_model()
PERSON = np.array([0.8, -0.5, 0.4, 0.6])
NEUTRAL_MM = MODEL.neutral_of(PERSON)
CAMERA = pinhole(
    "cam", 1400.0, 640, 480,
    look_at(np.array([60.0, 30, 650]), np.array([0.0, 10, 60]), np.array([0.0, 1, 0])),
)  # fmt: skip
#: The tracker's world in the capture's.
TURN, MOVE_MM = Rotation.from_euler("xyz", [0.4, -2.0, 1.0]).as_matrix(), np.array([9.0, 80, -300])


def performance(n_frames=40):
    """C (F, V, 3) in the world of the capture, poses and weights."""
    rotation, translation, weights = (part[:n_frames].copy() for part in true_motion(n_frames))
    rotation = CAMERA.rotation.T @ rotation
    translation = (translation - CAMERA.translation) @ CAMERA.rotation
    local = MODEL.vertices(PERSON, weights)
    return (
        local @ np.swapaxes(rotation, 1, 2) + translation[:, None],
        rotation,
        translation,
        weights,
    )


WORLD_MM, ROTATION, TRANSLATION_MM, WEIGHTS = performance()
OWN_MM = (WORLD_MM - MOVE_MM) @ TURN
POINTS_PX = CAMERA.project(WORLD_MM[:, MODEL.landmarks])


def landmarks(own_mm):
    return own_mm[:, MODEL.landmarks]


def test_the_world_of_a_tracker_is_found_by_landmarks_of_all_frames():
    noisy = POINTS_PX + np.random.default_rng(0).normal(scale=0.5, size=POINTS_PX.shape)
    noisy[4], own = np.nan, landmarks(OWN_MM).copy()
    own[7] = np.nan
    found, camera = place_world(own, noisy, CAMERA)
    assert not found.as_given and camera is CAMERA and found.off < 0.01
    assert np.abs(found.apply(OWN_MM) - WORLD_MM).max() < 3.0  # mm, along the view above all
    assert np.allclose(found.undo(found.apply(OWN_MM)), OWN_MM)


def test_a_world_that_is_the_captures_is_left_alone():
    noisy = POINTS_PX + np.random.default_rng(0).normal(scale=1.0, size=POINTS_PX.shape)
    found, _ = place_world(landmarks(WORLD_MM), noisy, CAMERA)
    assert found.as_given and np.array_equal(found.rotation, np.eye(3))
    forced, _ = place_world(landmarks(OWN_MM), noisy, CAMERA, world="capture")
    assert forced.as_given and forced.off > 0.1
    forced, _ = place_world(landmarks(WORLD_MM), noisy, CAMERA, world="landmarks")
    assert not forced.as_given
    none, _ = place_world(landmarks(WORLD_MM), np.full_like(noisy, np.nan), CAMERA)
    assert none.as_given and np.isnan(none.off)


def test_an_unknown_focal_length_is_found_with_the_world():
    guess = with_focal(CAMERA, 1100.0)
    _, camera = place_world(landmarks(OWN_MM), POINTS_PX, guess, calibrated=False)
    assert abs(focal_px(camera) / 1400.0 - 1) < 0.03


def fitted(lost=(), shifted=()):
    own, points = OWN_MM.copy(), POINTS_PX.copy()
    own[list(lost)] = np.nan
    points[list(shifted)] += 60.0
    frames = np.arange(100, 100 + len(own))
    track = LandmarkTrack(frames, points, np.ones(points.shape[:2]), np.ones(len(own), bool))
    placement = Placement(TURN, MOVE_MM, 0.0, False)
    fit = external_take(MODEL, own, NEUTRAL_MM, WEIGHTS, placement, CAMERA, track, 0.12)
    rows = np.arange(len(own))
    return fit, placed_meshes(MODEL, fit, rows, own, NEUTRAL_MM, placement)


def test_poses_are_those_of_the_head_and_meshes_lie_in_the_captures_world():
    fit, meshes = fitted()
    assert fit.valid.all() and np.nanmax(fit.reprojection_px) < 0.01
    assert np.abs(meshes - WORLD_MM).max() < 1e-6  # mm
    turn = Rotation.from_matrix(fit.world_from_head_rotation @ np.swapaxes(ROTATION, 1, 2))
    # The rigid region of this face moves a little with its expressions.
    assert np.degrees(turn.magnitude()).max() < 2.5
    assert np.abs(fit.world_from_head_translation_mm - TRANSLATION_MM).max() < 4.0  # mm


def test_a_frame_without_a_mesh_is_lost_alone():
    fit, meshes = fitted(lost=(5, 6), shifted=(20,))
    assert np.flatnonzero(~fit.valid).tolist() == [5, 6, 20]
    assert np.isfinite(meshes).all()
    kept = np.setdiff1d(np.arange(len(meshes)), [5, 6])
    assert np.abs(meshes[kept] - WORLD_MM[kept]).max() < 1e-6
    assert np.linalg.norm(meshes[5] - WORLD_MM[5], axis=1).mean() < 6.0  # mm, of a quick motion


@pytest.mark.parametrize(("turned", "unit_mm"), [(False, 1000.0), (True, 10.0)])
def test_meshes_go_back_to_the_files_frame_and_unit(tmp_path, turned, unit_mm):
    rng = np.random.default_rng(1)
    in_file = rng.normal(size=(5, 3))
    read = in_file * unit_mm
    if turned:  # as `read_tracked` turns z up to y up
        read = read[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    polygons = Polygons(np.array([4], np.int32), np.arange(4, dtype=np.int32))
    Origin(unit_mm, "z" if turned else "y", turned, polygons, 3).save(tmp_path / "o.npz")
    origin = Origin.load(tmp_path / "o.npz")
    assert np.allclose(origin.in_file(read), in_file, atol=1e-12)
    assert origin.polygons.counts.tolist() == [4] and origin.first == 3


@pytest.mark.parametrize("up", [None, "y", "z"])
def test_what_is_read_goes_back_as_it_was(tmp_path, up):
    vertices = 0.1 * np.random.default_rng(2).normal(size=(2, 9, 3))
    np.savez(tmp_path / "s.npz", vertices=vertices, triangles=np.array([[0, 1, 2]]))
    found = read_tracked(tmp_path / "s.npz", [0, 1], 1000.0, up=up)
    origin = Origin(found.unit_mm, found.up, found.turned, found.polygons, 0)
    assert found.turned == (up == "z") and found.up == (up or "y")
    assert np.abs(origin.in_file(found.vertices_mm) - vertices).max() < 1e-7
    # A sculpt in the file's axes, mm, comes to where the sequence is.
    assert np.allclose(origin.upright(1000.0 * vertices), found.vertices_mm, atol=1e-3)


LIVE_LINK = "Timecode,BlendshapeCount,JawOpen,HeadYaw\n"


@pytest.mark.parametrize(
    ("codes", "fps", "expected"),
    [
        # Frame numbers, as our own table has them.
        (["00:00:00:04.000", "00:00:00:05.000", "00:00:00:06.000"], 25.0, [0.0, 0.1, 0.2]),
        # Time of day: the first row is the take's first frame.
        (["15:59:59:24.500", "16:00:00:00.500", "16:00:00:02.500"], 25.0, [0.0, 0.1, np.nan]),
        # Twice as many rows as frames.
        (["10:00:00:57.0", "10:00:00:58.0", "10:00:00:59.0"], 30.0, [0.0, 0.1, np.nan]),
    ],
)
def test_live_link_rows_are_found_by_their_timecode(tmp_path, codes, fps, expected):
    path = tmp_path / "l.csv"
    rows = [f"{code},61,{0.1 * k:.1f},0.7\n" for k, code in enumerate(codes)]
    path.write_text(LIVE_LINK + "".join(rows))
    names, weights = read_weights(path, [4, 5, 6], first=4, fps=fps)
    assert names == ["JawOpen"]
    assert np.allclose(weights[:, 0], expected, equal_nan=True)


def test_a_timecode_that_cannot_be_read_is_named(tmp_path):
    path = tmp_path / "l.csv"
    path.write_text(LIVE_LINK + "00:00:00:04.000,61,0,0\nnoon,61,0,0\n")
    with pytest.raises(InputError, match=r"l\.csv: found .*a frame without a number"):
        read_weights(path, [4, 5], first=4, fps=25.0)


def test_weights_are_read_by_frame_and_what_is_wrong_is_named(tmp_path):
    path = tmp_path / "w.csv"
    path.write_text("frame,time_s,smile,pucker\n4,0.1,0.5,0\n6,0.2,1,0.25\n")
    names, weights = read_weights(path, [6, 5, 4])
    assert names == ["smile", "pucker"]
    assert np.array_equal(weights[[0, 2]], [[1.0, 0.25], [0.5, 0.0]]) and np.isnan(weights[1]).all()
    assert read_weights(path, [4], names=["pucker"])[1].tolist() == [[0.0]]
    with pytest.raises(InputError, match=r"take t, file .*w.csv: found .*without frown"):
        read_weights(path, [4], names=["frown"], take="t")
    path.write_text("smile\n0.5\n")
    with pytest.raises(InputError, match="without frame"):
        read_weights(path, [4])
    with pytest.raises(InputError, match="unreadable table"):
        read_weights(tmp_path / "gone.csv", [4])
