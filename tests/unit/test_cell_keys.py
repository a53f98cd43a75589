"""Keys of cells: the same groups, in the same order, as rows compared one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from vermilion.geometry.cell_keys import cell_keys

FAR = 2**62


def same_groups(cells):
    ways = {"return_index": True, "return_inverse": True, "return_counts": True}
    _, *by_row = np.unique(cells, axis=0, **ways)
    _, *by_key = np.unique(cell_keys(cells), **ways)
    for one, other in zip(by_row, by_key, strict=True):
        assert np.array_equal(one.reshape(-1), other.reshape(-1))


@given(
    hnp.arrays(
        np.int64,
        st.tuples(st.integers(1, 60), st.integers(1, 3)),
        elements=st.one_of(st.integers(-3, 3), st.integers(-FAR, FAR)),
    )
)
def test_keys_find_what_rows_find(cells):
    same_groups(cells)


def test_keys_find_what_rows_find_in_a_cloud_of_a_head():
    rng = np.random.default_rng(0)
    same_groups(np.floor(rng.normal(scale=80.0, size=(20_000, 3)) / 2.0).astype(np.int64))


def test_no_cells_have_no_keys():
    assert cell_keys(np.zeros((0, 3), dtype=np.int64)).shape == (0,)


def test_cells_that_no_key_can_tell_apart_are_refused():
    cells = np.tile(np.arange(100)[:, None], (1, 10))  # 100^10 places
    with pytest.raises(ValueError, match="beyond 64 bit"):
        cell_keys(cells)
