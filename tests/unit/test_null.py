"""A regressor that learnt nothing, through the same correction as the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vermilion.baselines.null import null_model
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, correct
from vermilion.correction.neutral_pair import NeutralPair, with_known_neutrals

from .evaluation_face import mouth_triangles, sheet_face

NAMES = ("shape_01", "outer_width")
SETTINGS = CorrectionSettings(
    seam_mm=16.0, detail_mm=15.0, smooth_frames=2, fade_power=0.0, image=None
)


@pytest.fixture(scope="module")
def face():
    return sheet_face()


@pytest.fixture(scope="module")
def take(face):
    """Five frames of a jaw that opens."""
    coarse = np.repeat(face.neutral_mm[None], 5, axis=0)
    below = (face.neutral_mm[:, 1] < -0.5) & (np.hypot(*face.neutral_mm[:, :2].T) < 25)
    coarse[:, below, 1] -= np.arange(5.0)[:, None]
    return CoarseTake(
        frames=np.arange(5), coarse_mm=coarse, triangles=face.triangles, neutral_mm=face.neutral_mm,
        rotation=np.tile(np.eye(3), (5, 1, 1)), translation_mm=np.zeros((5, 3)),
        features=np.random.default_rng(0).normal(size=(5, 2)), valid=np.ones(5, dtype=bool),
    )  # fmt: skip


def bulging(face, height_mm):
    """The neutral with lips further out."""
    x, y, _ = face.neutral_mm.T
    bulge = height_mm * np.exp(-(x**2 + y**2) / 12.0**2)
    return face.neutral_mm + bulge[:, None] * np.array([0.0, 0.0, 1.0])


def test_untold_it_leaves_the_track_as_it_is(face, take):
    model = null_model(face.triangles, mouth_triangles(face), NAMES)
    corrected = correct(model, take, replace(SETTINGS, detail_mm=0.0))
    assert np.abs(corrected - take.coarse_mm).max() < 1e-4


def test_told_a_neutral_it_corrects_that_and_every_frame_by_as_much(face, take):
    mask = mouth_triangles(face)
    true = bulging(face, 2.0)
    pair = NeutralPair(
        "eva", "phone", face.neutral_mm, true, take.features[0], np.array(NAMES), face.neutral_mm
    )
    model = with_known_neutrals(null_model(face.triangles, mask, NAMES), face.triangles, None, pair)
    corrected = correct(model, take, SETTINGS)
    inside = np.hypot(*face.neutral_mm[:, :2].T) < 15
    before = np.linalg.norm(face.neutral_mm - true, axis=1)[inside]
    assert np.linalg.norm(corrected[0] - true, axis=1)[inside].max() < 0.1 * before.max()
    added = corrected - take.coarse_mm
    # Features differ from frame to frame, what is added does not, but for turned triangles.
    assert np.abs(added - added[0])[:, inside].mean() < 0.1 * np.abs(added[0][inside]).mean()
    other = replace(take, features=take.features[::-1])
    np.testing.assert_array_equal(correct(model, other, SETTINGS), corrected)
