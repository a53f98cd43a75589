"""The rows that a regressor trains on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TrainingSet:
    """Rows that a regressor trains on, takes one after the other, each in order of time.

    Attributes:
        features: (F, M) float32.
        layers: (F, T * 9) float32.
        displacements_mm: (F, N * 3) float32 at the corners of the mask.
        sequences: (F,) int index into `takes`.
        takes: names `subject/take`.
        frames: (F,) int32 frame numbers.
        neutrals_mm: subject -> (V, 3) coarse neutral, in the order of `subjects`.
        neutral_features: subject -> (M,) features of their neutral frame, of those who have any.
    """

    features: np.ndarray
    layers: np.ndarray
    displacements_mm: np.ndarray
    sequences: np.ndarray
    takes: tuple[str, ...]
    frames: np.ndarray
    neutrals_mm: dict[str, np.ndarray]
    neutral_features: dict[str, np.ndarray]

    @property
    def subjects(self) -> tuple[str, ...]:
        """People who have a row, sorted."""
        present = {self.takes[k].split("/")[0] for k in np.unique(self.sequences)}
        return tuple(sorted(present))

    @property
    def persons(self) -> np.ndarray:
        """(F,) int index into `subjects`."""
        of_take = [self.takes[k].split("/")[0] for k in range(len(self.takes))]
        index = [self.subjects.index(s) if s in self.subjects else -1 for s in of_take]
        return np.asarray(index, dtype=np.int64)[self.sequences]

    @property
    def first_rows(self) -> np.ndarray:
        """(G',) rows of the neutrals, with which takes begin, of the `subjects` whose first frame trains."""
        first = np.unique(self.persons, return_index=True)[1]
        return first[self.frames[first] == self.frames[first].min()]

    def frames_of_takes(self) -> dict[str, np.ndarray]:
        """Take -> frame numbers (n,) of its rows, of the takes that have any."""
        rows = {take: self.sequences == k for k, take in enumerate(self.takes)}
        return {take: self.frames[of_take] for take, of_take in rows.items() if of_take.any()}
