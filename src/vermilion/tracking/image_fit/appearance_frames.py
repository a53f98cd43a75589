"""The frames of a take from which its appearance is estimated."""

from __future__ import annotations

import numpy as np

#: A rotation by this many radians counts as a change of a blend weight by 1.
_ROTATION = 0.35


def choose_appearance_frames(
    x: np.ndarray, valid: np.ndarray, error_px: np.ndarray, count: int
) -> np.ndarray:
    """Rows (n,) of well-fitted frames that differ most in pose and expression, sorted.

    Farthest-point sampling: the best-fitted frame, then repeatedly the frame farthest from those
    chosen. Frames in the worst quarter of the reprojection errors are left out.

    Args:
        x: (F, 6 + K) rotation vector, translation, weights.
        valid: (F,) bool.
        error_px: (F,) reprojection error; NaN where there are no landmarks.
        count: wanted number of rows; fewer where the take has fewer.
    """
    usable = np.flatnonzero(valid & np.isfinite(error_px))
    if len(usable) == 0:
        return usable
    good = usable[error_px[usable] <= np.quantile(error_px[usable], 0.75)]
    place = np.concatenate([x[good, :3] / _ROTATION, x[good, 6:]], axis=1)
    chosen = [int(np.argmin(error_px[good]))]
    distance = np.linalg.norm(place - place[chosen[0]], axis=1)
    while len(chosen) < min(count, len(good)):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(place - place[chosen[-1]], axis=1))
    return np.sort(good[chosen])
