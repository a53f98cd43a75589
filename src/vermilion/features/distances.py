"""The twenty relative contour distances (Lips16 5.1, figure 8).

With n samples on each ring (see `rings.Ring`), let outer(j) and lower(j) be the samples at j tenths
of the upper and of the lower half of the outer contour, from the subject's right mouth corner:

- `outer_width`: from corner to corner;
- `outer_height_j`, j = 1..9: from outer(j) to lower(j);
- `upper_lip_j`, j = 1, 3, 5, 7, 9: from outer(j) to the inner contour found from it;
- `lower_lip_j`, j = 1, 3, 5, 7, 9: from lower(j) to the inner contour found from it.

Height less the lips' widths is the mouth's opening there. All are Euclidean, per inter-ocular
distance. In the image they do not change when it is moved, scaled or turned; in the head frame they
do not change when the head turns out of the image's plane either (Lips16 7).
"""

from __future__ import annotations

import numpy as np

HEIGHTS = tuple(range(1, 10))
LIPS = (1, 3, 5, 7, 9)
NAMES = (
    "outer_width",
    *(f"outer_height_{j}" for j in HEIGHTS),
    *(f"upper_lip_{j}" for j in LIPS),
    *(f"lower_lip_{j}" for j in LIPS),
)


def contour_distances(outer: np.ndarray, inner: np.ndarray, unit: float) -> np.ndarray:
    """The distances of `NAMES`, (20,), per inter-ocular distance.

    Args:
        outer: ring, (n, 2) px or (n, 3) mm, n a multiple of 20.
        inner: as `outer`, (n, 2) or (n, 3); sample k was found from sample k of the outer ring.
        unit: inter-ocular distance, as the rings.

    Each but the width is the mean over the samples within a twentieth of a half, which halves the
    noise of single samples.
    """
    n = len(outer)
    if n % 20 or n != len(inner):
        raise ValueError(f"rings must have the same multiple of 20 samples, got {n}, {len(inner)}")
    tenth = n // 20
    width = np.linalg.norm(outer[0] - outer[n // 2])
    height = np.linalg.norm(outer - outer[-np.arange(n)], axis=1)
    lip = np.linalg.norm(outer - inner, axis=1)
    around = np.arange(-(tenth // 2), tenth // 2 + 1)
    heights = [height[j * tenth + around].mean() for j in HEIGHTS]
    upper = [lip[j * tenth + around].mean() for j in LIPS]
    lower = [lip[n - j * tenth + around].mean() for j in LIPS]
    return np.array([width, *heights, *upper, *lower]) / unit
