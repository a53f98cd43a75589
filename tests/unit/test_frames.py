"""Which frames stand for all of them."""

import numpy as np
import pytest

from vermilion.storage.frames import evenly_spaced


@pytest.mark.parametrize("n", [0, 1, 2, 7, 24, 101])
@pytest.mark.parametrize("count", [1, 2, 3, 8, 200])
def test_evenly_spaced_frames_are_distinct_and_reach_both_ends(n, count):
    rows = evenly_spaced(n, count)
    assert len(rows) == min(n, count)
    assert (np.diff(rows) > 0).all()
    if len(rows) > 1:
        assert rows[0] == 0 and rows[-1] == n - 1
        assert np.ptp(np.diff(rows)) <= 1
