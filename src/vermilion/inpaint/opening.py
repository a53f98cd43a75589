"""Where the mouth opens in a tattooed image: the inner contours of both lips, to a fraction of a pixel.

The mesh misses the inner contour by a fraction of a millimetre, or by more where the lips roll; the
image shows it, because ink looks like nothing inside a mouth. Across the mouth, column by column, the
contours of both lips move away from where the mesh has them to where ink ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import linear_to_srgb, srgb_to_linear
from vermilion.inpaint.domain import LipDomain
from vermilion.inpaint.fields import sample

_MIN_SAMPLES = 60
#: Lips are darker next to the opening: ink counts in these shades too.
_SHADES = (1.0, 0.75, 0.5)
#: Bins of display colours a channel, and the Gaussian that smooths them.
_N_BINS = 40
_BLUR_BINS = 0.5
#: Openings no wider than this are closed, in rows of the grid (half a pixel at least).
_SLIT = 2.0
#: Gaussian along a contour, in columns of the grid.
_BLUR_COLUMNS = 1.5


@dataclass(frozen=True)
class Evidence:
    """How the image is asked for the contours.

    Attributes:
        reach_mm: how far a contour may lie from the mesh's.
        step_mm: spacing of the grid, but no finer than half a pixel.
        clear_mm: lips closer than this to the mesh's contour, or to their ends, teach nothing.
        inside_mm: the same of the inside of the mouth.
        black, teeth: weights of what any mouth may show, beside what this one shows (1).
        unlike: share of the inside's colours that may be anything.
        sure: ratio of likelihoods (log) that counts in full.
        prior: cost of a contour one millimetre off the mesh's, in grid points of evidence.
        smooth: cost of a step of one grid point between columns.
    """

    reach_mm: float = 2.5
    step_mm: float = 0.12
    clear_mm: float = 1.0
    inside_mm: float = 0.3
    black: float = 0.2
    teeth: float = 0.3
    unlike: float = 0.2
    sure: float = 4.0
    prior: float = 1.0
    smooth: float = 0.6


@dataclass(frozen=True)
class Opening:
    """The mouth opening of one image.

    Attributes:
        origin_px: (2,) image place of column 0, row 0.
        along_px, across_px: (2,) steps of a column and of a row.
        columns: (n,) columns at which the lips are seen.
        pixel_mm: size of a pixel on the lips.
        reach_mm: how far from the mesh's the contours may lie.
        upper, lower: (n,) rows of the upper and the lower lip's inner contour; equal where closed.
    """

    origin_px: np.ndarray
    along_px: np.ndarray
    across_px: np.ndarray
    columns: np.ndarray
    pixel_mm: float
    reach_mm: float
    upper: np.ndarray
    lower: np.ndarray

    def coordinates(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Column and row of places (..., 2) of the image."""
        steps = np.linalg.inv(np.stack([self.along_px, self.across_px], axis=1))
        column, row = np.moveaxis((pixels - self.origin_px) @ steps.T, -1, 0)
        return column, row

    def place(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Image coordinates (..., 2) of columns and rows."""
        return self.origin_px + column[..., None] * self.along_px + row[..., None] * self.across_px

    def rows(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Row, upper and lower contour's row, and whether the lips are there, at places (..., 2)."""
        column, row = self.coordinates(pixels)
        there = (column >= self.columns[0]) & (column <= self.columns[-1])
        upper, lower = (np.interp(column, self.columns, edge) for edge in (self.upper, self.lower))
        return row, upper, lower, there

    def near(self, pixels: np.ndarray) -> np.ndarray:
        """Whether places (..., 2) lie between the corners, in the opening or within reach of it."""
        row, upper, lower, there = self.rows(pixels)
        reach = self.reach_mm / self.pixel_mm / np.linalg.norm(self.across_px)
        return there & (row > upper - reach) & (row < lower + reach)

    def inside(self, pixels: np.ndarray) -> np.ndarray:
        """Whether places (..., 2) of the image lie in the opening."""
        row, upper, lower, there = self.rows(pixels)
        return there & (row > upper) & (row < lower)


def find_opening(
    domain: LipDomain,
    caster: RayCaster,
    camera: Camera,
    linear: np.ndarray,
    axis: np.ndarray,
    box_px: tuple[np.ndarray, np.ndarray],
    pixel_mm: float,
    evidence: Evidence,
) -> Opening | None:
    """The opening between the lips of a tattooed image; None where no lips are seen.

    Args:
        linear: (h, w, 3) image of the camera.
        axis: (2,) unit, along the mouth.
        box_px: lowest and highest corner of a rectangle round the lips.
    """
    step = max(0.5, evidence.step_mm / pixel_mm)
    grid, origin, along, across = _grid(axis, box_px, step)
    hits = caster.cast(*camera.rays(grid))
    lip = np.where(hits.hit, domain.lip[np.maximum(hits.triangle, 0)], 0)
    mesh = _contours_of_mesh(lip)
    if mesh is None:
        return None
    columns, upper, lower = mesh
    step_mm = step * pixel_mm
    colours = sample(linear, grid)[:, columns]
    score = _score(lip[:, columns], upper, lower, colours, step_mm, evidence)
    if score is not None:
        ends = np.minimum(columns - columns[0], columns[-1] - columns) * step_mm < evidence.clear_mm
        score = np.where(_beyond_lips(lip[:, columns]) | ends, 1.0, score)
        upper, lower = _best_contours(score, upper, lower, step_mm, evidence)
        # A slit of one step is ink in the shadow between the lips.
        middle = 0.5 * (upper + lower)
        slit = lower - upper <= _SLIT
        upper, lower = np.where(slit, middle, upper), np.where(slit, middle, lower)
        # Steps of the grid are no steps of a lip.
        upper, lower = (gaussian_filter1d(edge, _BLUR_COLUMNS) for edge in (upper, lower))
    return Opening(
        origin, along * step, across * step, columns, pixel_mm, evidence.reach_mm, upper, lower
    )


def _grid(
    axis: np.ndarray, box_px: tuple[np.ndarray, np.ndarray], step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places (rows, columns, 2) over a box, turned to the mouth; their origin and both directions."""
    low, high = box_px
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
    columns = np.flatnonzero((lip == 1).any(axis=0) & (lip == 2).any(axis=0))
    if len(columns) < 8:
        return None
    upper = np.where(lip == 1, rows + 1, 0).max(axis=0)[columns].astype(float)
    lower = np.where(lip == 2, rows, len(lip)).min(axis=0)[columns].astype(float)
    middle = 0.5 * (upper + lower)
    closed = lower <= upper
    return columns, np.where(closed, middle, upper), np.where(closed, middle, lower)


def _beyond_lips(lip: np.ndarray) -> np.ndarray:
    """Skin above the upper and below the lower lip of each column."""
    seen = lip > 0
    return ~(np.maximum.accumulate(seen) & np.maximum.accumulate(seen[::-1])[::-1])


def _score(
    lip: np.ndarray,
    upper: np.ndarray,
    lower: np.ndarray,
    colours: np.ndarray,
    step_mm: float,
    evidence: Evidence,
) -> np.ndarray | None:
    """(rows, columns) in [-1, 1]: 1 where the image shows ink, -1 the inside of the mouth.

    Both are judged by the densities of display colours, learnt from this image where the mesh is
    beyond doubt. None where too little of the lips is seen.
    """
    rows = np.arange(len(lip))[:, None]
    past = (
        np.maximum(upper - rows, rows - lower) * step_mm
    )  # from the contour, positive on the lips
    edge = int(np.ceil(0.5 * evidence.clear_mm / step_mm))
    red = cv2.erode((lip > 0).astype(np.uint8), np.ones((3, 3)), iterations=edge) > 0
    ink = colours[red & (past > evidence.clear_mm)]
    inside = colours[past < -evidence.inside_mm]
    if len(ink) < _MIN_SAMPLES:
        return None
    darkest = 0.5 * np.percentile(ink.max(axis=1), 2)
    black = np.linspace(0, darkest, 12)[:, None] * np.ones(3)
    parts = [(evidence.black, black), (evidence.teeth, _tooth_colours())]
    if len(inside) >= _MIN_SAMPLES:
        parts.append((1.0, inside))
    of_inside = _density(parts)
    of_ink = _density([(1.0, np.concatenate([ink * shade for shade in _SHADES]))])
    anything = evidence.unlike / of_ink.size
    ratio = np.log(of_ink + 0.1 * anything)
    ratio -= np.log(of_inside * (1.0 - evidence.unlike) + anything)
    return np.clip(ratio[_bins(colours)] / evidence.sure, -1.0, 1.0)


def _tooth_colours() -> np.ndarray:
    """Linear colours of teeth from light to shadow: CIELAB a about 1, b 8 to 20 where they are light."""
    light, a, b = np.meshgrid(np.linspace(10, 88, 60), [-1.0, 1.0, 3.0], np.linspace(8, 20, 13))
    shade = light / 72.0
    lab = np.stack([light, a * shade, b * shade], axis=-1).reshape(-1, 1, 3).astype(np.float32)
    return np.clip(srgb_to_linear(cv2.cvtColor(lab, cv2.COLOR_Lab2RGB)[:, 0]), 0.0, 1.0)


def _bins(linear: np.ndarray) -> tuple[np.ndarray, ...]:
    """Bin of each linear colour (..., 3), a channel each."""
    return tuple(np.moveaxis((linear_to_srgb(linear) * (_N_BINS - 1) + 0.5).astype(int), -1, 0))


def _density(parts: list[tuple[float, np.ndarray]]) -> np.ndarray:
    """Share of samples, (weight, linear colours (n, 3)), in each bin of display colours, smoothed."""
    total = np.zeros((_N_BINS,) * 3)
    for weight, colours in parts:
        count = np.zeros((_N_BINS,) * 3)
        np.add.at(count, _bins(colours), 1.0)
        total += weight * count / max(len(colours), 1)
    return gaussian_filter(total / total.sum(), _BLUR_BINS, mode="nearest", truncate=3)


def _best_contours(
    score: np.ndarray, upper: np.ndarray, lower: np.ndarray, step_mm: float, evidence: Evidence
) -> tuple[np.ndarray, np.ndarray]:
    """Dynamic programming over the columns; a state is how far both contours are moved.

    Minimises the score inside the opening, plus the costs of moving and of bending.
    """
    height, width = score.shape
    total = np.concatenate([np.zeros((1, width)), np.cumsum(score, axis=0)])
    reach = int(np.ceil(evidence.reach_mm / step_mm))
    moves = np.arange(-reach, reach + 1)
    off = evidence.prior * (moves * step_mm) ** 2
    a = np.clip(np.rint(upper)[:, None] + moves, 0, height).astype(int)
    b = np.clip(np.rint(lower)[:, None] + moves, 0, height).astype(int)
    column = np.arange(width)[:, None]
    cost = total[b, column][:, None, :] - total[a, column][:, :, None] + off[:, None] + off
    cost = np.where(a[:, :, None] <= b[:, None, :], cost, 1e6)
    best, back = cost[0], []
    for now in cost[1:]:
        best, came = _step(best, evidence.smooth)
        best = best + now
        back.append(came)
    state = np.unravel_index(best.argmin(), best.shape)
    path = [state]
    for came in reversed(back):
        state = tuple(came[:, state[0], state[1]])
        path.append(state)
    i, j = np.array(path[::-1]).T
    return a[column[:, 0], i].astype(float), b[column[:, 0], j].astype(float)


def _step(best: np.ndarray, smooth: float) -> tuple[np.ndarray, np.ndarray]:
    """Cheapest predecessor of every state, its contours at most two points away: (cost, (2, m, m))."""
    size = best.shape[0]
    padded = np.pad(best, 2, constant_values=1e9)
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    cheapest, came = np.full_like(best, np.inf), np.zeros((2, size, size), dtype=int)
    for di in range(-2, 3):
        for dj in range(-2, 3):
            cost = padded[2 + di : 2 + di + size, 2 + dj : 2 + dj + size]
            cost = cost + smooth * (di * di + dj * dj)
            better = cost < cheapest
            cheapest = np.where(better, cost, cheapest)
            came[0][better], came[1][better] = (i + di)[better], (j + dj)[better]
    return cheapest, came
