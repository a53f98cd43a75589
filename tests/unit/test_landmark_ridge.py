"""Contours from landmarks alone, on drawn mouths that landmark detectors get wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.unit.mouths import draw_mouth, ellipse
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.imaging.images import linear_to_srgb, srgb_to_linear

TONGUE = (0.55, 0.27, 0.30)
INNER = np.arange(59, 66)


def crest_px(likelihood, line, reach=120):
    """Mean distance of the map's crest, its likeliest pixels, to a contour.

    `reach` px from the middle to the side; the drawn opening ends short of the mouth's corners.
    """
    rows, columns = np.nonzero(likelihood > 0.8 * likelihood.max())
    rows, columns = rows[np.abs(columns - 120) < reach], columns[np.abs(columns - 120) < reach]
    assert len(rows) > 60
    return cKDTree(line.dense()).query(np.stack([columns, rows], axis=1) + 0.5)[0].mean()


def test_inner_landmarks_on_the_lips_do_not_hold_the_contour():
    image, landmarks, label = draw_mouth(9.0, 28.0, seed=3)
    centre = landmarks[48:66].mean(axis=0)
    landmarks[INNER] = centre + (landmarks[INNER] - centre) * [1.0, 1.8]  # 7 px too far apart
    inner, outer = LandmarkRidgeDetector().likelihood(image, landmarks)
    assert crest_px(outer, label.outer) < 1.0
    middle = np.abs(label.inner.points_px[:, 0] - 120) < 25
    points = label.inner.points_px[middle]
    rows, columns = (np.floor(points[:, k]).astype(int) for k in (1, 0))
    assert inner[rows, columns].mean() > 0.5


def test_a_closed_mouth_is_its_dark_line_though_the_upper_lip_is_in_shade():
    image, landmarks, label = draw_mouth(0.6, 22.0, seed=4)
    y = np.arange(240)[:, None, None] + 0.5
    shade = 1 - 0.45 * np.clip((y - 132) / 18, 0, 1) * (
        y < 150
    )  # darker towards the seam, then bright
    landmarks[INNER, 1] -= 3.0
    inner, _ = LandmarkRidgeDetector().likelihood(image * shade, landmarks)
    assert crest_px(inner, label.inner) < 1.5


@pytest.mark.parametrize("height", [0.01, 0.5, 0.8], ids=["no tongue", "low", "high"])
def test_a_tongue_between_the_lips_is_not_lip(height):
    image, landmarks, label = draw_mouth(11.0, 28.0, seed=5)
    x, y = np.meshgrid(np.arange(240) + 0.5, np.arange(240) + 0.5)
    tongue = ((x - 120) / 24) ** 2 + ((y - 153) / (11 * height)) ** 2 < 1
    inside = ((x - 120) / 39) ** 2 + ((y - 150) / 10.5) ** 2 < 1
    shown = linear_to_srgb(image)
    shown[tongue & inside] = np.asarray(TONGUE) + 0.01 * np.random.default_rng(0).standard_normal(
        (int((tongue & inside).sum()), 3)
    )
    inner, outer = LandmarkRidgeDetector().likelihood(srgb_to_linear(shown), landmarks)
    assert crest_px(inner, label.inner, 30) < 1.3  # 0.5 of it is the ridge's own width
    assert crest_px(outer, label.outer) < 1.0


def test_the_drawn_tongue_lies_inside_the_mouth():
    reach = ellipse((120.0, 153.0), 24.0, 8.8)
    assert (((reach - [120, 150]) / [39, 13]) ** 2).sum(axis=1).max() < 1.0
