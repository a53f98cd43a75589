"""Speed of training at the size of Lips16, against scikit-learn's grid search.

3,289 frames of four people, 53 features, 27,000 outputs (3,000 triangles), 25 grid points, 5 folds
grouped by clip. Prints seconds and the largest memory. Bars: 60 s and 2 GB. With `--peer`, the time
of one of the 125 fits of `GridSearchCV` over `KernelRidge` on the same data, and what 126 would take.
"""

from __future__ import annotations

import argparse

import numpy as np
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GroupKFold

from benchmarks.common import peak_gb, timed
from vermilion.regression.cross_validation import clips_of_rows
from vermilion.regression.training import Selection, train
from vermilion.regression.training_set import TrainingSet

N_FRAMES, N_FEATURES, N_TRIANGLES = 3289, 53, 3000


def paper_sized_data() -> TrainingSet:
    """Smooth features of four people and layers that depend on them, of rank 40 plus noise."""
    rng = np.random.default_rng(0)
    takes = np.repeat(np.arange(4), 823)[:N_FRAMES]
    features = rng.normal(size=(N_FRAMES, N_FEATURES)).cumsum(axis=0)
    features /= features.std(axis=0)
    hidden = np.sin(features @ rng.normal(size=(N_FEATURES, 40)) / 4).astype(np.float32)
    layers = hidden @ rng.normal(scale=0.02, size=(40, 9 * N_TRIANGLES)).astype(np.float32)
    for part in np.array_split(layers, 16):
        part += 0.01 * rng.standard_normal(part.shape, dtype=np.float32)
    names = tuple(f"s{k}/rom" for k in range(4))
    neutrals = {f"s{k}": rng.normal(size=(4, 3)) for k in range(4)}
    # The paper's size has no displacements.
    return TrainingSet(
        features.astype(np.float32),
        layers,
        np.zeros((N_FRAMES, 0), np.float32),
        takes,
        names,
        np.arange(N_FRAMES),
        neutrals,
        {},
    )


def one_peer_fit(data: TrainingSet, selection: Selection) -> float:
    """Score of scikit-learn's kernel ridge regression on the first fold."""
    clips = clips_of_rows(data.sequences, selection.clip_frames, selection.folds)
    rows, held = next(GroupKFold(selection.folds).split(clips, groups=clips))
    peer = KernelRidge(alpha=0.1, kernel="rbf", gamma=0.002)
    peer.fit(data.features[rows], data.layers[rows])
    return peer.score(data.features[held], data.layers[held])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which regressor, against what."""
    parser.add_argument("--regressor", choices=["rbf", "kernel"], default="rbf")
    parser.add_argument("--peer", action="store_true", help="time scikit-learn as well")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    data = paper_sized_data()
    names = [f"shape_{k}" for k in range(33)] + [f"outer_{k}" for k in range(20)]
    alphas, betas = (1e-3, 1e-2, 1e-1, 1.0, 10.0), (0.03, 0.1, 0.3, 1.0, 3.0)
    selection = Selection(
        arguments.regressor, alphas=alphas, betas=betas, kernel_alphas=alphas, kernel_betas=betas
    )
    triangles, weights = np.arange(N_TRIANGLES), np.ones(N_TRIANGLES)
    training = timed(
        lambda: train("MS", data, names, triangles, weights, "", np.arange(0), selection)
    )
    memory_gb = peak_gb()
    model, curve = training.result
    activations, rank = model.estimator.coefficients_.shape
    print(
        f"{curve.mean.size} grid points, {len(curve.frames)} folds, "
        f"{activations} activations, a basis of {rank} layers"
    )
    print(f"training          {training.wall_s:8.1f} s (bar 60)")
    print(f"largest memory    {memory_gb:8.2f} GB with the data (bar 2)")
    if arguments.peer:
        one = timed(lambda: one_peer_fit(data, selection)).wall_s
        print(f"KernelRidge       {one:8.1f} s a fit and score, {126 * one:.0f} s in GridSearchCV")
        print(f"faster by         {126 * one / training.wall_s:8.1f} (bar 20)")
