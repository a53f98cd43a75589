"""Which frames of a coarse take are corrected, and that the others stay as they are."""

from __future__ import annotations

import numpy as np
import pytest

from tests import lip_patch
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, correct_with_layers

FACE = lip_patch.face_model()
MASK = np.flatnonzero((FACE.triangles < 22 * lip_patch.COLUMNS).all(axis=1))
SETTINGS = CorrectionSettings(
    seam_mm=0.0, detail_mm=0.0, smooth_frames=0, fade_power=0.0, image=None
)
LOST, BROKEN, BLIND = 1, 2, 3


@pytest.fixture
def take():
    """Five frames: one that was not tracked, one with a broken mesh, one without features."""
    meshes = np.tile(lip_patch.vertices_at(1.0, 0.0), (5, 1, 1))
    meshes[BROKEN, 7] = np.nan
    features = np.zeros((5, 3))
    features[BLIND, 1] = np.nan
    return CoarseTake(
        np.arange(10, 15), meshes, FACE.triangles, FACE.neutral_mm, np.tile(np.eye(3), (5, 1, 1)),
        np.zeros((5, 3)), features, np.arange(5) != LOST,
    )  # fmt: skip


def test_a_frame_is_usable_when_tracked_with_a_finite_mesh_and_finite_inputs(take):
    assert take.usable(take.features).tolist() == [True, False, False, False, True]
    assert take.usable(np.zeros((5, 2, 9))).tolist() == [True, False, False, True, True]


def test_frames_that_are_not_usable_stay_as_they_are(take):
    layers = np.random.default_rng(0).normal(scale=0.05, size=(5, len(MASK), 9))
    corrected = correct_with_layers(MASK, layers, None, take, SETTINGS)
    moved_mm = np.abs(corrected - take.coarse_mm).max(axis=(1, 2))
    assert moved_mm[LOST] == 0.0
    np.testing.assert_array_equal(corrected[BROKEN], take.coarse_mm[BROKEN])
    assert moved_mm[[0, BLIND, 4]].min() > 0.01


def test_rows_of_a_take_are_corrected_as_in_the_whole(take):
    layers = np.random.default_rng(0).normal(scale=0.05, size=(5, len(MASK), 9))
    rows = np.array([0, 3, 4])
    part = correct_with_layers(MASK, layers[rows], None, take[rows], SETTINGS)
    assert np.array_equal(part, correct_with_layers(MASK, layers, None, take, SETTINGS)[rows])
    assert take[rows].frames.tolist() == [10, 13, 14]
    assert take[take.valid].frames.tolist() == [10, 12, 13, 14]
