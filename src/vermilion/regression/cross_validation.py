"""Choice of alpha and beta by cross-validation grouped by clip, or by person.

All that the errors need of the targets is their Gram matrix Y Y' (F, F): it is formed once, in
place of predictions of 9 T outputs for every grid point. For one beta and fold, one eigenvalue
decomposition of the activations gives the errors of every alpha. No approximation is involved: a
test holds the result against plain fitting and predicting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import linalg, sparse

from vermilion.regression.linear import LinearOutputs
from vermilion.regression.ridge import person_averages

Rule = Literal["simplest", "least"]


@dataclass(frozen=True)
class Curve:
    """Root mean square error over held-out clips at each grid point.

    Attributes:
        alphas: (A,).
        betas: (B,); NaN for a regressor without beta.
        errors: (B, A, folds) RMS over the entries of the layer, each fold's frames.
        frames: (folds,) held-out frames.
        freedom: (B, A) effective degrees of freedom of the fit on all rows.
    """

    alphas: np.ndarray
    betas: np.ndarray
    errors: np.ndarray
    frames: np.ndarray
    freedom: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """(B, A) RMS over all held-out frames."""
        return np.sqrt((self.errors**2) @ self.frames / self.frames.sum())

    @property
    def standard_error(self) -> np.ndarray:
        """(B, A) standard error of the mean over folds."""
        return self.errors.std(axis=2, ddof=1) / np.sqrt(self.errors.shape[2])

    def choose(self, rule: Rule = "simplest") -> tuple[int, int]:
        """Index (beta, alpha) of the choice.

        `least`: the least mean error. `simplest`: the least degrees of freedom among the points
        whose error is within one standard error of the least (Breiman et al. 1984): where folds
        cannot tell two points apart, the smoother one goes further beyond the training.
        """
        mean = self.mean
        least = np.unravel_index(np.argmin(mean), mean.shape)
        if rule == "simplest":
            close = mean <= mean[least] + self.standard_error[least]
            least = np.unravel_index(np.argmin(np.where(close, self.freedom, np.inf)), mean.shape)
        return int(least[0]), int(least[1])

    def parameters(self, rule: Rule) -> dict[str, float]:
        """`alpha`, and `beta` where the regressor has one, of the choice."""
        row, column = self.choose(rule)
        beta = {} if np.isnan(self.betas[row]) else {"beta": float(self.betas[row])}
        return {"alpha": float(self.alphas[column]), **beta}


def clips_of_rows(sequences: np.ndarray, clip_frames: int, n_folds: int) -> np.ndarray:
    """Clip label of each row: contiguous stretches of a sequence, (F,) int.

    Frames are in order of time within one of the `sequences` (F,). Clips are shorter than `clip_frames`
    where that is needed to have one for every fold.
    """
    sequences = np.asarray(sequences)
    clip_frames = max(1, min(clip_frames, len(sequences) // n_folds))
    _, label = np.unique(sequences, return_inverse=True)
    clips = np.empty(len(sequences), dtype=np.int64)
    first = 0
    for k in range(label.max() + 1):
        rows = np.flatnonzero(label == k)
        n_clips = max(1, round(len(rows) / clip_frames))
        clips[rows] = first + np.arange(len(rows)) * n_clips // len(rows)
        first += n_clips
    return clips


def target_gram(targets: np.ndarray, output_weights: np.ndarray | None = None) -> np.ndarray:
    """Mean over the outputs of Y Y', (F, F) float64, of targets (F, K) less their mean over frames.

    Args:
        targets: (F, K).
        output_weights: (K,) of the outputs in the mean; None: all alike.
    """
    block = 4096
    weights = np.ones(targets.shape[1]) if output_weights is None else output_weights
    gram = np.zeros((len(targets), len(targets)))
    for first in range(0, targets.shape[1], block):
        part = targets[:, first : first + block].astype(np.float32)
        part -= part.mean(axis=0, dtype=np.float64).astype(np.float32)
        if output_weights is not None:
            part *= np.sqrt(weights[first : first + block]).astype(np.float32)
        gram += part @ part.T
    return gram / weights.sum()


def cross_validate(
    estimator: LinearOutputs,
    features: np.ndarray,
    gram: np.ndarray,
    sequences: np.ndarray,
    clips: np.ndarray,
    *,
    alphas: Sequence[float],
    betas: Sequence[float] | None = None,
    n_folds: int = 5,
    persons: np.ndarray | None = None,
) -> Curve:
    """Errors of an estimator on a grid, all that it fits coming from the rows trained on.

    Args:
        estimator: with every parameter but alpha and beta as wanted; it is not changed.
        features: (F, M).
        gram: (F, F), `target_gram` of the targets.
        sequences: (F,) labels of the sequences, frames in order of time.
        clips: (F,) labels of the clips, or of the people, which are held out whole.
        betas: None for an estimator without.
        persons: (F,) in 0 .. G - 1 for a bias each, or None.
    """
    persons = np.zeros(len(features), dtype=np.int64) if persons is None else persons
    folds = folds_of(clips, n_folds)
    errors, freedom = [], []
    for beta in [np.nan] if betas is None else betas:
        tried = estimator.unfitted()
        if betas is not None:
            tried.set_params(beta=beta)
        of_folds = []
        for train, held in folds:
            design = tried.fit_inputs(features[train], sequences[train])
            judged = tried.activations(features[held])
            squared = _held_out_squared(design, judged, gram, train, held, persons, alphas)
            of_folds.append(np.sqrt(np.maximum(squared, 0.0) / len(held)))
        errors.append(np.stack(of_folds, axis=1))
        freedom.append(_degrees_of_freedom(tried.fit_inputs(features, sequences), alphas))
    return Curve(
        np.asarray(alphas, float),
        np.array([np.nan]) if betas is None else np.asarray(betas, float),
        np.stack(errors),
        np.array([len(held) for _, held in folds]),
        np.stack(freedom),
    )


def held_out_novelty(
    estimator: LinearOutputs,
    features: np.ndarray,
    sequences: np.ndarray,
    clips: np.ndarray,
    n_folds: int,
) -> np.ndarray:
    """Novelty (F,) of `features` (F, M) for a training that has not seen their clip.

    `sequences` and `clips` (F,) are labels, as in `cross_validate`.
    """
    novelty = np.empty(len(features))
    for train, held in folds_of(clips, n_folds):
        tried = estimator.unfitted()
        tried.fit_inputs(features[train], sequences[train])
        novelty[held] = tried.novelty(features[held])
    return novelty


def folds_of(clips: np.ndarray, n_folds: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows to train on and rows to judge of each fold; clips (F,) stay whole.

    The longest clip goes to the fold with the fewest rows so far, as in scikit-learn's `GroupKFold`.
    """
    _, label = np.unique(clips, return_inverse=True)
    lengths = np.bincount(label)
    n_folds = min(n_folds, len(lengths))
    if n_folds < 2:
        raise ValueError("cross-validation needs at least two clips")
    rows_of_fold, fold_of_clip = np.zeros(n_folds, np.int64), np.empty(len(lengths), np.int64)
    for clip in np.argsort(lengths, kind="stable")[::-1]:
        fold_of_clip[clip] = np.argmin(rows_of_fold)
        rows_of_fold[fold_of_clip[clip]] += lengths[clip]
    fold = fold_of_clip[label]
    return [(np.flatnonzero(fold != k), np.flatnonzero(fold == k)) for k in range(n_folds)]


def _degrees_of_freedom(design: np.ndarray, alphas: Sequence[float]) -> np.ndarray:
    """Trace of the map from targets to fitted values, the bias left out, (A,)."""
    centred = design - design.mean(axis=0)
    eigenvalues = np.maximum(linalg.eigvalsh(centred.T @ centred), 0.0)
    return (eigenvalues / (eigenvalues + np.asarray(alphas, float)[:, None])).sum(axis=1)


def _held_out_squared(
    design_train: np.ndarray,
    design_held: np.ndarray,
    gram: np.ndarray,
    train: np.ndarray,
    held: np.ndarray,
    persons: np.ndarray,
    alphas: Sequence[float],
) -> np.ndarray:
    """Squared error over the held-out rows for every alpha, (A,).

    With B = Phi V the activations, centred on each person's training mean, in their eigenbasis,
    D = 1 / (lambda + alpha), and K the Gram matrix about the same means, the error is
    tr K_hh - 2 tr(B_h D B_t' K_th) + tr(B_h D B_t' K_tt B_t D B_h').
    """
    # A person of whom nothing is left to train on is judged by everybody's mean.
    left = np.unique(persons[train])
    known = np.isin(persons, left)
    label = np.where(known, np.searchsorted(left, persons), len(left))
    averages = person_averages(label[train])
    averages = sparse.vstack([averages, np.full((1, len(train)), 1.0 / len(train))], format="csr")

    means = averages @ design_train
    centred = design_train - means[label[train]]
    eigenvalues, basis = linalg.eigh(centred.T @ centred, overwrite_a=True)
    eigenvalues = np.maximum(eigenvalues, 0.0)
    rotated_train = centred @ basis
    rotated_held = (design_held - means[label[held]]) @ basis

    to_means = (averages @ gram[train]).T  # (F, people)
    among_means = averages @ to_means[train]
    mine = label[held]
    held_diagonal = gram[held, held] - 2 * to_means[held, mine] + among_means[mine, mine]
    # B_t sums to zero over each person, so that centring K on the side of B_t changes nothing.
    cross = rotated_train.T @ (gram[np.ix_(train, held)] - to_means[train][:, mine])
    linear = (cross * rotated_held.T).sum(axis=1)
    quadratic = (rotated_train.T @ gram[np.ix_(train, train)] @ rotated_train) * (
        rotated_held.T @ rotated_held
    )
    shrink = 1.0 / (eigenvalues[None] + np.asarray(alphas, float)[:, None])
    return (
        held_diagonal.sum()
        - 2 * shrink @ linear
        + np.einsum("ap,pq,aq->a", shrink, quadratic, shrink, optimize=True)
    )
