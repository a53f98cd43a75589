"""The mouth opening of one image, and what it is looked for with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class OpeningSettings:
    """How the inner contours of the lips are found in the image.

    Attributes:
        reach_mm: how far a contour may lie from the mesh's.
        step_mm: spacing of the grid, but no finer than half a pixel.
        clear_mm: lips closer than this to the mesh's contour, or to the corners of the mouth, give no
            samples of the tattoo's colours.
        inside_mm: the inside of the mouth closer than this to the mesh's contour gives no samples.
        black, teeth: weights of black and of the colours of teeth among the colours of the inside,
            beside the samples of this image (1).
        unlike: share of the inside that may have any colour.
        sure: log ratio of likelihoods at which the score reaches 1.
        prior: cost of a contour one millimetre off the mesh's, in grid points of score 1.
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
        """Column and row, both (...,), of places `pixels` (..., 2) of the image."""
        steps = np.linalg.inv(np.stack([self.along_px, self.across_px], axis=1))
        column, row = np.moveaxis((pixels - self.origin_px) @ steps.T, -1, 0)
        return column, row

    def place(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Image coordinates (..., 2) of columns `column` (...,) and rows `row` (...,)."""
        return self.origin_px + column[..., None] * self.along_px + row[..., None] * self.across_px

    def rows(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Where places `pixels` (..., 2) lie between the contours.

        Returns:
            (row, row of the upper contour, row of the lower contour, between the corners of the
            mouth), each (...,).
        """
        column, row = self.coordinates(pixels)
        there = (column >= self.columns[0]) & (column <= self.columns[-1])
        upper, lower = (np.interp(column, self.columns, edge) for edge in (self.upper, self.lower))
        return row, upper, lower, there

    def inside_and_near(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether places `pixels` (..., 2) lie in the opening, and within reach of it.

        Both (...,) bool; places beyond the corners of the mouth are neither.
        """
        row, upper, lower, there = self.rows(pixels)
        reach = self.reach_mm / self.pixel_mm / np.linalg.norm(self.across_px)
        inside = there & (row > upper) & (row < lower)
        return inside, there & (row > upper - reach) & (row < lower + reach)


@dataclass(frozen=True)
class MouthPlace:
    """Where the mesh has the mouth in an image.

    Attributes:
        axis: (2,) unit direction along the mouth, px.
        low_px, high_px: (2,) corners of a rectangle round the lips.
        pixel_mm: size of a pixel on the lips.
    """

    axis: np.ndarray
    low_px: np.ndarray
    high_px: np.ndarray
    pixel_mm: float
