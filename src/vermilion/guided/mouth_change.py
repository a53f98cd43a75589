"""How a sequence's whole mouth region was wrong, carried from corrected frames to the others.

Guided18 trusts the mouth region and holds the inner lips at their border. The track of a monocular
tracker is wrong further out: chin and cheeks lie at the wrong depth, and lips held by them stay wrong
whatever their gradients. Here the displacement d of the mouth region, head frame, is a Gaussian
process over the base frames' deformations y:

    k(f, g) = y_f . y_g / s + offset,        d = K(., frames) (K + ridge I)^-1 d(frames),

with s the mean |y|^2 of the corrected frames. Far from them it goes to zero: the base stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

#: Variance of what is wrong in every frame alike, and of a frame by itself, beside what follows y.
OFFSET, RIDGE = 0.05, 0.1


@dataclass(frozen=True)
class MouthChange:
    """A fitted change.

    Attributes:
        deformations: (k, D) of the corrected frames.
        weights_mm: (k, 3U), (K + ridge I)^-1 d.
        scale: s.
    """

    deformations: np.ndarray
    weights_mm: np.ndarray
    scale: float

    @classmethod
    def of(cls, deformations: np.ndarray, moved_mm: np.ndarray) -> Self:
        """Learn from k frames: `deformations` (k, D) from the neutral, displacements `moved_mm` (k, U, 3)."""
        y = np.asarray(deformations, dtype=np.float64)
        scale = max(float((y**2).sum(axis=1).mean()), 1e-300)
        system = y @ y.T / scale + OFFSET + RIDGE * np.eye(len(y))
        return cls(y, np.linalg.solve(system, moved_mm.reshape(len(y), -1)), scale)

    def predict(self, deformations: np.ndarray) -> np.ndarray:
        """Displacements (F, U, 3) mm of frames with deformations (F, D)."""
        kernel = deformations @ self.deformations.T / self.scale + OFFSET
        return (kernel @ self.weights_mm).reshape(len(deformations), -1, 3)

    def arrays(self) -> dict[str, np.ndarray]:
        """What `from_arrays` needs, for a `.npz`: (k, D), (k, 3U) and a number."""
        return {
            "change_deformations": self.deformations,
            "change_weights_mm": self.weights_mm,
            "change_scale": np.array(self.scale),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> Self | None:
        """The change of what `arrays` gave, (k, D) and (k, 3U); None where there is none."""
        if "change_scale" not in arrays:
            return None
        deformations, weights_mm = arrays["change_deformations"], arrays["change_weights_mm"]
        return cls(deformations, weights_mm, float(arrays["change_scale"]))
