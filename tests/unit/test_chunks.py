"""Frames of chunk files: whatever the chunks, in the order asked for."""

from __future__ import annotations

import numpy as np
import pytest

from vermilion.storage.arrays import write_arrays
from vermilion.storage.chunks import read_chunks, read_frames
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import write_sequence


def written(folder, sizes):
    """Frames 10 to 15 whose values are their numbers, in chunks of these sizes."""
    meshes, arrays, first = [], [], 10
    for size in sizes:
        numbers = np.arange(first, first + size)
        name = f"{first:06d}-{first + size - 1:06d}"
        meshes.append(folder / "C" / f"{name}.npy")
        arrays.append(folder / "features" / f"{name}.npz")
        write_sequence(meshes[-1], np.tile(numbers[:, None, None], (1, 4, 3)).astype(float))
        write_arrays(arrays[-1], number=numbers, valid=numbers % 2 == 0)
        first += size
    return meshes, arrays


@pytest.mark.parametrize("sizes", [(6,), (1, 3, 2)])
def test_frames_come_as_asked_for_whatever_the_chunks(tmp_path, sizes):
    meshes, arrays = written(tmp_path, sizes)
    for frames in ([14, 10, 11], np.array([15]), []):
        numbers = np.array(frames, dtype=int)
        np.testing.assert_array_equal(read_frames(meshes, frames)[:, 0, 0], numbers)
        found = read_chunks(arrays, frames, ["number", "valid"])
        np.testing.assert_array_equal(found["number"], numbers)
        np.testing.assert_array_equal(found["valid"], numbers % 2 == 0)


def test_a_frame_that_no_chunk_has_is_named(tmp_path):
    meshes, arrays = written(tmp_path, (3, 3))
    with pytest.raises(InputError, match="no chunk with frame 16 among 2 files"):
        read_frames(meshes, [12, 16])
    with pytest.raises(InputError, match=r"features: found no chunk with frame 9"):
        read_chunks(arrays, [9], ["number"])
