"""Known truth from files: the frames asked for, and messages that name what is wrong."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vermilion.evaluation.truth import read_curves, read_truth
from vermilion.storage.errors import InputError

PLACE = {"subject": "anna", "take": "rom"}


@pytest.fixture
def files(tmp_path):
    vertices, triangles = tmp_path / "vertices_mm.npy", tmp_path / "triangles.npy"
    np.save(vertices, np.arange(5.0)[:, None, None] * np.ones((5, 4, 3), np.float32))
    np.save(triangles, np.array([[0, 1, 2], [1, 2, 3]]))
    return vertices, triangles


def test_frames_are_those_of_the_take(files):
    meshes, triangles = read_truth(*files, rows=np.array([1, 4]), **PLACE)
    assert meshes[:, 0, 0].tolist() == [1.0, 4.0]
    assert triangles.shape == (2, 3)


def test_truth_shorter_than_the_take_is_named(files, tmp_path):
    with pytest.raises(
        InputError, match=r"subject anna, take rom, file .*vertices_mm.npy: found truth of 5"
    ):
        read_truth(*files, rows=np.array([2, 5]), **PLACE)
    curves = tmp_path / "weights.json"
    curves.write_text(json.dumps([{"jawOpen": 0.1}, {"jawOpen": 0.2}]))
    assert read_curves(curves, np.array([1]), **PLACE) == [{"jawOpen": 0.2}]
    with pytest.raises(
        InputError, match=r"anna.*weights.json: found truth of 2 frames; expected at least 3"
    ):
        read_curves(curves, np.array([2]), **PLACE)


def test_triangles_of_another_mesh_and_damaged_files_are_named(files):
    vertices, triangles = files
    np.save(triangles, np.array([[0, 1, 9]]))
    with pytest.raises(
        InputError, match=r"triangles .* with vertices up to 9; expected .* of 4 vertices"
    ):
        read_truth(vertices, triangles, np.array([0]), **PLACE)
    triangles.write_bytes(b"no array")
    with pytest.raises(
        InputError, match=r"take rom, file .*triangles.npy: found unreadable triangles"
    ):
        read_truth(vertices, triangles, np.array([0]), **PLACE)
