"""Area-weighted statistics and their confidence intervals over clips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Surface errors are counted in bins this wide; interpolation within a bin makes percentiles finer.
BIN_MM = 0.01
N_BINS = 3000


def histograms(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weight in each bin of `BIN_MM`, (F, N_BINS), of `values` (F, V) mm with `weights` (V,).

    Values beyond the last bin are counted in it.
    """
    chosen = weights > 0
    values = values[:, chosen]
    bins = np.clip(np.nan_to_num(values) / BIN_MM, 0, N_BINS - 1).astype(np.int64)
    bins += np.arange(len(values))[:, None] * N_BINS
    flat = np.where(np.isfinite(values), weights[chosen], 0.0).ravel()
    counts = np.bincount(bins.ravel(), weights=flat, minlength=len(values) * N_BINS)
    return counts.reshape(len(values), N_BINS)


def histogram_quantile(histogram: np.ndarray, q: float, draws: np.ndarray) -> np.ndarray:
    """Quantile in mm, interpolated within the bin, of sums of clips' histograms.

    The bin is found by bisection of the clips' cumulative histograms: the histogram of a sample is
    never formed.

    Args:
        histogram: (clips, N_BINS) weight in each bin.
        q: 0 to 1.
        draws: (samples, clips) how often each sample has each clip.

    Returns:
        (samples,); NaN where a sample has no weight.
    """
    cumulative = np.cumsum(histogram, axis=1).T
    counts = np.asarray(draws, dtype=np.float64)

    def below(last: np.ndarray) -> np.ndarray:
        """Weight of each sample in the bins up to `last` (samples,)."""
        return (counts * cumulative[last]).sum(axis=1)

    n_bins = len(cumulative)
    whole = counts @ cumulative[-1]
    target = q * whole
    low, high = np.zeros(len(counts), np.int64), np.full(len(counts), n_bins - 1)
    while (low < high).any():
        middle = (low + high) // 2
        short = below(middle) < target
        low, high = np.where(short, middle + 1, low), np.where(short, high, middle)
        low = np.minimum(low, high)
    inside = (counts * histogram.T[low]).sum(axis=1)
    before = below(low) - inside
    share = np.divide(target - before, inside, out=np.zeros_like(inside), where=inside > 0)
    return np.where(whole > 0, (low + share) * BIN_MM, np.nan)


def clips_of(frames: np.ndarray, clip_frames: int, min_clips: int = 1) -> np.ndarray:
    """Number (F,) of the clip of each of the `frames` (F,): runs of at most `clip_frames` consecutive frames.

    A gap in the frame numbers starts a new clip. Clips are shorter where there are too few frames
    for `min_clips` of them.
    """
    frames = np.asarray(frames)
    clip_frames = max(1, min(clip_frames, len(frames) // min_clips))
    clips = np.zeros(len(frames), dtype=np.int64)
    for index in range(1, len(frames)):
        start = np.flatnonzero(clips == clips[index - 1])[0]
        same = frames[index] == frames[index - 1] + 1 and index - start < clip_frames
        clips[index] = clips[index - 1] + (not same)
    return clips


@dataclass(frozen=True)
class Resampling:
    """How often each clip is drawn in each bootstrap sample.

    Attributes:
        draws: (samples, clips) int64.
        confidence: of the interval, such as 0.95.
    """

    draws: np.ndarray
    confidence: float

    @classmethod
    def of(cls, n_clips: int, samples: int, seed: int, confidence: float) -> Resampling:
        """Draw `n_clips` clips with replacement, `samples` times."""
        chosen = np.random.default_rng(seed).integers(0, n_clips, (samples, n_clips))
        draws = np.zeros((samples, n_clips), dtype=np.int64)
        np.add.at(draws, (np.arange(samples)[:, None], chosen), 1)
        return cls(draws, confidence)

    def interval(self, values: np.ndarray) -> tuple[float, float]:
        """Percentile interval of a statistic's `values` (samples,); NaN with under two clips."""
        values = values[np.isfinite(values)]
        if self.draws.shape[1] < 2 or len(values) == 0:
            return np.nan, np.nan
        tail = (1 - self.confidence) / 2
        low, high = np.quantile(values, [tail, 1 - tail])
        return float(low), float(high)
