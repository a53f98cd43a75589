"""Jaw and expression of FLAME for corrected lips: what is found for parameters that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation

from tests.unit.exported import animated_head
from vermilion.export.flame import FlameWeights, solve_flame
from vermilion.external.flame import FlameTake, read_parameters
from vermilion.external.flame_model import JAW, SHAPES, Flame
from vermilion.external.read import read_tracked
from vermilion.external.sequence import Request
from vermilion.storage.errors import InputError

COUNT, MODES = 16, 10
FRAMES = np.arange(100, 100 + COUNT)


def stand_in() -> Flame:
    """A model on the sheet face, in metres: a jaw that carries its lower half, ten modes of the mouth."""
    head, rng = animated_head(), np.random.default_rng(0)
    rest = head.neutral_mm / 1000.0
    count = len(rest)
    below = 1.0 / (1.0 + np.exp((rest[:, 1] + 0.004) / 0.003))
    weights = np.stack([0 * below, 1 - below, below, 0 * below, 0 * below], axis=1)
    near = np.exp(-(rest[:, :2] ** 2).sum(axis=1) / 0.0003)
    waves = np.sin(rest[:, :2] @ rng.normal(0, 90, (2, MODES)) + rng.uniform(0, 6, MODES))
    shapes = np.zeros((count, 3, SHAPES + MODES))
    shapes[..., :SHAPES] = rng.normal(0, 1e-4, (count, 3, SHAPES))
    shapes[..., SHAPES:] = near[:, None, None] * waves[:, None] * rng.normal(0, 1e-3, (3, MODES))
    joints = np.zeros((5, count))
    for joint, place in enumerate([[0, -0.06, -0.05], [0, -0.05, -0.05], [0.055, 0, -0.04]]):
        chosen = np.argsort(((rest - place) ** 2).sum(axis=1))[:20]
        joints[joint, chosen] = 0.05
    poses = near[:, None, None] * rng.normal(0, 1e-4, (count, 3, 36))
    parents = np.array([0, 0, 1, 1, 1])
    return Flame(
        rest, head.polygons.triangles, shapes, poses, sparse.csr_matrix(joints), weights, parents
    )


def track_of(model: Flame, expr=None, jaw=None) -> FlameTake:
    """A turning head with a mouth that opens."""
    time, rng = np.arange(COUNT) / 8, np.random.default_rng(1)
    poses = np.zeros((COUNT, 15))
    poses[:, 1], poses[:, 3] = 0.2 * np.sin(time), 0.1
    poses[:, 3 * JAW] = 0.15 + 0.1 * np.sin(2 * time) if jaw is None else jaw
    shape = rng.normal(0, 0.5, 20)
    own = np.sin(time[:, None] + rng.uniform(0, 6, MODES)) if expr is None else expr
    offset = np.zeros((len(model.template) + 7, 3))  # with teeth that the tracker added
    return FlameTake(
        model, FRAMES, shape, own, poses,
        np.column_stack([0.05 * time, 0 * time, -1 + 0 * time]), offset,
        0 * model.template, np.zeros(COUNT),
    )  # fmt: skip


def regions(model: Flame) -> dict[str, np.ndarray]:
    x, y = np.abs(model.template[:, 0]), np.abs(model.template[:, 1])
    far = np.linalg.norm(model.template[:, :2], axis=1) > 0.045
    steady = far & (model.weights[:, JAW] < 0.01)
    return {"lips": (y < 0.009) & (x < 0.022), "face": np.ones(len(x), bool), "steady": steady}


def solved(track: FlameTake, meshes: np.ndarray, **more) -> FlameWeights:
    """The solution for meshes (F, V, 3), metres."""
    head = animated_head(FRAMES)
    shown = replace(head, vertices_mm=1000.0 * meshes, unit_mm=1000.0, **more)
    return solve_flame(shown, track, **regions(track.model))


def meshes_of(take: FlameTake) -> np.ndarray:
    return np.stack([take.vertices(row) for row in range(len(take.frames))])


def corrected_case(model: Flame) -> tuple[FlameTake, np.ndarray]:
    """A track, and its corrected mouth: other parameters, lips of this person, a motion that FLAME has not."""
    track = track_of(model)
    true = track_of(model, 0.6 * track.expr + 0.4, track.poses[:, 3 * JAW] + 0.06)
    near = np.exp(-(model.template[:, :2] ** 2).sum(axis=1) / 1e-4)[:, None]
    fine = np.sin(900 * model.template[:, :1]) * near
    drive = np.sin(np.arange(COUNT) * 1.3)[:, None, None]
    return track, meshes_of(true) + 8e-4 * fine * [0, 0, 1] + 5e-4 * drive * near * [0, 1, 0.3]


def test_derivatives_are_differences():
    model, rng = stand_in(), np.random.default_rng(5)
    shaped = model.template + rng.normal(0, 1e-3, model.template.shape)
    turns, forces = rng.normal(0, 0.3, (5, 3)), rng.normal(size=model.template.shape)
    pose, step = model.pose(shaped, turns), 1e-3 * rng.normal(size=model.template.shape)
    moved = model.pose(shaped + step, turns).vertices - pose.vertices
    assert (moved * forces).sum() == pytest.approx((model.pull(pose, forces) * step).sum())
    motion = model.jaw_motion(pose, turns[JAW])
    pulled = model.jaw_pull(pose, turns[JAW], forces)
    assert pulled == pytest.approx((motion * forces).sum(axis=(1, 2)))
    for axis in range(3):
        ends = []
        for sign in (-1, 1):
            other = turns.copy()
            other[JAW, axis] += sign * 1e-5
            ends.append(model.pose(shaped, other).vertices)
        assert np.abs((ends[1] - ends[0]) / 2e-5 - motion[axis]).max() < 1e-6


def test_parameters_that_the_mesh_has_shown_are_found_again():
    model = stand_in()
    track = track_of(model)
    true = track_of(model, 0.5 * track.expr + 0.5, track.poses[:, 3 * JAW] + 0.1)
    found = solved(track, meshes_of(true))
    assert found.alone_mm.mean() < 0.03
    off = np.abs(found.take.poses - true.poses)
    assert off[:, 3 * JAW].mean() < 0.01
    assert np.delete(off, np.s_[3 * JAW : 3 * JAW + 3], axis=1).max() == 0.0
    assert np.array_equal(found.take.translation, true.translation)


def test_an_uncorrected_take_keeps_its_parameters():
    track = track_of(stand_in())
    found = solved(track, meshes_of(track))
    # But for the smoothness over time.
    assert found.alone_mm.mean() < 0.01
    assert np.abs(found.take.expr - track.expr).mean() < 0.05


def test_the_reader_gives_back_the_mesh_with_offset_and_corrective(tmp_path):
    model = stand_in()
    track, meshes = corrected_case(model)
    found = solved(track, meshes)
    assert found.alone_mm.mean() > 1.5 * found.offset_mm.mean()
    assert found.offset_mm.mean() > 3 * found.corrected_mm.mean()
    assert found.corrected_mm.mean() < 0.05
    assert np.abs(found.take.corrective_weight).max() == pytest.approx(1.0)
    names = {"v_template": model.template, "f": model.faces, "shapedirs": model.shapes}
    names |= {"posedirs": model.pose_shapes, "J_regressor": model.joints.toarray()}
    names |= {"weights": model.weights, "kintree_table": np.array([model.parents])}
    np.savez(tmp_path / "flame.npz", **names)
    found.take.save(tmp_path / "p.npz")
    back = read_tracked(tmp_path / "p.npz", FRAMES, flame=tmp_path / "flame.npz")
    lips = regions(model)["lips"]
    off = np.linalg.norm(back.vertices_mm - 1000 * meshes, axis=2)[:, lips].mean(axis=1)
    assert np.abs(off - found.corrected_mm).max() < 1e-3
    with np.load(tmp_path / "p.npz") as stored:
        assert stored["static_offset"].shape == (1, len(model.template) + 7, 3)
        assert stored["jaw_pose"].shape == (COUNT, 3)


def test_parameters_stay_in_their_range():
    model = stand_in()
    track = track_of(model)
    far = track_of(model, np.where(np.arange(MODES) == 3, 9.0, track.expr))
    found = solved(track, meshes_of(far)).take
    assert found.expr.max() == pytest.approx(4.0)
    assert (found.expr[:, 3] > 3.8).all()


def test_a_head_that_the_correction_moved_is_followed():
    model = stand_in()
    track = track_of(model)
    turn = Rotation.from_euler("xyz", [4, -3, 2], degrees=True)
    moved = meshes_of(track) @ turn.as_matrix().T + [0.003, -0.005, 0.012]
    found = solved(track, moved)
    assert found.alone_mm.mean() < 0.01
    wanted = turn * Rotation.from_rotvec(track.poses[:, :3])
    assert np.abs(found.take.poses[:, :3] - wanted.as_rotvec()).max() < 1e-4


def test_frames_without_a_mesh_or_parameters_are_left_out():
    model = stand_in()
    track = track_of(model)
    meshes = meshes_of(track)
    meshes[3] = np.nan
    found = solved(track.of_rows(np.arange(1, COUNT)), meshes)
    assert found.take.frames.tolist() == [101, 102, *range(104, 100 + COUNT)]


@pytest.mark.parametrize("name", ["meshes", "meshes.npz", "meshes.usdc"])
def test_a_sequence_of_meshes_is_refused_in_a_sentence(tmp_path, name):
    (tmp_path / "meshes").mkdir()
    np.savez(tmp_path / "meshes.npz", vertices=np.zeros((1, 3, 3)), triangles=np.eye(3))
    request = Request(tmp_path / name, [0], place={"subject": "s", "take": "t"})
    with pytest.raises(InputError, match=r"take t, .*found meshes; expected parameters of FLAME"):
        read_parameters(request)
