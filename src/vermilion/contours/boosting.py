"""Gradient boosted trees on soft labels, as plain arrays: fitted, evaluated and stored as such.

The logistic loss (Friedman 2001) takes labels anywhere in [0, 1], which a pixel at a fraction of
a pixel from the contour needs. Trees are complete, of one depth, split on quantised features.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.contours.pool import FeaturePool, box_feature
from vermilion.storage.kernels import kernel

N_BINS = 64
CHECK_EVERY = 4  # trees between two rejections at evaluation
REJECTED = np.float32(2.5)  # taken off the log-odds of a rejected pixel, for the trees left out


@dataclass(frozen=True)
class BoostingSettings:
    """How trees are grown.

    Attributes:
        n_trees: rounds.
        depth: splits from root to leaf.
        learning_rate: shrinkage of each tree.
        features_per_tree: size of the random subset of the pool that a tree may use.
        sample_share: share of the samples that choose a tree's splits; its leaves use all.
        l2: ridge on leaf values, in units of the loss's second derivative.
        seed: of the random subsets.
    """

    n_trees: int = 160
    depth: int = 4
    learning_rate: float = 0.15
    features_per_tree: int = 128
    sample_share: float = 0.4
    l2: float = 5.0
    seed: int = 0


@dataclass(frozen=True)
class Forest:
    """Boosted trees over a small pool of features.

    Attributes:
        pool: the features that the trees use.
        feature: (T, 2^D - 1) int32 into the pool, breadth first.
        threshold: (T, 2^D - 1) float32; a smaller or equal value goes left.
        leaf: (T, 2^D) float32 log-odds.
        prior: log-odds before the first tree.
        reject: (T,) float32; a pixel whose log-odds fall below after tree t is no contour.
    """

    pool: FeaturePool
    feature: np.ndarray
    threshold: np.ndarray
    leaf: np.ndarray
    prior: float
    reject: np.ndarray

    def log_odds(self, integrals: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Log-odds (n,) float32 of contour at pixels `columns`, `rows` (n,) of `integrals` (C, H, W)."""
        flat, offsets, starts = self.pool.laid_out(integrals, columns, rows)
        return _log_odds(
            flat, offsets, self.pool.weights, starts, self.feature, self.threshold, self.leaf,
            np.float32(self.prior), self.reject,
        )  # fmt: skip


def fit_forest(
    pool: FeaturePool,
    codes: np.ndarray,
    edges: np.ndarray,
    labels: np.ndarray,
    weights: np.ndarray,
    settings: BoostingSettings,
    keep: float = 0.999,
) -> Forest:
    """Fit trees to samples.

    Args:
        pool: the N features.
        codes: (N, n) uint8 bins of the samples' features.
        edges: (N, N_BINS - 1) float32 of the bins, from `bin_edges`.
        labels: (n,) in [0, 1].
        weights: (n,) of the samples.
        settings: of the trees.
        keep: share of the positive samples (label over a half) that the cascade must not reject.
    """
    random = np.random.default_rng(settings.seed)
    mean = float(np.clip(np.average(labels, weights=weights), 1e-3, 1 - 1e-3))
    prior = float(np.log(mean / (1 - mean)))
    score = np.full(len(labels), prior)
    positive, trees = labels > 0.5, []
    for _ in range(settings.n_trees):
        probability = 1.0 / (1.0 + np.exp(-score))
        gradient = weights * (labels - probability)
        curvature = weights * np.maximum(probability * (1 - probability), 1e-6)
        subset = np.sort(random.permutation(len(pool))[: settings.features_per_tree])
        some = random.random(len(labels)) < settings.sample_share
        split, cut = _grow(
            np.ascontiguousarray(codes[subset][:, some]), gradient[some], curvature[some],
            settings.depth, settings.l2,
        )  # fmt: skip
        split = subset[split]
        node = _leaves(codes, split, cut)
        up = np.bincount(node, gradient, len(split) + 1)
        down = np.bincount(node, curvature, len(split) + 1) + settings.l2
        leaf = (settings.learning_rate * up / down).astype(np.float32)
        score += leaf[node]
        reject = np.quantile(score[positive], 1 - keep) - 0.5 if positive.any() else -np.inf
        trees.append((split, np.where(cut >= 0, edges[split, cut], np.inf), leaf, reject))
    feature, threshold, leaf, reject = (np.array(part) for part in zip(*trees, strict=True))
    used, feature = np.unique(feature, return_inverse=True)
    return Forest(
        pool.take(used), feature.reshape(threshold.shape).astype(np.int32),
        threshold.astype(np.float32), leaf, prior, reject.astype(np.float32),
    )  # fmt: skip


def bin_edges(values: np.ndarray) -> np.ndarray:
    """Upper edges (N, N_BINS - 1) of the quantile bins of each feature, from `values` (N, n)."""
    ordered = np.sort(values, axis=1)
    places = np.linspace(0, ordered.shape[1] - 1, N_BINS + 1)[1:-1]
    low = np.floor(places).astype(int)
    return (0.5 * (ordered[:, low] + ordered[:, low + 1])).astype(np.float32)


def bin_features(
    pool: FeaturePool,
    edges: np.ndarray,
    integrals: np.ndarray,
    columns: np.ndarray,
    rows: np.ndarray,
) -> np.ndarray:
    """Bins (N, n) uint8 of the features at pixels `columns`, `rows` (n,) of `integrals` (C, H, W).

    `edges` (N, N_BINS - 1) are those of `bin_edges`.
    """
    flat, offsets, starts = pool.laid_out(integrals, columns, rows)
    return _bin_features(flat, offsets, pool.weights, starts, edges)


@kernel()
def _bin_features(flat, offsets, weights, starts, edges):
    codes = np.empty((len(offsets), len(starts)), dtype=np.uint8)
    for f in range(len(offsets)):
        limits = edges[f]
        for i in range(len(starts)):
            value = box_feature(flat, offsets, weights, f, starts[i])
            code, step = 0, N_BINS // 2
            while step > 0:  # how many edges lie below the value
                if value > limits[code + step - 1]:
                    code += step
                step //= 2
            codes[f, i] = code
    return codes


@kernel()
def _grow(codes, gradient, curvature, depth, l2):
    """Splits of one tree: (feature of each node, its last bin to the left or -1)."""
    n_nodes = 2**depth - 1
    n_features, n_samples = codes.shape
    split = np.zeros(n_nodes, dtype=np.int32)
    cut = np.full(n_nodes, -1, dtype=np.int32)
    node = np.zeros(n_samples, dtype=np.int32)
    for level in range(depth):
        first, width = 2**level - 1, 2**level
        best = np.full(width, 1e-9)
        sums = np.zeros((width * N_BINS, 2))
        for f in range(n_features):
            sums[:] = 0.0
            for i in range(n_samples):
                place = node[i] * N_BINS + codes[f, i]
                sums[place, 0] += gradient[i]
                sums[place, 1] += curvature[i]
            for k in range(width):
                gain, last = _best_cut(sums[k * N_BINS : (k + 1) * N_BINS], l2)
                if gain > best[k]:
                    best[k] = gain
                    split[first + k] = f
                    cut[first + k] = last
        for i in range(n_samples):
            k = first + node[i]
            right = cut[k] >= 0 and codes[split[k], i] > cut[k]
            node[i] = 2 * node[i] + (1 if right else 0)
    return split, cut


@kernel()
def _best_cut(sums, l2):
    """(gain, last bin to the left) of the best split of a node's histogram (N_BINS, 2)."""
    all_up, all_down = sums[:, 0].sum(), sums[:, 1].sum()
    whole = all_up * all_up / (all_down + l2)
    best, last = 0.0, -1
    left_up, left_down = 0.0, 0.0
    for b in range(N_BINS - 1):
        left_up += sums[b, 0]
        left_down += sums[b, 1]
        right_up, right_down = all_up - left_up, all_down - left_down
        if left_down < l2 or right_down < l2:
            continue
        left, right = left_up * left_up / (left_down + l2), right_up**2 / (right_down + l2)
        if left + right - whole > best:
            best, last = left + right - whole, b
    return best, last


@kernel()
def _leaves(codes, split, cut):
    """Leaf of each sample in a tree, (n,) int32."""
    n_nodes = len(split)
    node = np.zeros(codes.shape[1], dtype=np.int32)
    for i in range(codes.shape[1]):
        k = 0
        while k < n_nodes:
            right = cut[k] >= 0 and codes[split[k], i] > cut[k]
            k = 2 * k + (2 if right else 1)
        node[i] = k - n_nodes
    return node


@kernel()
def _log_odds(flat, offsets, weights, starts, feature, threshold, leaf, prior, reject):
    n = len(starts)
    score = np.full(n, prior, dtype=np.float32)
    alive = np.arange(n)
    n_alive = n
    depth = 0
    while 2**depth < leaf.shape[1]:
        depth += 1
    for t in range(len(leaf)):
        for a in range(n_alive):
            i = alive[a]
            k = 0
            for _ in range(depth):
                value = box_feature(flat, offsets, weights, feature[t, k], starts[i])
                k = 2 * k + 1 + (value > threshold[t, k])
            score[i] += leaf[t, k - (leaf.shape[1] - 1)]
        if (t + 1) % CHECK_EVERY == 0:
            kept = 0
            for a in range(n_alive):
                if score[alive[a]] >= reject[t]:
                    alive[kept] = alive[a]
                    kept += 1
                else:
                    score[alive[a]] -= REJECTED
            n_alive = kept
    return score
