"""The inner lips carried by flow beside them, as teeth appear."""

from itertools import pairwise

import cv2
import numpy as np

from vermilion.landmarks.flow import FaceFlow, carry_along
from vermilion.landmarks.lip_side import off_lips, onto_lips
from vermilion.landmarks.scheme import LIP_INNER_OPEN, LIP_OUTER_FACING, MIRROR, N_LANDMARKS

LIP_TOP, LIP_PX, STEP_PX, N_FRAMES = 160, 24, 3, 9


def opening_mouth():
    """A lower lip that sinks from the seam, teeth behind it; landmarks of the lower lip."""
    rng = np.random.default_rng(4)

    def texture(sigma, mean):
        noise = cv2.GaussianBlur(rng.normal(size=(320, 300)), (0, 0), sigma)
        return (mean + 0.08 * noise / noise.std()).astype(np.float32)

    face, lips, teeth = texture(2.0, 0.55), texture(2.0, 0.35), texture(2.0, 0.85)
    rows = np.arange(320)[:, None]
    greys, truth = [], []
    points = rng.uniform(20, 280, size=(N_LANDMARKS, 2))
    points[0], points[1] = (20, 20), (280, 300)
    for frame in range(N_FRAMES):
        down = frame * STEP_PX
        top = LIP_TOP + down
        grey = np.where(rows < LIP_TOP, face, teeth)
        grey = np.where(rows >= top, np.roll(lips, down, axis=0), grey)
        grey = np.where(rows >= top + LIP_PX, np.roll(face, down, axis=0), grey)
        greys.append(grey)
        moved = points.copy()
        moved[LIP_INNER_OPEN[3:]] = [(170, top), (150, top), (130, top)]
        moved[LIP_OUTER_FACING[3:]] = moved[LIP_INNER_OPEN[3:]] + [0, LIP_PX]
        truth.append(moved)
    return greys, np.array(truth)


def test_the_two_moves_undo_each_other_and_only_the_inner_lips_move():
    points = np.random.default_rng(0).normal(size=(3, N_LANDMARKS, 2))
    moved = onto_lips(points)
    assert np.allclose(off_lips(moved), points)
    still = np.setdiff1d(np.arange(N_LANDMARKS), LIP_INNER_OPEN)
    assert np.array_equal(moved[:, still], points[:, still])
    assert (moved[:, LIP_INNER_OPEN] != points[:, LIP_INNER_OPEN]).all()


def test_points_across_the_lip_are_each_others_in_a_mirror():
    mirrored = dict(zip(MIRROR[LIP_INNER_OPEN], MIRROR[LIP_OUTER_FACING], strict=True))
    assert mirrored == dict(zip(LIP_INNER_OPEN, LIP_OUTER_FACING, strict=True))


def test_the_inner_lip_does_not_stay_on_the_teeth():
    greys, truth = opening_mouth()
    engine = FaceFlow(200.0)
    flows = [
        engine.between(a, b, truth[k], truth[k + 1]) for k, (a, b) in enumerate(pairwise(greys))
    ]
    lower = LIP_INNER_OPEN[3:]
    paper = carry_along(flows, truth[0])[0][-1]
    beside = off_lips(carry_along(flows, onto_lips(truth[0]))[0])[-1]
    opened_px = STEP_PX * (N_FRAMES - 1)
    left_behind, error = (np.linalg.norm(p - truth[-1], axis=1)[lower] for p in (paper, beside))
    assert left_behind.mean() > 0.2 * opened_px  # the reason for all this
    assert error.max() < 2.0
