"""Calibration boards, ChArUco and checkerboard, and their corners in an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np


@dataclass(frozen=True)
class Board:
    """A flat board of squares.

    Board frame: millimetres, origin at a corner of the board, x along a row of squares, y down the
    columns, z = 0.

    Attributes:
        kind: `charuco` or `checkerboard`.
        squares: (columns, rows) of squares.
        square_mm: edge of a square.
        marker_mm: edge of a marker (ChArUco).
        dictionary: name of the marker dictionary in `cv2.aruco` (ChArUco).
        legacy: has the pattern of OpenCV before 4.6 (ChArUco with an even number of rows).
    """

    kind: Literal["charuco", "checkerboard"]
    squares: tuple[int, int]
    square_mm: float
    marker_mm: float = 0.0
    dictionary: str = "DICT_4X4_50"
    legacy: bool = False

    @property
    def corners_mm(self) -> np.ndarray:
        """Inner corners (N, 3) mm, board frame, row by row; the index is the corner's id."""
        columns, rows = self.squares
        x, y = np.meshgrid(np.arange(1, columns), np.arange(1, rows))
        flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
        return flat * float(self.square_mm)

    def charuco(self) -> cv2.aruco.CharucoBoard:
        """The ChArUco board of OpenCV."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        board = cv2.aruco.CharucoBoard(self.squares, self.square_mm, self.marker_mm, dictionary)
        board.setLegacyPattern(self.legacy)
        return board


@dataclass(frozen=True)
class Corners:
    """Board corners seen in one image.

    Attributes:
        ids: (n,) int.
        points_px: (n, 2), the centre of the top-left pixel is (0.5, 0.5).
    """

    ids: np.ndarray
    points_px: np.ndarray


class BoardDetector:
    """Finds one board in grey images."""

    def __init__(self, board: Board):
        self.board = board
        self._detector = None
        if board.kind == "charuco":
            parameters = cv2.aruco.DetectorParameters()
            parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
            self._detector = cv2.aruco.CharucoDetector(board.charuco())
            self._detector.setDetectorParameters(parameters)

    def detect(self, grey: np.ndarray) -> Corners:
        """Corners of the board in `grey` (h, w) uint8; none where the board is not found."""
        detector = self._detector
        found = _charuco(detector, grey) if detector is not None else self._checkerboard(grey)
        return Corners(found[0], found[1] + 0.5)

    def _checkerboard(self, grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        columns, rows = self.board.squares[0] - 1, self.board.squares[1] - 1
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE
        found, points = cv2.findChessboardCornersSB(grey, (columns, rows), flags=flags)
        if not found:
            return np.zeros(0, dtype=int), np.zeros((0, 2))
        grid = np.asarray(points, dtype=np.float64).reshape(rows, columns, 2)
        # A board rotated by 180 degrees differs only in its colours: the square below right of
        # corner 0 is black.
        if not _first_square_is_black(grey, grid):
            grid = grid[::-1, ::-1]
        return np.arange(columns * rows), grid.reshape(-1, 2)


def _charuco(
    detector: cv2.aruco.CharucoDetector, grey: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ids (n,) and places (n, 2), pixel indices, of the corners of a ChArUco board."""
    points, ids, _, _ = detector.detectBoard(grey)
    if ids is None or len(ids) < 6:
        return np.zeros(0, dtype=int), np.zeros((0, 2))
    return np.asarray(ids).reshape(-1), np.asarray(points, dtype=np.float64).reshape(-1, 2)


def _first_square_is_black(grey: np.ndarray, grid: np.ndarray) -> bool:
    def value(row: int, column: int) -> float:
        x, y = np.rint(grid[row : row + 2, column : column + 2].mean(axis=(0, 1))).astype(int)
        return float(grey[np.clip(y, 0, grey.shape[0] - 1), np.clip(x, 0, grey.shape[1] - 1)])

    return value(0, 0) < value(0, 1)
