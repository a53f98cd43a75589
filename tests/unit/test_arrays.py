"""Named arrays: whole, the same bytes for the same content, damage named."""

import numpy as np
import pytest

from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import ModelFileError


@pytest.mark.parametrize("compressed", [False, True])
def test_round_trip_and_same_bytes(tmp_path, compressed):
    arrays = {"a": np.arange(5), "b": np.eye(3), "names": np.array(["x", "y"])}
    for name in ("1.npz", "2.npz"):
        write_arrays(tmp_path / name, compressed=compressed, **arrays)
    assert (tmp_path / "1.npz").read_bytes() == (tmp_path / "2.npz").read_bytes()
    back = read_arrays(tmp_path / "1.npz", "file")
    assert all(np.array_equal(back[name], value) for name, value in arrays.items())
    assert set(read_arrays(tmp_path / "1.npz", "file", ["b"])) == {"b"}


@pytest.mark.parametrize("keep", [0, 10, 200, -30])
def test_truncated_file_is_named_wherever_it_is_cut(tmp_path, keep):
    path = tmp_path / "model.npz"
    write_arrays(path, a=np.random.default_rng(0).normal(size=100))
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(ModelFileError, match=r"model\.npz: found an unreadable face model"):
        read_arrays(path, "face model", error=ModelFileError)


def test_missing_array_and_place_are_named(tmp_path):
    write_arrays(tmp_path / "f.npz", a=np.zeros(1))
    with pytest.raises(Exception, match=r"subject anna, file .*f\.npz: .*with a, b"):
        read_arrays(tmp_path / "f.npz", "file", ["a", "b"], subject="anna")
