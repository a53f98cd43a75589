"""Sequences of FLAME's parameters: a small model of the same kind, whose meshes are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation

from vermilion.external.read import read_tracked
from vermilion.storage.errors import InputError

#: Root, neck, jaw, two eyes.
PARENTS = np.array([[0, 0, 1, 1, 1], [0, 1, 2, 3, 4]])
N = 12


def model_file(path, **changed):
    """A model of 12 vertices, each of one joint but the last two, 0.2 m in size."""
    rng = np.random.default_rng(0)
    weights = np.eye(5)[np.array([0, 0, 0, 1, 1, 2, 2, 2, 3, 4, 1, 1])]
    weights[-1] = [0.0, 0.5, 0.5, 0.0, 0.0]
    regressor = np.zeros((5, N))
    regressor[[0, 1, 2, 3, 4], [0, 3, 5, 8, 9]] = 1.0
    arrays = {
        "v_template": rng.uniform(-0.1, 0.1, (N, 3)), "f": np.array([[0, 1, 2], [3, 4, 5], [9, 10, 11]]),
        "shapedirs": rng.normal(0, 0.01, (N, 3, 400)), "posedirs": np.zeros((N, 3, 36)),
        "J_regressor": regressor, "weights": weights, "kintree_table": PARENTS,
    } | changed  # fmt: skip
    np.savez(path, **arrays)
    return arrays


def parameters(count=3):
    zero = np.zeros((count, 3))
    return {
        "shape": np.zeros(300), "expr": np.zeros((count, 50)), "rotation": zero, "neck_pose": zero,
        "jaw_pose": zero, "eyes_pose": np.zeros((count, 6)), "translation": zero,
    }  # fmt: skip


def read(tmp_path, frames=(0, 1, 2), source="p.npz", **more):
    return read_tracked(tmp_path / source, frames, flame=tmp_path / "flame.npz", **more)


def test_shape_and_expression_are_added_in_metres(tmp_path):
    model, given = model_file(tmp_path / "flame.npz"), parameters()
    given["shape"] = np.array([0.5, -1.0])
    given["expr"][1, 4] = 2.0
    given["static_offset"] = np.full((1, N + 7, 3), 0.003)  # with teeth that the tracker added
    np.savez(tmp_path / "p.npz", **given)
    found = read(tmp_path)
    shapes = model["shapedirs"]
    wanted = model["v_template"] + 0.003 + 0.5 * shapes[..., 0] - shapes[..., 1]
    assert found.unit_mm == 1000.0
    assert np.array_equal(found.triangles, model["f"])
    assert np.allclose(found.vertices_mm[0], 1000 * wanted, atol=1e-3)
    assert np.allclose(found.vertices_mm[1], 1000 * (wanted + 2 * shapes[..., 304]), atol=1e-3)


def test_the_jaw_turns_about_its_joint_below_the_neck_and_the_root(tmp_path):
    correctives = np.zeros((N, 3, 36))
    correctives[6, 1, 9 + 4] = 0.01  # by the jaw's rotation, element (1, 1) less 1
    model, given = model_file(tmp_path / "flame.npz", posedirs=correctives), parameters(1)
    turns = {"rotation": [0.0, 0.4, 0.0], "neck_pose": [0.1, 0.0, 0.2], "jaw_pose": [0.3, 0.0, 0.0]}
    given |= {name: np.array([value]) for name, value in turns.items()}
    given["translation"] = np.array([[0.0, 0.1, -1.0]])
    np.savez(tmp_path / "p.npz", **given)
    found = read(tmp_path, [0]).vertices_mm[0] / 1000.0
    root, neck, jaw = (Rotation.from_rotvec(turn).as_matrix() for turn in turns.values())
    rest = model["v_template"]
    lift = np.array([0.0, 0.01 * (jaw[1, 1] - 1), 0.0])
    rest = np.where(np.arange(N)[:, None] == 6, rest + lift, rest)
    base, nape, hinge = (model["v_template"][k] for k in (0, 3, 5))

    def by_root(point):
        return root @ (point - base) + base

    def by_neck(point):
        return by_root(neck @ (point - nape) + nape)

    def by_jaw(point):
        return by_neck(jaw @ (point - hinge) + hinge)

    shift = given["translation"][0]
    for vertex, motion in ((1, by_root), (4, by_neck), (6, by_jaw), (7, by_jaw)):
        assert np.allclose(found[vertex], motion(rest[vertex]) + shift, atol=1e-6)
    assert np.allclose(found[11], 0.5 * (by_neck(rest[11]) + by_jaw(rest[11])) + shift, atol=1e-6)


def test_a_file_a_frame_costs_itself_alone_where_it_is_damaged(tmp_path):
    model_file(tmp_path / "flame.npz", J_regressor=sparse.eye(5, N).toarray())
    given = parameters(3)
    given["jaw_pose"] = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    np.savez(tmp_path / "p.npz", **given)
    folder = tmp_path / "flame_param"
    folder.mkdir()
    per_frame = ("expr", "rotation", "neck_pose", "jaw_pose", "eyes_pose", "translation")
    for frame in range(3):
        one = {name: given[name][[frame]] for name in per_frame} | {"shape": given["shape"]}
        np.savez(folder / f"{frame:05d}.npz", **one)
    (folder / "00001.npz").write_bytes(b"no archive")
    found = read(tmp_path, (0, 1, 2), "flame_param")
    assert list(found.lost) == [1]
    whole = read(tmp_path)
    assert np.array_equal(found.vertices_mm[[0, 2]], whole.vertices_mm[[0, 2]])


@pytest.mark.parametrize(
    ("changes", "model", "message"),
    [
        (
            {},
            None,
            "found parameters of FLAME; expected your model file in `tracking.external.flame`",
        ),
        ({"expr": np.zeros((3, 101))}, {}, "300 coefficients of shape and 101 of expression"),
        ({"jaw_pose": np.zeros((2, 3))}, {}, r"jaw_pose of shape \(2, 3\); expected \(3, 3\)"),
        ({"static_offset": np.zeros((4, 3))}, {}, "a static_offset of 4 vertices; expected 12"),
        ({}, {"weights": np.zeros((N, 4))}, r"J_regressor of shape \(5, 12\); expected \(4, 12\)"),
        ({}, {"posedirs": np.zeros((N, 3, 9))}, r"posedirs of shape \(12, 3, 9\)"),
    ],
)
def test_what_is_wrong_is_one_sentence(tmp_path, changes, model, message):
    np.savez(tmp_path / "p.npz", **(parameters() | changes))
    if model is not None:
        model_file(tmp_path / "flame.npz", **model)
    with pytest.raises(InputError, match=rf"subject s, take t, file .*{message}"):
        read_tracked(
            tmp_path / "p.npz", [0], subject="s", take="t",
            flame=None if model is None else tmp_path / "flame.npz",
        )  # fmt: skip
