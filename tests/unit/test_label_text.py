"""The line of text in the corner of drawings."""

import numpy as np

from vermilion.imaging.draw import label


def test_the_outline_ends_where_the_letters_end():
    for width_px in (352, 1920):
        drawn = label(np.full((80, width_px, 3), 128, np.uint8), "with contours  frame 50")[..., 0]
        letters, outline = (np.flatnonzero(mask.any(axis=0)) for mask in (drawn > 150, drawn < 100))
        assert 0 <= outline[-1] - letters[-1] <= 2  # px
        assert 0 <= letters[0] - outline[0] <= 2
