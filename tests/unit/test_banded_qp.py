"""The banded box-constrained solver against dense solvers."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from vermilion.export.smoothed_gram import SmoothedGram
from vermilion.tracking.landmark_fit.banded_qp import BandMatrix, FrameMatrix, solve_in_box


def dense(blocks, second, first):
    n, p = blocks.shape[:2]
    matrix = np.zeros((n * p, n * p))
    for f in range(n):
        matrix[f * p : f * p + p, f * p : f * p + p] = blocks[f]
    for weights, stencil in ((first, [-1, 1]), (second, [1, -2, 1])):
        for f in range(len(weights)):
            for k in range(p):
                row = np.zeros(n * p)
                row[[(f + i) * p + k for i in range(len(stencil))]] = stencil
                matrix += weights[f, k] * np.outer(row, row)
    return matrix


def problem(n, p=3, seed=0):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, p, p))
    blocks = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(p)
    second, first = rng.uniform(0, 2, (max(n - 2, 0), p)), rng.uniform(0, 2, (max(n - 1, 0), p))
    return BandMatrix(blocks, second, first), dense(blocks, second, first), rng.normal(size=(n, p))


@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_products_and_solutions_equal_the_dense_ones(n):
    matrix, full, right = problem(n)
    assert np.allclose(matrix.times(right).reshape(-1), full @ right.reshape(-1), atol=1e-12)
    solution = matrix.solve_free(right, np.ones(right.shape, dtype=bool))
    assert np.allclose(full @ solution.reshape(-1), right.reshape(-1), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_box_holds_and_the_minimum_is_scipys(seed):
    matrix, full, right = problem(6, seed=seed)
    right *= 5
    found = solve_in_box(matrix, right, 0.0, 0.4)
    root = np.linalg.cholesky(full).T
    wanted = lsq_linear(
        root, np.linalg.solve(root.T, right.reshape(-1)), (0.0, 0.4), tol=1e-14
    ).x.reshape(right.shape)
    assert found.min() >= 0 and found.max() <= 0.4
    assert np.allclose(found, wanted, atol=1e-5)


@pytest.mark.parametrize("bound", [0.05, 9.0])
def test_the_matrix_of_one_frame_is_the_band_of_one_block(bound):
    band, block, right = problem(1, p=7)
    frame = FrameMatrix(block)
    assert np.allclose(frame.times(right), band.times(right), atol=1e-12)
    free = np.arange(7)[None] % 3 > 0
    assert np.allclose(frame.solve_free(right, free), band.solve_free(right, free), atol=1e-10)
    assert not frame.solve_free(right, np.zeros_like(free)).any()
    wanted = solve_in_box(band, right, -bound, bound)
    assert np.allclose(solve_in_box(frame, right, -bound, bound), wanted, atol=1e-9)


def test_an_infinite_box_is_no_box():
    matrix, full, right = problem(5)
    found = solve_in_box(matrix, right, -np.inf, np.inf)
    assert np.allclose(full @ found.reshape(-1), right.reshape(-1), atol=1e-8)


@pytest.mark.parametrize("bound", [0.05, 9.0, np.inf])
def test_one_gram_for_all_frames_needs_no_band(bound):
    rng = np.random.default_rng(8)
    shapes = rng.normal(0, 1, (6, 20))
    gram, right = shapes @ shapes.T, rng.normal(0, 6, (9, 6))
    band = BandMatrix(np.tile(gram, (9, 1, 1)), np.zeros((7, 6)), np.full((8, 6), 0.7))
    fast = SmoothedGram(gram, 9, 0.7)
    assert np.allclose(fast.times(right), band.times(right))
    wanted = solve_in_box(band, right, -bound, bound)
    assert (np.abs(wanted) == bound).any() == (bound < 1)
    assert np.abs(solve_in_box(fast, right, -bound, bound) - wanted).max() < 1e-6
