"""When the frames of a take were seen, and where it is cut: what derivatives over time are taken of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Timeline:
    """Times of the F frames of a take.

    Attributes:
        times_s: (F,) ascending.
        piece: (F,) int piece between cuts of each frame.
    """

    times_s: np.ndarray
    piece: np.ndarray

    @classmethod
    def of(
        cls,
        n_frames: int,
        fps: float,
        piece: np.ndarray | None = None,
        times_s: np.ndarray | None = None,
    ) -> Timeline:
        """Evenly spaced where no times are given.

        Args:
            fps: frames a second.
            piece: (F,) int piece of each frame; None: no cuts.
            times_s: (F,) times of the frames; None: even.
        """
        times = np.arange(n_frames) / fps if times_s is None else np.asarray(times_s, dtype=float)
        pieces = np.zeros(n_frames, dtype=np.int64) if piece is None else np.asarray(piece)
        return cls(times, pieces)

    @property
    def fps(self) -> float:
        """Frames a second, of the median interval."""
        return 1.0 / float(np.median(np.diff(self.times_s))) if len(self.times_s) > 1 else 1.0

    @property
    def joined(self) -> np.ndarray:
        """(F - 1,) bool, whether a frame and the next are of one piece."""
        return self.piece[1:] == self.piece[:-1]

    @property
    def stencils(self) -> np.ndarray:
        """(F - 2, 3) factors on three frames in a row that give an acceleration, per second squared."""
        step = np.diff(self.times_s)
        before, after = step[:-1], step[1:]
        whole = before + after
        outer = [2 / (whole * before), -2 / (before * after), 2 / (whole * after)]
        return np.stack(outer, axis=-1).reshape(-1, 3)

    def triples(self, known: np.ndarray) -> np.ndarray:
        """(F - 2,) bool, whether three frames in a row are `known` (F,) and of one piece."""
        joined = self.joined
        return known[:-2] & known[1:-1] & known[2:] & joined[:-1] & joined[1:]

    def bridges(self, known: np.ndarray) -> np.ndarray:
        """(F - 1,) bool, neighbours that something must hold together: one of them is not `known` (F,).

        Never across a cut, unless all of a piece is unknown.
        """
        empty = ~np.isin(self.piece, self.piece[known])
        lost = ~(known[:-1] & known[1:])
        return lost & (self.joined | empty[:-1] | empty[1:])
