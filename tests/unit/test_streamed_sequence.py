"""Sequences that are written and read a frame at a time."""

from __future__ import annotations

import numpy as np
import pytest

from vermilion.storage.errors import InputError
from vermilion.storage.sequences import StreamedSequence, read_sequence, write_frames


def test_a_streamed_sequence_is_the_one_that_was_written(tmp_path):
    meshes = np.random.default_rng(0).normal(0, 50, (7, 11, 3)).astype(np.float32)
    write_frames(tmp_path / "a.npy", meshes.shape, iter(meshes.astype(np.float64)))
    assert np.array_equal(read_sequence(tmp_path / "a.npy"), meshes)
    streamed = StreamedSequence(tmp_path / "a.npy")
    assert len(streamed) == 7
    for row in (0, 6, 3, -1):
        assert np.array_equal(streamed[row], meshes[row])
    with pytest.raises(IndexError):
        streamed[7]


@pytest.mark.parametrize("shape", [(6, 11, 3), (8, 11, 3), (7, 10, 3)])
def test_another_number_of_frames_or_vertices_is_no_sequence(tmp_path, shape):
    with pytest.raises(ValueError, match="in a sequence of"):
        write_frames(tmp_path / "a.npy", shape, np.zeros((7, 11, 3)))
    assert not (tmp_path / "a.npy").exists()


def test_values_of_another_type_are_not_streamed(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((2, 5, 3)))
    with pytest.raises(InputError, match="float64; expected float32"):
        StreamedSequence(tmp_path / "a.npy")
