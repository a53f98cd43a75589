"""The benchmark of an unseen person: registration to the truth's neutral, and errors that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.unseen_subject import UnseenSubjectTruth, figures, parts
from tests.heads import small_tracker
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.correspondence.correspondence import CorrespondenceSettings
from vermilion.correspondence.neutral import model_mouth_mask
from vermilion.evaluation.masks import regions_of_mask
from vermilion.evaluation.reference import MatchTolerance
from vermilion.scan.landmarks import ScanLandmarks

N_FRAMES = 8
PHASE = 2 * np.pi * np.arange(N_FRAMES) / N_FRAMES
#: Of the person's neutral from the head frame, and of each frame from the neutral.
TO_WORLD = Rotation.from_euler("yx", [20, 5], degrees=True).as_matrix()
TURNS = Rotation.from_rotvec(np.outer(15 * np.sin(PHASE), [0, 1, 0]), degrees=True).as_matrix()


@pytest.fixture(scope="module")
def model():
    return small_tracker()


@pytest.fixture(scope="module")
def neutral(model):
    """Somebody outside the model's identities, (V, 3) mm, in a world of its own."""
    shape = model.neutral_of(np.array([0.8, -0.5, 0.6, 0.3]))
    x, y, _ = shape.T
    wave = np.stack([np.sin(y / 35), np.cos(x / 40 + 1), np.sin((x + y) / 45)], axis=1)
    return (shape + 2.5 * wave) @ TO_WORLD.T + [30.0, -20.0, 400.0]


@pytest.fixture(scope="module")
def reference(model, neutral):
    """Frames of that person: smiles that come and go, the head turning."""
    smile = model.expressions_mm[model.expression_names.index("mouthSmile_L")]
    shapes = neutral + (0.5 - 0.5 * np.cos(PHASE))[:, None, None] * (smile @ TO_WORLD.T)
    frames = shapes @ np.swapaxes(TURNS, 1, 2)
    landmarks = ScanLandmarks(neutral[model.landmarks], np.zeros(66))
    truth = UnseenSubjectTruth(neutral, frames, model.triangles, landmarks)
    return truth.reference(model, 0.09, MatchTolerance(6.0, 60.0)), frames


@pytest.fixture(scope="module")
def regions(model):
    options = CorrespondenceConfig().model_dump(exclude={"landmarks"})
    mask = model_mouth_mask(model, model.neutral_mm, CorrespondenceSettings(**options))
    return regions_of_mask(model, model.neutral_mm, mask)


def moved(sequence):
    """The same in another world, (F, V, 3)."""
    turn = Rotation.from_euler("xyz", [10, -30, 5], degrees=True).as_matrix()
    return sequence @ turn.T + [5.0, 7.0, -300.0]


def test_vertices_find_their_points_of_the_truth(model, reference):
    against, frames = reference
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    away_mm = np.linalg.norm(against.points_mm - frames, axis=2)[:, lips & against.valid]
    assert np.median(away_mm) < 1.0


def test_the_truth_itself_has_no_error(model, reference, regions):
    track = moved(reference[0].points_mm)
    track = np.where(np.isfinite(track), track, 0.0)
    (row,) = figures({"base": track}, np.arange(N_FRAMES), model, regions, reference[0])
    for name in ("motion", "mouth", "mouth_own", "lip_shape"):
        assert row[name] == pytest.approx(0.0, abs=1e-6), name
    # The truth's gap is that of its own surface, a coarse mesh on it has one of its own.
    assert row["opening"] < 0.4
    (part,) = parts({"base": track}, model, regions, reference[0])
    assert part["size"] == pytest.approx(1.0, abs=1e-9)
    assert part["motion"] == pytest.approx(0.0, abs=1e-6)


def test_lips_that_swing_and_a_size_are_told_apart(model, reference, regions):
    against = reference[0]
    lips = regions.weights["mouth"] > 0
    swing = np.where(np.arange(N_FRAMES) % 2, 1.0, -1.0)
    across = (TURNS @ TO_WORLD[:, 0])[:, None] * swing[:, None, None]
    track = np.where(lips[:, None], against.points_mm + across, against.points_mm)
    track = 1.05 * np.where(np.isfinite(track), track, 0.0)
    (part,) = parts({"base": track}, model, regions, against)
    assert part["size"] == pytest.approx(1 / 1.05, abs=5e-3)
    assert part["motion_sized"] == pytest.approx(1.0, abs=0.1)
    assert part["across"] == pytest.approx(1.0, abs=0.1)
    assert part["depth"] < 0.2 and part["motion_own"] < 0.2
