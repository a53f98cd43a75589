"""Refinement of a rig over tracks: on known points, and on images with known cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vermilion.capture.bundle_adjust import align_to_given
from vermilion.capture.refine import refine_cameras
from vermilion.capture.rig_poses import RigRefinementSettings
from vermilion.capture.tracks import FeatureMatchSettings, Features
from vermilion.geometry.camera import Camera, look_at

UP = np.array([0.0, -1.0, 0.0])


@pytest.fixture(scope="module")
def rig() -> dict[str, Camera]:
    """Five cameras of three models on an arc, two of them close-ups."""
    models = [
        ("PINHOLE", (1600.0, 1600.0, 256.0, 320.0), 512, 640),
        ("OPENCV", (1600.0, 1610.0, 256.0, 320.0, -0.1, 0.05, 0.001, 0.0), 512, 640),
        ("SIMPLE_RADIAL", (1600.0, 256.0, 320.0, -0.05), 512, 640),
        ("PINHOLE", (3300.0, 3300.0, 320.0, 240.0), 640, 480),
        ("PINHOLE", (3300.0, 3300.0, 320.0, 240.0), 640, 480),
    ]
    places = [(-380, 20, -640), (0, 60, -740), (380, -20, -640), (-90, 190, -690), (90, -190, -690)]
    return {
        f"cam{i}": Camera(
            f"cam{i}", *models[i], look_at(np.array(places[i], float), np.zeros(3), UP)
        )
        for i in range(5)
    }


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    """Points on a dome of the size of a face, denser in the middle."""
    rng = np.random.default_rng(0)
    xy = np.concatenate([rng.uniform(-70, 70, (180, 2)), rng.uniform(-28, 28, (120, 2))])
    depth = (xy**2).sum(axis=1) / 130 + rng.uniform(-4, 4, len(xy))
    return np.concatenate([xy, depth[:, None]], axis=1)


def images_of(rig, points, noise_px: float, seed: int = 0) -> dict:
    """What each camera sees of the points: features whose descriptors name the point."""
    rng = np.random.default_rng(seed)
    names = rng.normal(size=(len(points), 128)).astype(np.float32)
    names /= np.linalg.norm(names, axis=1, keepdims=True)
    views = {}
    for name, camera in rig.items():
        pixels = camera.project(points)
        seen = camera.in_image(pixels, 2.0) & (rng.random(len(points)) < 0.8)
        order = rng.permutation(np.flatnonzero(seen))
        pixels = pixels[order] + rng.normal(0, noise_px, (len(order), 2))
        views[name] = Features(pixels, names[order])
    return {0: views}


def perturbed(rig, turn_deg: float = 0.3, shift_mm: float = 1.0, seed: int = 3) -> dict:
    """Each camera turned about its centre by an angle and moved by a distance, at random."""
    rng, moved = np.random.default_rng(seed), {}
    for name, camera in rig.items():
        axis, way = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        rotation = Rotation.from_rotvec(np.radians(turn_deg) * axis).as_matrix() @ camera.rotation
        centre = camera.centre_mm + shift_mm * way
        pose = np.concatenate([rotation, (-rotation @ centre)[:, None]], axis=1)
        moved[name] = replace(camera, cam_from_world=pose)
    return moved


def true_error_px(true, other, points) -> float:
    """RMS distance between projections of true points, after the best rigid motion of the world."""
    sees = {n: c.in_image(c.project(points)) for n, c in true.items()}

    def misfit(x):
        turned = Rotation.from_rotvec(x[:3]).apply(points) + x[3:]
        differences = [
            other[n].project(turned[sees[n]]) - c.project(points[sees[n]]) for n, c in true.items()
        ]
        return np.concatenate(differences).ravel()

    x = least_squares(misfit, np.zeros(6), x_scale=[1e-3] * 3 + [1.0] * 3).x
    return float(np.sqrt((misfit(x).reshape(-1, 2) ** 2).sum(axis=1).mean()))


def test_poses_off_by_a_third_of_a_degree_and_a_millimetre_are_recovered(rig, points):
    given = perturbed(rig)
    made = refine_cameras(
        given, images_of(rig, points, 0.1), FeatureMatchSettings(), RigRefinementSettings()
    )
    assert made.applied
    assert true_error_px(rig, given, points) > 5.0
    assert true_error_px(rig, made.cameras, points) < 0.2
    assert made.after_px["median"] < 0.2 < 2.0 < made.before_px["median"]
    again = refine_cameras(
        given, images_of(rig, points, 0.1), FeatureMatchSettings(), RigRefinementSettings()
    )
    for name, camera in made.cameras.items():
        assert np.array_equal(camera.cam_from_world, again.cameras[name].cam_from_world)
        assert camera.params == given[name].params


def test_exact_cameras_are_left_alone(rig, points):
    made = refine_cameras(
        rig, images_of(rig, points, 0.3), FeatureMatchSettings(), RigRefinementSettings()
    )
    assert not made.applied and "are good" in made.reason
    assert all(made.cameras[name] is camera for name, camera in rig.items())


def test_exact_cameras_are_not_replaced_even_when_refinement_is_asked_for(rig, points):
    images = images_of(rig, points, 0.3)
    made = refine_cameras(
        rig, images, FeatureMatchSettings(), RigRefinementSettings(), only_if_off=False
    )
    assert not made.applied and "no clear gain" in made.reason


def test_too_few_features_say_so(rig, points):
    made = refine_cameras(
        perturbed(rig),
        images_of(rig, points[:40], 0.1),
        FeatureMatchSettings(),
        RigRefinementSettings(),
    )
    assert not made.applied and "at least 100 are needed" in made.reason


def test_a_rig_laid_onto_another_takes_its_place_and_size(rig):
    turn = Rotation.from_rotvec([0.02, -0.05, 0.03]).as_matrix()
    moved = {}
    for name, camera in rig.items():
        centre = 1.01 * turn @ camera.centre_mm + [5.0, -3.0, 8.0]
        rotation = camera.rotation @ turn.T
        pose = np.concatenate([rotation, (-rotation @ centre)[:, None]], axis=1)
        moved[name] = replace(camera, cam_from_world=pose)
    laid = align_to_given(rig, moved, 0.3, 1.0)
    for name, camera in rig.items():
        assert np.abs(laid[name].centre_mm - camera.centre_mm).max() < 1e-4  # mm
        assert np.abs(laid[name].rotation - camera.rotation).max() < 1e-7
