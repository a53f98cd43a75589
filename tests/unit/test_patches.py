"""Least-squares matching of surface patches: pixels against known geometry."""

import cv2
import numpy as np
import pytest

from vermilion.capture.patches import align_patches
from vermilion.capture.tracks import Tracks
from vermilion.geometry.camera import look_at, pinhole

NORMAL = np.array([0.2, -0.1, 1.0]) / np.linalg.norm([0.2, -0.1, 1.0])
UP = np.array([0.0, 1.0, 0.0])


def on_plane(camera, pixels):
    """Where rays meet the plane through the world's origin, (N, 3) mm."""
    origins, directions = camera.rays(pixels)
    return origins - ((origins @ NORMAL) / (directions @ NORMAL))[:, None] * directions


def image(camera, texture, gain):
    """A plane with a texture of 0.2 mm a texel, (h, w) grey levels."""
    where = on_plane(camera, camera.pixel_grid().reshape(-1, 2))[:, :2] / 0.2 + 300
    where = where.reshape(camera.height_px, camera.width_px, 2).astype(np.float32)
    return gain * cv2.remap(texture, where[..., 0], where[..., 1], cv2.INTER_CUBIC)


@pytest.fixture(scope="module")
def scene():
    """Three cameras of unlike exposure before a textured plane."""
    noise = np.random.default_rng(0).normal(size=(600, 600)).astype(np.float32)
    texture = cv2.GaussianBlur(noise, (0, 0), 4.0)
    texture = 120 + 40 * texture / texture.std()
    places = {"front": (0, 0), "left": (120, 30), "right": (-120, -30)}
    rig = {
        name: pinhole(name, 1000.0, 240, 200, look_at(np.array([*xy, 500.0]), np.zeros(3), UP))
        for name, xy in places.items()
    }
    gains = {"front": 1.0, "left": 0.7, "right": 1.2}
    return rig, {name: image(rig[name], texture, gains[name]) for name in rig}


def noisy_tracks(rig, sigma_px, seed=0):
    rng = np.random.default_rng(seed)
    points = on_plane(rig["front"], rng.uniform([40, 40], [200, 160], (80, 2)))
    pixels = np.concatenate([camera.project(points) for camera in rig.values()])
    track, camera = np.tile(np.arange(80), 3), np.repeat(np.arange(3), 80)
    pixels = pixels + rng.normal(0, sigma_px, pixels.shape)
    return Tracks(tuple(rig), track, camera, pixels, np.zeros(240, int)), points


def off_px(rig, tracks):
    """Distance of every observation to where the track's frontal one lies on the plane."""
    off = []
    for k in range(tracks.count):
        rows = np.flatnonzero(tracks.track == k)
        frontal = rows[tracks.camera[rows] == 0]
        if len(frontal):
            there = on_plane(rig["front"], tracks.pixels[frontal])
            for i in np.setdiff1d(rows, frontal):
                camera = rig[tracks.cameras[tracks.camera[i]]]
                off.append(np.linalg.norm(camera.project(there)[0] - tracks.pixels[i]))
    return np.array(off)


def test_patches_find_the_same_point_to_a_small_part_of_a_pixel(scene):
    rig, greys = scene
    tracks, points = noisy_tracks(rig, 0.4)
    assert np.median(off_px(rig, tracks)) > 0.4
    noisy = points + np.random.default_rng(1).normal(0, 0.2, points.shape)
    aligned = align_patches(rig, tracks, noisy, {0: greys})
    assert aligned.count > 0.9 * tracks.count
    assert np.percentile(off_px(rig, aligned), 90) < 0.1


def test_patches_that_do_not_agree_are_dropped(scene):
    rig, greys = scene
    tracks, points = noisy_tracks(rig, 0.0)
    other = {**greys, "right": greys["right"][::-1].copy()}  # another place altogether
    aligned = align_patches(rig, tracks, points, {0: other})
    assert (aligned.camera == 2).mean() < 0.05
    assert aligned.count > 0.9 * tracks.count
