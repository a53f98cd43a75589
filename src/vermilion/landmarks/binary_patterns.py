"""Local binary patterns of a face, to compare frames (Mono13 5.2, eq. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.landmarks.scheme import EYE_LEFT, EYE_RIGHT, MOUTH, interocular_px

N_UNIFORM, N_PLAIN = 59, 16
N_BINS = N_UNIFORM + N_PLAIN

#: Sine of 45 degrees in 256ths: interpolation in whole numbers, so that flat areas stay flat.
_DIAGONAL, _ONE = 181, 256


@dataclass(frozen=True)
class PatternSettings:
    """Sizes in inter-ocular distances (of the outer eye corners) but for `face_px` and `blur_px`.

    Attributes:
        face_px: inter-ocular distance in the aligned image.
        blur_px: deviation of the Gaussian that takes the noise out of the aligned image.
        eye, mouth: (width, height) of the rectangles.
        tile: side of a tile; a rectangle has the nearest whole number of them.
        patch: side of the square round a landmark.
    """

    face_px: float = 160.0
    blur_px: float = 1.0
    eye: tuple[float, float] = (0.5, 0.4)
    mouth: tuple[float, float] = (0.9, 0.7)
    tile: float = 0.125
    patch: float = 0.15


@dataclass(frozen=True)
class ReferenceShape:
    """The reference frame's landmarks in the aligned image, and what is compared there.

    Attributes:
        points: (66, 2) px of the aligned image.
        size: (width, height) px of the aligned image.
        regions: of each region (right eye, left eye, mouth), boxes of its tiles.
        patches: a box for each landmark. A box is (x, y, width, height) in whole px.
    """

    points: np.ndarray
    size: tuple[int, int]
    regions: tuple[np.ndarray, ...]
    patches: np.ndarray

    @classmethod
    def of(cls, points_px: np.ndarray, settings: PatternSettings) -> ReferenceShape:
        """From the landmarks `points_px` (66, 2) of the reference frame."""
        unit = settings.face_px
        margin = unit * (max(*settings.eye, *settings.mouth) / 2 + settings.patch)
        points = points_px * (unit / interocular_px(points_px))
        points = points - points.min(axis=0) + margin
        width, height = np.ceil(points.max(axis=0) + margin).astype(int)
        shapes = (
            (EYE_RIGHT, settings.eye),
            (EYE_LEFT, settings.eye),
            (MOUTH, settings.mouth),
        )
        regions = tuple(
            _tiles(points[index].mean(axis=0), np.array(shape) * unit, settings.tile * unit)
            for index, shape in shapes
        )
        side = round(settings.patch * unit)
        corners = np.rint(points - side / 2).astype(int)
        patches = np.concatenate([corners, np.full_like(corners, side)], axis=1)
        return cls(points, (int(width), int(height)), regions, patches)


@dataclass(frozen=True)
class FacePatterns:
    """Histograms of patterns of one frame: `regions`, each (tiles, 75), `patches` (66, 75)."""

    regions: tuple[np.ndarray, ...]
    patches: np.ndarray

    def region_distance(self, other: FacePatterns) -> float:
        """Mono13 eq. 3: the sum over eyes and mouth."""
        pairs = zip(self.regions, other.regions, strict=True)
        return float(sum(chi_squared(a, b) for a, b in pairs))

    def patch_distance(self, other: FacePatterns) -> float:
        """The same over the patches round the landmarks."""
        return chi_squared(self.patches, other.patches)


def describe(
    grey: np.ndarray, points_px: np.ndarray, reference: ReferenceShape, settings: PatternSettings
) -> FacePatterns:
    """Histograms of a frame that is aligned to the reference.

    Args:
        grey: (h, w) display brightness in [0, 1].
        points_px: (66, 2) landmarks of the frame.
    """
    aligned = align(grey, points_px, reference)
    aligned = cv2.GaussianBlur(aligned, (0, 0), settings.blur_px)
    pixels = np.clip(np.rint(aligned * 255), 0, 255).astype(np.uint8)
    uniform, plain = uniform_code(lbp8(pixels)), lbp4(pixels)
    regions = tuple(code_histograms(uniform, plain, tiles) for tiles in reference.regions)
    return FacePatterns(regions, code_histograms(uniform, plain, reference.patches))


def align(grey: np.ndarray, points_px: np.ndarray, reference: ReferenceShape) -> np.ndarray:
    """`grey` (h, w) as float32 under the affine map of `points_px` (66, 2) to the reference's."""
    to_image = affine_between(reference.points, points_px)
    scale = np.sqrt(abs(np.linalg.det(to_image[:, :2])))
    image: np.ndarray = grey.astype(np.float32)
    shrink = 1.0
    while scale * shrink > 1.5 and min(image.shape) > 32:
        image, shrink = cv2.pyrDown(image), shrink * 0.5
    matrix = to_image * shrink
    # Pixel centres: OpenCV's are whole numbers, ours lie half a pixel further.
    matrix[:, 2] += matrix[:, :2] @ [0.5, 0.5] - 0.5
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(
        image, matrix, reference.size, flags=flags, borderMode=cv2.BORDER_REPLICATE
    )


def affine_between(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The affine map (2, 3) that brings `source` (N, 2) nearest to `target` (N, 2), least squares."""
    homogeneous = np.concatenate([source, np.ones((len(source), 1))], axis=1)
    return np.linalg.lstsq(homogeneous, target, rcond=None)[0].T


def lbp8(pixels: np.ndarray) -> np.ndarray:
    """Codes (h, w) uint8 of `pixels` (h, w) uint8.

    Bit k says that the neighbour at k * 45 degrees is not darker. Radius one pixel; the diagonal ones
    are interpolated.
    """
    centre, around = _neighbours(pixels)
    a, b = _DIAGONAL, _ONE - _DIAGONAL
    code = np.zeros(pixels.shape, dtype=np.uint8)
    for k in range(8):
        if k % 2 == 0:
            brighter = around[k] >= centre
        else:
            sides = around[k - 1] + around[(k + 1) % 8]
            value = b * b * centre + a * b * sides + a * a * around[k]
            brighter = value >= _ONE * _ONE * centre
        code |= brighter.astype(np.uint8) << k
    return code


def lbp4(pixels: np.ndarray) -> np.ndarray:
    """Codes (h, w) uint8 below 16 of `pixels` (h, w) uint8: right, up, left and down neighbours."""
    centre, around = _neighbours(pixels)
    code = np.zeros(pixels.shape, dtype=np.uint8)
    for k in range(4):
        code |= (around[2 * k] >= centre).astype(np.uint8) << k
    return code


def uniform_code(codes: np.ndarray) -> np.ndarray:
    """The bin (h, w), below 59, of 8-bit `codes` (h, w).

    One for each of the 58 patterns with at most two changes round the circle, the last for all others.
    """
    return _UNIFORM[codes]


def code_histograms(uniform: np.ndarray, plain: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Shares of codes in boxes.

    Args:
        uniform: (h, w) codes below 59.
        plain: (h, w) codes below 16.
        boxes: (N, 4) x, y, width, height in px.

    Returns:
        (N, 75): 59 and 16 bins, each part sums to one.
    """
    result = np.empty((len(boxes), N_BINS))
    for row, (x, y, width, height) in enumerate(boxes):
        place = np.s_[y : y + height, x : x + width]
        result[row, :N_UNIFORM] = np.bincount(uniform[place].ravel(), minlength=N_UNIFORM)
        result[row, N_UNIFORM:] = np.bincount(plain[place].ravel(), minlength=N_PLAIN)
        result[row] /= max(width * height, 1)
    return result


def chi_squared(a: np.ndarray, b: np.ndarray) -> float:
    """Chi-squared distance, sum of (a - b)^2 / (a + b), of histograms `a` (..., B) and `b` (..., B)."""
    total = a + b
    return float(np.sum((a - b) ** 2 / np.where(total > 0, total, 1.0)))


def _tiles(centre: np.ndarray, size: np.ndarray, tile: float) -> np.ndarray:
    """Boxes (N, 4) of the tiles of a rectangle."""
    counts = np.maximum(np.rint(size / tile), 1).astype(int)
    edges = [
        np.rint(c - s / 2 + s * np.arange(n + 1) / n).astype(int)
        for c, s, n in zip(centre, size, counts, strict=True)
    ]
    return np.array(
        [
            (x0, y0, x1 - x0, y1 - y0)
            for y0, y1 in zip(edges[1][:-1], edges[1][1:], strict=True)
            for x0, x1 in zip(edges[0][:-1], edges[0][1:], strict=True)
        ]
    )


def _neighbours(pixels: np.ndarray) -> tuple[np.ndarray, Sequence[np.ndarray]]:
    """The pixels and their eight neighbours, counterclockwise from the right, as int32."""
    padded = np.pad(pixels.astype(np.int32), 1, mode="edge")
    height, width = pixels.shape
    steps = [(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)]
    around = [padded[1 + y : 1 + y + height, 1 + x : 1 + x + width] for y, x in steps]
    return padded[1:-1, 1:-1], around


def _uniform_table() -> np.ndarray:
    codes = np.arange(256)
    bits = (codes[:, None] >> np.arange(8)) & 1
    uniform = (bits != np.roll(bits, 1, axis=1)).sum(axis=1) <= 2
    table = np.full(256, N_UNIFORM - 1, dtype=np.uint8)
    table[uniform] = np.arange(uniform.sum())
    return table


_UNIFORM = _uniform_table()
