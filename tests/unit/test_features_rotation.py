"""Distances in the head frame do not change when the head turns; those in the image do (Lips16 7)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.unit.mouths import crest, ellipse, facing_camera, mouth_model
from vermilion.features.contour_features import ContourSampler
from vermilion.features.distances import NAMES
from vermilion.features.search import SearchSettings

PX_A_MM = 1.6
SIZE = (320, 320)
CAMERA = facing_camera(scale=PX_A_MM, size=SIZE)
TURNS = {"yaw": ("y", 25), "other yaw": ("y", -25), "pitch": ("x", 15), "other pitch": ("x", -15)}


def on_dental_arch(points):
    """(n, 3) of (n, 2) mm on a surface that curves back to the sides, as lips do on the teeth."""
    return np.column_stack([points, -(points[:, 0] ** 2) / 150])


def true_mouth(opening, height, width):
    """Rings (inner, outer) on the arch, (n, 3) mm."""
    centre, middle = (120.0, 150.0), np.array([120.0, 120.0])
    rings = (ellipse(centre, 0.75 * width, opening, 2000), ellipse(centre, width, height, 2000))
    return [on_dental_arch((ring - middle) * [1, -1]) for ring in rings]


def coarse_model():
    """A coarse mouth that is too low and too narrow, on the same arch."""
    model = mouth_model(6.0, 22.0, 49.0)
    return replace(model, neutral_mm=on_dental_arch(model.neutral_mm[:, :2]))


@cache
def distances(mouth, axis="x", degrees=0):
    """Space -> the twenty distances of a mouth whose head has turned about an axis."""
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    rings = [CAMERA.project(ring @ turn.T) for ring in true_mouth(*mouth)]
    maps = [crest(ring, SIZE, 1.5 * PX_A_MM) for ring in rings]
    model = coarse_model()
    sampler = ContourSampler.of(model, 80, SearchSettings())
    found = {}
    for space, pose in (("head", (turn, np.zeros(3))), ("image", None)):
        contours = sampler.find(model.neutral_mm @ turn.T, CAMERA, maps, pose)
        assert contours.outer_found.mean() > 0.9
        found[space] = contours.distances
    return found


@pytest.mark.parametrize("mouth", [(9.0, 26.0, 52.0), (16.0, 30.0, 44.0)], ids=["open", "rounded"])
@pytest.mark.parametrize("turn", TURNS)
def test_a_turn_of_the_head_changes_no_distance_in_the_head_frame(turn, mouth):
    facing, seen = distances(mouth), distances(mouth, *TURNS[turn])
    # Lips of a few pixels are measured to a fifth of a pixel, not to a share of their width.
    change = {s: np.abs(seen[s] - facing[s]) / np.maximum(facing[s], 0.1) for s in seen}
    assert change["head"].max() < 0.02, dict(zip(NAMES, change["head"].round(3), strict=True))
    assert change["image"].max() > 2 * change["head"].max()


def test_facing_the_camera_both_spaces_agree_but_for_perspective():
    found = distances((9.0, 26.0, 52.0))
    np.testing.assert_allclose(found["head"], found["image"], rtol=0.06, atol=0.003)
