"""Where the mouth opens in a tattooed image: inner contours of both lips, to a fraction of a pixel.

The mesh misses the inner contour by a fraction of a millimetre, and by more where the lips roll. The
image shows it, because nothing inside a mouth has the colours of the ink. The search starts from the
contours of the mesh and moves both lips, column by column across the mouth, to where the ink ends.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import linear_to_srgb, srgb_to_linear
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import sample
from vermilion.inpaint.opening import MouthPlace, Opening, OpeningSettings

_MIN_SAMPLES = 60
#: Lips are darker next to the opening: the ink's samples are added in these shades.
_SHADES = (1.0, 0.75, 0.5)
#: Bins of display colours a channel, and the Gaussian that smooths them.
_N_BINS = 40
_BLUR_BINS = 0.5
#: Openings no wider than this are closed, in rows of the grid (half a pixel at least).
_SLIT = 2.0
#: Gaussian along a contour, in columns of the grid.
_BLUR_COLUMNS = 1.5


def find_opening(
    domain: LipDomain,
    caster: RayCaster,
    camera: Camera,
    linear: np.ndarray,
    place: MouthPlace,
    settings: OpeningSettings,
) -> Opening | None:
    """The opening between the lips of a tattooed image; None where no lips are seen.

    `linear` (h, w, 3) is the image of `camera`, linear RGB.
    """
    pixel_mm = place.pixel_mm
    step = max(0.5, settings.step_mm / pixel_mm)
    grid, origin, along, across = _grid(place, step)
    hits = caster.cast(*camera.rays(grid))
    lip = np.where(hits.hit, domain.lip[np.maximum(hits.triangle, 0)], 0)
    mesh = _contours_of_mesh(lip)
    if mesh is None:
        return None
    columns, upper, lower = mesh
    step_mm = step * pixel_mm
    colours = sample(linear, grid)[:, columns]
    score = _score(lip[:, columns], upper, lower, colours, step_mm, settings)
    if score is not None:
        ends = np.minimum(columns - columns[0], columns[-1] - columns) * step_mm < settings.clear_mm
        score = np.where(_beyond_lips(lip[:, columns]) | ends, 1.0, score)
        upper, lower = _best_contours(score, upper, lower, step_mm, settings)
        # An opening of one grid step is ink in the shadow between the lips: the mouth is closed.
        middle = 0.5 * (upper + lower)
        slit = lower - upper <= _SLIT
        upper, lower = np.where(slit, middle, upper), np.where(slit, middle, lower)
        # Remove the steps of the grid.
        upper, lower = (gaussian_filter1d(edge, _BLUR_COLUMNS) for edge in (upper, lower))
    return Opening(
        origin, along * step, across * step, columns, pixel_mm, settings.reach_mm, upper, lower
    )


def _grid(place: MouthPlace, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places (rows, columns, 2) over the mouth, turned to it; their origin and both directions."""
    low, high, axis = place.low_px, place.high_px, place.axis
    along = axis if axis[0] > 0 else -axis
    across = np.array([-along[1], along[0]])
    corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])], dtype=float)
    u, v = corners @ along, corners @ across
    origin = u.min() * along + v.min() * across
    columns, rows = (int(np.ceil(np.ptp(a) / step)) + 1 for a in (u, v))
    x, y = np.meshgrid(np.arange(columns) * step, np.arange(rows) * step)
    return origin + x[..., None] * along + y[..., None] * across, origin, along, across


def _contours_of_mesh(lip: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Columns with both lips; the first row past the upper lip and the first row of the lower."""
    rows = np.arange(len(lip))[:, None]
    columns = np.flatnonzero((lip == 1).any(axis=0) & (lip == -1).any(axis=0))
    if len(columns) < 8:
        return None
    upper = np.where(lip == 1, rows + 1, 0).max(axis=0)[columns].astype(float)
    lower = np.where(lip == -1, rows, len(lip)).min(axis=0)[columns].astype(float)
    middle = 0.5 * (upper + lower)
    closed = lower <= upper
    return columns, np.where(closed, middle, upper), np.where(closed, middle, lower)


def _beyond_lips(lip: np.ndarray) -> np.ndarray:
    """Skin above the upper and below the lower lip of each column."""
    seen = lip != 0
    return ~(np.maximum.accumulate(seen) & np.maximum.accumulate(seen[::-1])[::-1])


def _score(
    lip: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
    colours: np.ndarray,
    step_mm: float,
    settings: OpeningSettings,
) -> np.ndarray | None:
    """(rows, columns) in [-1, 1]: 1 where the image shows ink, -1 the inside of the mouth.

    The score compares two densities of display colours. Their samples come from this image, from
    places far enough from the mesh's contours. None where too little of the lips is seen.
    """
    rows = np.arange(len(lip))[:, None]
    # Distance from the contour, positive on the lips.
    past = np.maximum(upper - rows, rows - lower) * step_mm
    edge = int(np.ceil(0.5 * settings.clear_mm / step_mm))
    red = cv2.erode((lip != 0).astype(np.uint8), np.ones((3, 3)), iterations=edge) > 0
    ink = colours[red & (past > settings.clear_mm)]
    inside = colours[past < -settings.inside_mm]
    if len(ink) < _MIN_SAMPLES:
        return None
    darkest = 0.5 * np.percentile(ink.max(axis=1), 2)
    black = np.linspace(0, darkest, 12)[:, None] * np.ones(3)
    parts = [(settings.black, _histogram(black)), (settings.teeth, _tooth_histogram())]
    if len(inside) >= _MIN_SAMPLES:
        parts.append((1.0, _histogram(inside)))
    of_inside = _density(parts)
    of_ink = _density([(1.0, _histogram(np.concatenate([ink * shade for shade in _SHADES])))])
    anything = settings.unlike / of_ink.size
    ratio = np.log(of_ink + 0.1 * anything)
    ratio -= np.log(of_inside * (1.0 - settings.unlike) + anything)
    return np.clip(ratio[_bins(colours)] / settings.sure, -1.0, 1.0)


@lru_cache(maxsize=1)
def _tooth_histogram() -> np.ndarray:
    """Histogram of teeth from light to shadow: CIELAB a about 1, b 8 to 20 where they are light."""
    light, a, b = np.meshgrid(np.linspace(10, 88, 60), [-1.0, 1.0, 3.0], np.linspace(8, 20, 13))
    shade = light / 72.0
    lab = np.stack([light, a * shade, b * shade], axis=-1).reshape(-1, 1, 3).astype(np.float32)
    linear = srgb_to_linear(cv2.cvtColor(lab, cv2.COLOR_Lab2RGB)[:, 0])
    return _histogram(np.clip(linear, 0.0, 1.0))


def _bins(linear: np.ndarray) -> tuple[np.ndarray, ...]:
    """Bin of each linear colour (..., 3), a channel each."""
    return tuple(np.moveaxis((linear_to_srgb(linear) * (_N_BINS - 1) + 0.5).astype(int), -1, 0))


def _histogram(colours: np.ndarray) -> np.ndarray:
    """How many of some linear colours (n, 3) fall in each bin of display colours, (_N_BINS,) * 3."""
    count = np.zeros((_N_BINS,) * 3)
    np.add.at(count, _bins(colours), 1.0)
    return count


def _density(parts: list[tuple[float, np.ndarray]]) -> np.ndarray:
    """Smooth density over the bins of a mixture of histograms, (weight, histogram)."""
    total = np.zeros((_N_BINS,) * 3)
    for weight, histogram in parts:
        total += weight * histogram / max(histogram.sum(), 1.0)
    return gaussian_filter(total / total.sum(), _BLUR_BINS, mode="nearest", truncate=3)


def _best_contours(
    score: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
    step_mm: float,
    settings: OpeningSettings,
) -> tuple[np.ndarray, np.ndarray]:
    """Dynamic programming over the columns; a state is how far both contours are moved.

    Minimises the score inside the opening, plus the costs of moving and of bending.
    """
    height, width = score.shape
    total = np.concatenate([np.zeros((1, width)), np.cumsum(score, axis=0)])
    reach = int(np.ceil(settings.reach_mm / step_mm))
    moves = np.arange(-reach, reach + 1)
    off = settings.prior * (moves * step_mm) ** 2
    a = np.clip(np.rint(upper)[:, None] + moves, 0, height).astype(int)
    b = np.clip(np.rint(lower)[:, None] + moves, 0, height).astype(int)
    column = np.arange(width)[:, None]
    cost = total[b, column][:, None, :] - total[a, column][:, :, None] + off[:, None] + off
    cost = np.where(a[:, :, None] <= b[:, None, :], cost, 1e6)
    best, back = cost[0], []
    for now in cost[1:]:
        best, came = _cheapest_steps(best, settings.smooth)
        best = best + now
        back.append(came)
    state = np.unravel_index(best.argmin(), best.shape)
    path = [state]
    for came in reversed(back):
        state = tuple(came[:, state[0], state[1]])
        path.append(state)
    i, j = np.array(path[::-1]).T
    return a[column[:, 0], i].astype(float), b[column[:, 0], j].astype(float)


def _cheapest_steps(best: np.ndarray, smooth: float) -> tuple[np.ndarray, np.ndarray]:
    """Cheapest predecessor of every state, its contours at most two points away: (cost, (2, m, m))."""
    # The cost of a step is a sum over the two contours: first the best of one, then of the other.
    places = np.arange(best.shape[0])
    across, by_j = _cheapest_shifts(best, smooth)
    cheapest, by_i = (table.T for table in _cheapest_shifts(across.T, smooth))
    i = places[:, None] + by_i
    return cheapest, np.stack([i, places + by_j[i, places]])


def _cheapest_shifts(best: np.ndarray, smooth: float) -> tuple[np.ndarray, np.ndarray]:
    """Cheapest predecessor in the same row, at most two columns away: (cost, columns away), both (m, m)."""
    size = best.shape[1]
    padded = np.full((size, size + 4), 1e9)
    padded[:, 2:-2] = best
    cheapest, shift = padded[:, :size] + 4 * smooth, np.full((size, size), -2)
    for away in range(-1, 3):
        cost = padded[:, 2 + away : 2 + away + size] + smooth * away * away
        better = cost < cheapest
        np.copyto(cheapest, cost, where=better)
        np.copyto(shift, away, where=better)
    return cheapest, shift
