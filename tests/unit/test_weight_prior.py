"""Deviations of blend weights: rare shapes are small, lids are free, and both follow the usual one."""

import numpy as np

from vermilion.tracking.landmark_fit.expression import LandmarkFitSettings
from vermilion.tracking.landmark_fit.weight_prior import weight_sigmas

NAMES = (
    "jawOpen",
    "eyeBlink_L",
    "mouthLeft",
    "jawRight",
    "mouthRollLower",
    "cheekPuff_L",
    "mouthSmile_L",
)


def test_each_kind_of_shape_has_its_deviation():
    found = weight_sigmas(NAMES, len(NAMES), LandmarkFitSettings())
    np.testing.assert_allclose(found, [0.5, 1.0, 0.1, 0.1, 0.2, 0.2, 0.5])


def test_a_wide_prior_is_wide_for_all():
    found = LandmarkFitSettings(weight_sigma=100.0).weight_sigmas(NAMES, len(NAMES))
    assert found.min() == 20.0 and found[1] == 100.0


def test_shapes_without_names_are_alike():
    np.testing.assert_array_equal(LandmarkFitSettings().weight_sigmas((), 4), np.full(4, 0.5))
