"""Values between pixels, and images without distortion."""

from dataclasses import replace

import numpy as np

from vermilion.geometry.camera import look_at, pinhole
from vermilion.imaging.sampling import sample_bilinear
from vermilion.imaging.undistortion import undistorted

POSE = look_at(np.array([-30.0, 0.0, 500.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
CAMERA = pinhole("b", 800.0, 160, 120, POSE)


def test_sampling_a_linear_image_is_exact_at_many_points():
    y, x = np.mgrid[:50, :60].astype(np.float32)
    points = np.random.default_rng(0).uniform(1, 49, (70_000, 2))
    found = sample_bilinear(x + 0.5 + 10 * (y + 0.5), points)
    assert np.abs(found - (points[:, 0] + 10 * points[:, 1])).max() < 0.2  # remap: 1/32 pixel


def test_undistorted_image_agrees_with_the_pinhole():
    params = (800.0, 805.0, 80.0, 60.0, -0.2, 0.05, 0.001, -0.002)
    bent = replace(CAMERA, model="OPENCV", params=params)
    grid = bent.pixel_grid()
    origins, directions = bent.rays(grid)
    image = (origins[..., 0] + 400 * directions[..., 0]).astype(np.float32)  # smooth in the world
    image, straight = undistorted(image, bent)
    points = np.random.default_rng(2).uniform(-25, 25, (100, 3))
    assert straight.is_pinhole
    _, expected = straight.rays(straight.project(points))
    inside = straight.in_image(straight.project(points), 12)
    found = sample_bilinear(image, straight.project(points))[inside]
    world = origins[0, 0, 0] + 400 * expected[inside, 0]
    assert np.abs(found - world).max() < 0.02


def test_pixel_centres_give_the_pixels_whatever_the_shape():
    image = np.random.default_rng(1).integers(0, 255, (7, 9, 3)).astype(np.uint8)
    y, x = np.mgrid[:7, :9]
    centres = np.stack([x, y], axis=-1) + 0.5
    assert (sample_bilinear(image, centres) == image).all()
    assert (sample_bilinear(image, centres.reshape(-1, 2)) == image.reshape(-1, 3)).all()
    assert (sample_bilinear(image[..., 0], centres[None])[0] == image[..., 0]).all()
    assert sample_bilinear(image, centres[0, 0]).tolist() == image[0, 0].tolist()
    assert sample_bilinear(image, np.zeros((0, 2))).shape == (0, 3)


def test_beyond_the_border_an_image_is_repeated_or_zero():
    image = np.array([[3.0, 5.0]], dtype=np.float32)
    pixels = np.array([[-4.0, 0.5], [9.0, -2.0], [2.0, 0.5], [np.nan, np.nan], [np.inf, 0.5]])
    assert sample_bilinear(image, pixels).tolist() == [3.0, 5.0, 5.0, 3.0, 5.0]
    assert sample_bilinear(image, pixels, "zero").tolist() == [0.0, 0.0, 2.5, 0.0, 0.0]


def test_a_pinhole_has_no_distortion_to_take_out():
    image = np.ones((120, 160), dtype=np.float32)
    same, straight = undistorted(image, CAMERA)
    assert same is image and straight is CAMERA


def test_what_a_lens_did_not_see_is_black_or_repeated():
    barrel = replace(CAMERA, model="SIMPLE_RADIAL", params=(800.0, 80.0, 60.0, 8.0))
    image = np.ones((120, 160), dtype=np.float32)
    assert (undistorted(image, barrel)[0] == 1).all()
    black, _ = undistorted(image, barrel, "zero")
    assert black[0, 0] == 0 and black[60, 80] == 1
