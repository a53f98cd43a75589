"""Constraints of neighbouring frames solved together: one system, no lag, less noise."""

import numpy as np
import pytest

from vermilion.config.correction import CorrectionConfig
from vermilion.correction.coherent_constraints import coherent_pushes, frame_correlation
from vermilion.correction.constraints import ConstraintSolver, LinearConstraints

from .test_image_contours import integrator

SOLID = integrator()
VERTICES = SOLID.free[:: len(SOLID.free) // 12]
SOLVER = ConstraintSolver(SOLID, VERTICES)
FRAMES = np.arange(30)


def rows(targets_mm, vertices=VERTICES[:4], compliance=0.5, one_sided=False):
    """Each of some vertices is asked to move up."""
    n = len(vertices)
    return LinearConstraints(
        np.asarray(vertices)[:, None], np.ones((n, 1)), np.tile([0.0, 1.0, 0.0], (n, 1)),
        np.asarray(targets_mm, dtype=float) * np.ones(n), np.full(n, compliance),
        np.full(n, one_sided),
    )  # fmt: skip


def heights(constraints, reach, frames=FRAMES):
    """(F, 4) mm that the first vertices move up."""
    pushes = coherent_pushes(SOLVER, constraints, frame_correlation(frames, reach))
    return np.stack([SOLVER.displacements_at(VERTICES[:4], p)[:, 1] for p in pushes])


def jitter(values):
    return np.sqrt((np.diff(values, n=2, axis=0) ** 2).mean())


def test_the_result_is_that_of_the_whole_dense_system():
    rng = np.random.default_rng(0)
    frames = np.delete(np.arange(11), [3, 7])
    asked = [rows(rng.normal(size=k), VERTICES[:k]) for k in rng.integers(1, 6, len(frames))]
    correlation = frame_correlation(frames, 5)
    place = np.repeat(np.arange(len(frames)), [len(a) for a in asked])
    response = np.block([[SOLVER.response(a, b) for b in asked] for a in asked])
    system = response * correlation[np.ix_(place, place)]
    system += np.diag(np.concatenate([a.compliance for a in asked]))
    forces = np.linalg.solve(system, np.concatenate([a.target_mm for a in asked]))
    expected = [
        sum(
            c * SOLVER.pushes(a, forces[place == g])
            for g, (c, a) in enumerate(zip(row, asked, strict=True))
        )
        for row in correlation
    ]
    found = coherent_pushes(SOLVER, asked, correlation)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_without_reach_each_frame_is_solved_by_itself():
    asked = [rows(t) for t in np.random.default_rng(1).normal(size=(30, 4))]
    alone = [
        SOLVER.displacements_at(VERTICES[:4], SOLVER.pushes(a, SOLVER.forces(a)))[:, 1]
        for a in asked
    ]
    np.testing.assert_allclose(heights(asked, 0), alone, atol=1e-9)


def test_what_trembles_is_stilled_and_what_moves_comes_through_without_lag():
    rng = np.random.default_rng(2)
    # At 30 frames a second lips part by 4 mm and close again in a third of a second.
    true = 4.0 * np.exp(-0.5 * ((FRAMES - 15.0) / 2.5) ** 2)
    noise = rng.normal(scale=0.3, size=(len(FRAMES), 4))
    asked = [rows(t + n, compliance=0.2) for t, n in zip(true, noise, strict=True)]
    alone, together = (heights(asked, reach) for reach in (0, 6))
    assert jitter(together - true[:, None]) < 0.4 * jitter(alone - true[:, None])
    errors = [np.abs(h - true[:, None]).mean() for h in (alone, together)]
    assert errors[1] < errors[0]
    still, by_itself = (
        heights([rows(t, compliance=0.2) for t in true], reach).mean(axis=1) for reach in (6, 0)
    )
    # What neighbours agree on counts more than what a frame says by itself.
    assert still.argmax() == 15 and still.max() > max(3.7, by_itself.max())
    np.testing.assert_allclose(still[5:26], still[5:26][::-1], atol=1e-6)


def test_a_one_sided_constraint_never_pulls_whatever_its_neighbours_ask():
    asked = [rows(1.0) for _ in FRAMES]
    asked[10] = rows(-1.0, one_sided=True) + rows(1.0)
    np.testing.assert_allclose(
        heights(asked, 6), heights([rows(1.0) for _ in FRAMES], 6), atol=1e-6
    )


def test_nothing_reaches_across_a_cut_or_further_than_the_reach():
    assert (frame_correlation(np.array([0, 6]), 6) == np.eye(2)).all()
    asked = [rows(5.0 if f < 15 else 0.0) for f in FRAMES]
    apart = np.where(FRAMES < 15, FRAMES, FRAMES + 1000)
    assert np.abs(heights(asked, 6, apart)[15:]).max() < 1e-9


def test_frames_without_constraints_follow_their_neighbours():
    asked = [rows(1.0) if f % 4 else rows(np.zeros(0), VERTICES[:0]) for f in FRAMES]
    moved = heights(asked, 6)
    assert moved[8:24].min() > 0.8 * moved[8:24].max()


@pytest.mark.parametrize(("fps", "frames"), [(10, 2), (30, 6), (60, 12), (240, 12)])
def test_the_coherence_is_a_time_of_at_most_twelve_frames(fps, frames):
    assert CorrectionConfig().image.at(fps)["coherence_frames"] == frames
