"""A known person on known images: what images add to landmarks that are off."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.unit.image_fit_scene import CAMERA, dome, image_of, mesh_of, motion
from vermilion.appearance.samples import sample_skin
from vermilion.tracking.identity.colour_residuals import IdentityImageSettings
from vermilion.tracking.identity.joint_identity import _JointProblem, fit_joint_identity
from vermilion.tracking.identity.landmark_identity import (
    IdentityProblem,
    IdentitySettings,
    TakeSample,
)
from vermilion.tracking.image_fit.residual import photometric_residual
from vermilion.tracking.landmark_fit.expression import LandmarkFitSettings
from vermilion.tracking.landmark_fit.observation import LandmarkNoise, Observations, focal_px

PERSON = np.array([1.3, -1.0])
N_FRAMES = 5


def model_with_identities():
    """The dome, with two people-to-people differences: one side, and the chin, further out."""
    model = dome()
    x, y = model.neutral_mm[:, 0], model.neutral_mm[:, 1]
    shapes = [
        np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * 18.0**2))[:, None] * [0.0, 0.0, 7.0]
        for cx, cy in ((-25, 10), (15, -25))
    ]
    return replace(model, identities_mm=np.array(shapes, dtype=np.float32))


@cache
def seen_person():
    """(model, meshes, images) of the person."""
    model = model_with_identities()
    offsets = np.tensordot(PERSON, model.identities_mm, axes=1)
    truth = motion(3 * N_FRAMES)[::3]
    truth[0, 6:] = 0.0
    meshes = [mesh_of(model, row, offsets) for row in truth]
    return model, meshes, [image_of(model, mesh) for mesh in meshes]


def scene(noise_px=3.0):
    """(model, problem, images): landmarks of a person, off by the same in every frame."""
    model, meshes, images = seen_person()
    points = np.stack([CAMERA.project(mesh[model.landmarks]) for mesh in meshes])
    points += noise_px * np.random.default_rng(3).normal(size=(1, 66, 2))
    centre = CAMERA.calibration[:2, 2]
    seen = Observations(points - centre, np.ones((N_FRAMES, 66)), np.ones(N_FRAMES, dtype=bool))
    sample = TakeSample("t", seen, focal_px(CAMERA), True, np.arange(N_FRAMES) == 0)
    loose = LandmarkNoise(0.05, 0.05, 0.05, 0.05, 0.05)
    settings = IdentitySettings(
        fit=LandmarkFitSettings(noise=loose, jaw_slide=1.0),
        bias=LandmarkNoise(0.2, 0.2, 0.2, 0.2, 0.2),
    )
    return model, IdentityProblem(model, [sample], settings), images


@pytest.fixture(scope="module")
def fitted():
    model, problem, images = scene()
    settings = IdentityImageSettings(
        spacing_mm=5.0, pixel_mm=2.0, strength=1000.0, albedo_prior=0.05
    )
    joint = fit_joint_identity(model, problem, images, [CAMERA] * N_FRAMES, settings)
    return model, problem, joint


def test_images_bring_the_person_nearer_than_landmarks_that_are_off(fitted):
    _, problem, joint = fitted
    landmarks = problem.result(*problem.solve()).identity
    assert np.abs(landmarks - PERSON).max() > 0.5  # else there is nothing to mend
    assert np.abs(joint.person.identity - PERSON).max() < 0.35


def test_every_frame_is_explained_better(fitted):
    for before, after in fitted[2].residuals:
        assert photometric_residual(*after[:2]) < 0.8 * photometric_residual(*before[:2])


def test_a_step_goes_downhill_all_the_way():
    model, problem, images = scene()
    frames, shared = problem.solve()
    settings = IdentityImageSettings(spacing_mm=5.0, pixel_mm=2.0, strength=300.0)
    held = _JointProblem(
        model, problem, sample_skin(model, 5.0), images, [CAMERA] * N_FRAMES, settings, frames,
        shared,
    )  # fmt: skip
    step_frames, step_shared = held.newton_step(frames, shared)
    before = held.cost(frames, shared)
    little = held.cost(frames + 0.02 * step_frames, shared + 0.02 * step_shared)
    whole = held.cost(frames + step_frames, shared + step_shared)
    assert little < before
    assert whole < little


def test_no_weight_of_the_images_is_the_landmark_fit():
    model, problem, images = scene()
    plain = problem.result(*problem.solve())
    off = IdentityImageSettings(spacing_mm=5.0, pixel_mm=2.0, strength=0.0, rounds=1)
    joint = fit_joint_identity(model, problem, images, [CAMERA] * N_FRAMES, off)
    assert np.abs(joint.person.identity - plain.identity).max() < 0.02
