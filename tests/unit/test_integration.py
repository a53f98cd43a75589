"""Integration of layers: exact where a mesh exists, fixed outside, smooth at the seam."""

import numpy as np
import pytest

from vermilion.correction.integration import LayerIntegrator
from vermilion.correction.layers import correction_layers, decode_layers
from vermilion.correction.right_side import TURN_SERIES, turn_limits
from vermilion.geometry.cotangents import edge_stiffness
from vermilion.storage.errors import InputError


def sheet(n=36, size_mm=180.0):
    """A bumpy sheet with irregular triangles: (vertices, triangles, distance to its middle)."""
    axis = np.linspace(-size_mm / 2, size_mm / 2, n)
    x, y = np.meshgrid(axis, axis)
    rng = np.random.default_rng(0)
    flat = np.stack([x, y], axis=-1).reshape(-1, 2) + rng.normal(scale=0.8, size=(n * n, 2))
    height = 15 * np.cos(flat[:, 0] / 40) * np.cos(flat[:, 1] / 30)
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (index[i : n - 1 + i, j : n - 1 + j].ravel() for i in (0, 1) for j in (0, 1))
    triangles = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return np.column_stack([flat, height]), triangles, np.linalg.norm(flat, axis=1)


@pytest.fixture(scope="module")
def scene():
    """Neutral, topology, mask, and a coarse and an accurate sequence that agree outside it."""
    neutral, triangles, radius = sheet()
    mask = np.flatnonzero((radius < 60)[triangles].all(axis=1))
    rng = np.random.default_rng(1)
    phases = rng.uniform(0, 6, size=(5, 1, 3))
    coarse = neutral + 3 * np.sin(neutral / 21 + phases)
    fade = np.clip(1 - radius / 45, 0, 1)[:, None]
    accurate = coarse + 9 * fade * np.sin(neutral / 9 - phases)
    return neutral, triangles, mask, coarse, accurate


@pytest.mark.parametrize("seam_mm", [0.0, 8.0, 25.0])
def test_true_layers_return_the_true_mesh(scene, seam_mm):
    neutral, triangles, mask, coarse, accurate = scene
    layers = correction_layers(coarse, accurate, triangles[mask])
    corrected = LayerIntegrator(neutral, triangles, mask, seam_mm).integrate(coarse, layers)
    np.testing.assert_allclose(corrected, accurate, atol=1e-6)  # mm


def test_zero_layers_return_the_coarse_mesh(scene):
    neutral, triangles, mask, coarse, _ = scene
    zero = np.zeros((len(coarse), len(mask), 9))
    corrected = LayerIntegrator(neutral, triangles, mask).integrate(coarse, zero)
    np.testing.assert_array_equal(corrected, coarse)


@pytest.mark.parametrize("seam_mm", [0.0, 8.0])
def test_the_face_beyond_the_seam_does_not_move(scene, seam_mm):
    neutral, triangles, mask, coarse, _ = scene
    layers = np.random.default_rng(5).normal(scale=0.3, size=(len(coarse), len(mask), 9))
    integrator = LayerIntegrator(neutral, triangles, mask, seam_mm)
    moved = np.linalg.norm(integrator.integrate(coarse, layers) - coarse, axis=2).max(axis=0)
    free = np.zeros(len(neutral), dtype=bool)
    free[integrator.free] = True
    assert np.all(moved[~free] == 0)
    in_mask = np.zeros(len(neutral), dtype=bool)
    in_mask[triangles[mask]] = True
    if seam_mm == 0:
        assert np.all(moved[~in_mask] == 0)
    else:
        assert np.linalg.norm(neutral[free & ~in_mask, :2], axis=1).max() < 60 + seam_mm + 1


def test_the_seam_spreads_the_step_at_the_border(scene):
    """A mask that wants to turn bends less sharply at its border with a seam than without."""
    neutral, triangles, mask, coarse, _ = scene
    layers = np.zeros((1, len(mask), 9))
    layers[..., 2] = 0.15  # rad about z: incompatible with a fixed border
    creases = []
    for seam_mm in (0.0, 20.0):
        corrected = LayerIntegrator(neutral, triangles, mask, seam_mm).integrate(coarse[:1], layers)
        change = correction_layers(coarse[:1], corrected, triangles)[0, :, 3:]
        creases.append(np.abs(change).max())
    assert creases[1] < 0.95 * creases[0]


def test_frames_in_one_block_know_nothing_of_each_other(scene):
    neutral, triangles, mask, coarse, accurate = scene
    layers = correction_layers(coarse, accurate, triangles[mask])
    coarse, layers = np.tile(coarse, (4, 1, 1)), np.tile(layers, (4, 1, 1))  # 20 frames, 2 blocks
    integrator = LayerIntegrator(neutral, triangles, mask)
    alone = [integrator.integrate(coarse[f : f + 1], layers[f : f + 1])[0] for f in range(20)]
    np.testing.assert_allclose(integrator.integrate(coarse, layers), alone, atol=1e-9)


@pytest.mark.parametrize("turn", [0.3, 2.0])
def test_right_side_agrees_with_a_plain_loop(scene, turn):
    """The system that the result solves, its polynomials against the exponential of a layer."""
    neutral, triangles, mask, coarse, _ = scene
    layers = np.random.default_rng(6).normal(scale=0.7, size=(1, len(mask), 9))
    layers[..., :3] *= turn / np.linalg.norm(layers[..., :3], axis=-1, keepdims=True)
    integrator = LayerIntegrator(neutral, triangles, mask, seam_mm=0.0)
    moved = (integrator.integrate(coarse[:1], layers) - coarse[:1])[0]
    slow = np.zeros_like(neutral)
    change = decode_layers(layers[0]) - np.eye(3)
    for t, (corners, weights) in enumerate(zip(triangles[mask], integrator.weights, strict=True)):
        for k in range(3):
            i, j = corners[(k + 1) % 3], corners[(k + 2) % 3]
            flow = weights[k] * change[t] @ (coarse[0, j] - coarse[0, i])
            slow[j] += flow
            slow[i] -= flow
    fast = integrator.matrix @ moved[integrator.free]
    np.testing.assert_allclose(fast, slow[integrator.free], atol=1e-9)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_polynomials_of_the_turn_are_good_to_rounding_up_to_a_whole_turn(precision):
    series, (factor, offset) = TURN_SERIES[np.dtype(precision)], turn_limits(precision)
    angle = np.linspace(0, 2 * np.pi, 2001)
    s = (angle**2 * factor - offset).astype(precision)
    truth = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    for coefficients, values in zip(series, truth, strict=True):
        np.testing.assert_allclose(
            np.polyval(coefficients, s), values, atol=8 * np.finfo(precision).eps
        )


def test_mixed_layers_in_single_precision_are_as_good_as_given_ones(scene):
    neutral, triangles, mask, coarse, accurate = scene
    basis = correction_layers(coarse, accurate, triangles[mask]).reshape(5, -1).T
    basis = np.ascontiguousarray(basis, dtype=np.float32)
    mixture = np.random.default_rng(4).uniform(size=(20, 5))
    mixture /= mixture.sum(axis=1, keepdims=True)
    frames = np.arange(20) % 5
    integrator = LayerIntegrator(neutral, triangles, mask)
    given = integrator.integrate(coarse[frames], (mixture @ basis.T).reshape(20, -1, 9))
    mixed = integrator.integrate_mixture(coarse[frames], mixture, basis)
    np.testing.assert_allclose(mixed, given, atol=1e-4)  # mm


@pytest.mark.parametrize("reach_mm", [45, 60, 84])
def test_a_part_that_hangs_on_the_mask_follows_it(reach_mm):
    """A hole's rim inside the mask (the inside of a mouth) goes where the mask goes, though the
    face outside a wide mask is not much larger than it."""
    neutral, triangles, radius = sheet()
    mask = np.flatnonzero(((radius < reach_mm) & (radius > 14))[triangles].all(axis=1))
    layers = np.zeros((1, len(mask), 9))
    layers[..., 3:6] = 0.1
    integrator = LayerIntegrator(neutral, triangles, mask, seam_mm=0.0)
    moved = np.linalg.norm(integrator.integrate(neutral[None], layers)[0] - neutral, axis=1)
    inside = np.flatnonzero(radius < 10)
    assert np.isin(inside, integrator.free).all()
    assert moved[inside].max() > 0.2  # mm, not pinned
    assert np.all(moved[radius > reach_mm + 17] == 0)


@pytest.mark.parametrize("detail_mm", [3.0, 30.0])
def test_true_layers_and_places_return_the_true_mesh(scene, detail_mm):
    neutral, triangles, mask, coarse, accurate = scene
    layers = correction_layers(coarse, accurate, triangles[mask])
    places = (accurate - coarse)[:, np.unique(triangles[mask])]
    integrator = LayerIntegrator(neutral, triangles, mask, 8.0, detail_mm)
    corrected = integrator.integrate(coarse, layers, places)
    np.testing.assert_allclose(corrected, accurate, atol=1e-6)  # mm


def test_places_rule_over_long_ranges_and_layers_over_short_ones(scene):
    """No layers, and places of two wave lengths: the long one comes through, the short one does not."""
    neutral, triangles, mask, _, _ = scene
    corners = np.unique(triangles[mask])
    inner = np.linalg.norm(neutral[corners, :2], axis=1) < 40
    zero = np.zeros((1, len(mask), 9))
    integrator = LayerIntegrator(neutral, triangles, mask, 8.0, detail_mm=8.0)
    kept = []
    for length_mm in (240.0, 15.0):
        wave = np.cos(2 * np.pi * neutral[corners, 0] / length_mm)
        places = np.zeros((1, len(corners), 3))
        places[0, :, 2] = wave
        moved = integrator.integrate(neutral[None], zero, places)[0, corners, 2]
        moved -= neutral[corners, 2]
        kept.append(moved[inner] @ wave[inner] / (wave[inner] @ wave[inner]))
    assert kept[0] > 0.9
    assert kept[1] < 0.2


def test_mixed_places_are_as_good_as_given_ones(scene):
    neutral, triangles, mask, coarse, accurate = scene
    corners = np.unique(triangles[mask])
    layers = correction_layers(coarse, accurate, triangles[mask]).reshape(5, -1)
    places = (accurate - coarse)[:, corners].reshape(5, -1)
    mixture = np.random.default_rng(4).uniform(size=(20, 5)) / 5
    integrator = LayerIntegrator(neutral, triangles, mask, 8.0, 10.0)
    frames = np.arange(20) % 5
    given = integrator.integrate(
        coarse[frames], (mixture @ layers).reshape(20, -1, 9), (mixture @ places).reshape(20, -1, 3)
    )
    mixed = integrator.integrate_mixture(
        coarse[frames], mixture, np.ascontiguousarray(layers.T, dtype=np.float32),
        integrator.weighted_places(places),
    )  # fmt: skip
    np.testing.assert_allclose(mixed, given, atol=1e-4)  # mm


def test_places_are_asked_for(scene):
    neutral, triangles, mask, coarse, _ = scene
    integrator = LayerIntegrator(neutral, triangles, mask, detail_mm=10.0)
    with pytest.raises(ValueError, match="displacement_mm must be"):
        integrator.integrate(coarse, np.zeros((5, len(mask), 9)))


def test_stiffness_is_positive_and_knows_no_translation():
    neutral, triangles, _ = sheet(8)
    matrix = edge_stiffness(triangles, np.full((len(triangles), 3), 0.5), len(neutral)).toarray()
    np.testing.assert_allclose(matrix @ np.ones(len(neutral)), 0, atol=1e-12)
    assert np.linalg.eigvalsh(matrix)[0] > -1e-10


def test_a_mask_of_the_whole_mesh_is_refused():
    neutral, triangles, _ = sheet(6)
    with pytest.raises(InputError, match="mask_radius_mm"):
        LayerIntegrator(neutral, triangles, np.arange(len(triangles)))


def test_layers_of_another_mask_are_refused(scene):
    neutral, triangles, mask, coarse, _ = scene
    with pytest.raises(ValueError, match="layers must be"):
        LayerIntegrator(neutral, triangles, mask).integrate(coarse, np.zeros((5, 3, 9)))
