"""Tables on disk: what is written by rows is read by columns."""

from __future__ import annotations

import numpy as np
import pytest

from vermilion.storage.disk_table import DiskTable


def test_rows_come_back_as_blocks_of_columns_and_blocks_as_rows(tmp_path):
    values = np.random.default_rng(0).normal(size=(7, 23)).astype(np.float32)
    by_rows, by_blocks = (DiskTable(7, 23, 5, tmp_path) for _ in range(2))
    for row in (3, 0, 6, 1, 2, 5, 4):
        by_rows.write_row(row, values[row])
    for block, found in by_rows.read_blocks():
        assert np.array_equal(found, values[:, block])
        by_blocks.write_block(block, found)
    assert [np.array_equal(by_blocks.row(row), values[row]) for row in range(7)] == 7 * [True]


def test_the_file_has_no_name_and_a_part_that_was_not_written_is_refused(tmp_path):
    table = DiskTable(4, 10, 4, tmp_path)
    table.write_row(0, np.arange(10.0))
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="not written"):
        table.row(3)
