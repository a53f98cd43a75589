"""Smoothness over time that lets fast motion through.

Accelerations of pose and blend weights cost the square of their ratio to typical ones. A blink or a closing of
the lips lasts a frame or two and is no such motion. Where the frames by themselves say that lids or mouth
accelerate by more than noise can, their shapes are not bound to their neighbours.

What noise can is told by the quiet third of the frames, and is at most what the landmarks' deviations say: of
the points of lids or mouth, carried by the shapes that move them, that has the covariance
B (E' S^-1 E + prior)^-1 B'. Motion is judged in millimetres of these points, not in weights: shapes that do the
same trade places from frame to frame without moving anything. Frames 0.04 s apart are compared, whatever the rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.landmarks.sets import LandmarkSet
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.landmark_fit.timeline import Timeline

#: Beginnings of the names of the shapes that move together and fast.
FAST = {"lids": ("eyeBlink", "eyeSquint", "eyeWide"), "mouth": ("jaw", "mouth", "tongue")}
#: Seconds between the frames that are compared; exponent of the switch between bound and free.
_APART_S, _STEEP = 0.04, 8
#: Share of the frames that are quiet; least noise, over that of the landmarks' deviations.
_QUIET, _LEAST_NOISE = 1 / 3, 0.05


@dataclass(frozen=True)
class FastShapes:
    """Shapes that move together, and how much noise moves what they move.

    Attributes:
        ids: (n,) of the K shapes.
        basis_mm: (n, m) displacements of the points that they move, across the face.
        noise_mm: RMS deviation of these points in a single frame, by the landmarks' deviations.
    """

    ids: np.ndarray
    basis_mm: np.ndarray
    noise_mm: float

    def acceleration(
        self, weights: np.ndarray, timeline: Timeline, known: np.ndarray
    ) -> np.ndarray:
        """How much the points accelerate at each frame (F,), over what noise does.

        Args:
            weights: (F, K) of each frame by itself.
            timeline: of the frames.
            known: (F,) bool; the others say nothing.
        """
        reach = max(1, round(_APART_S * timeline.fps))
        result = np.zeros(len(weights))
        if len(weights) <= 2 * reach:
            return result
        found = weights[:, self.ids]
        change = found[: -2 * reach] - 2 * found[reach:-reach] + found[2 * reach :]
        moved = np.sqrt(((change @ self.basis_mm) ** 2).mean(axis=1))
        piece = timeline.piece
        apart = timeline.times_s[2 * reach :] - timeline.times_s[: -2 * reach]
        inside = (piece[2 * reach :] == piece[: -2 * reach]) & (
            apart < 3 * _APART_S + 2 / timeline.fps
        )
        for shift in (0, reach, 2 * reach):
            inside &= known[shift : len(known) - 2 * reach + shift]
        usual = np.sqrt(6) * self.noise_mm
        if inside.any():
            quiet = float(np.quantile(moved[inside], _QUIET))
            usual *= np.clip(quiet / usual, _LEAST_NOISE, 1.0)
        result[reach:-reach] = inside * moved / usual
        # What begins or ends a fast motion is part of it.
        spread = np.stack([np.roll(result, shift) for shift in range(-reach, reach + 1)])
        return spread.max(axis=0)


def fast_shapes(
    shape: LandmarkShape, sigma_mm: np.ndarray, weight_sigma: float
) -> tuple[FastShapes, ...]:
    """The groups of `FAST` that a person's shapes have.

    Args:
        shape: the person's landmarks.
        sigma_mm: (N,) deviations of the landmarks, infinite where there are none.
        weight_sigma: deviation of a blend weight about zero.
    """
    across = shape.expressions_mm[..., :2] / sigma_mm[:, None]
    flat = across.reshape(shape.n_expressions, -1)
    covariance = np.linalg.inv(flat @ flat.T + np.eye(shape.n_expressions) / weight_sigma**2)
    found = []
    for name, starts in FAST.items():
        ids = [k for k, shown in enumerate(shape.expression_names) if shown.startswith(starts)]
        points = _points_of(name, shape.landmark_set)
        if not ids:
            continue
        basis = shape.expressions_mm[ids][:, points, :2].reshape(len(ids), -1)
        variance = np.einsum("km,kl,lm->m", basis, covariance[np.ix_(ids, ids)], basis)
        noise_mm = float(np.sqrt(variance.mean()))
        if noise_mm > 0:
            found.append(FastShapes(np.array(ids), basis, noise_mm))
    return tuple(found)


def _points_of(name: str, landmark_set: LandmarkSet) -> np.ndarray:
    return landmark_set.mouth if name == "mouth" else landmark_set.groups["eyes"]


@dataclass(frozen=True)
class TemporalSmoothness:
    """The squares above, of x (F, P), P = 6 + K.

    Attributes:
        typical: (P,) accelerations, per second squared.
        timeline: of the frames.
        known: (F,) bool, frames that bind their neighbours.
        bound: (F, P) in [0, 1], how much a frame's parameters are bound to their neighbours.
    """

    typical: np.ndarray
    timeline: Timeline
    known: np.ndarray
    bound: np.ndarray

    @classmethod
    def of(
        cls,
        typical: np.ndarray,
        timeline: Timeline,
        known: np.ndarray,
        weights: np.ndarray,
        fast: tuple[FastShapes, ...],
        limit: float,
    ) -> TemporalSmoothness:
        """Bound as much as frames by themselves say.

        Args:
            typical: (P,) accelerations, per second squared.
            timeline: of the F frames.
            known: (F,) bool.
            weights: (F, K) of each frame by itself.
            fast: shapes that may move fast.
            limit: acceleration, over that of noise, that is half free.
        """
        first = len(typical) - weights.shape[1]
        bound = np.ones((len(weights), len(typical)))
        for shapes in fast:
            ratio = shapes.acceleration(weights, timeline, known) / limit
            bound[:, first + shapes.ids] = 1 / (1 + ratio[:, None] ** _STEEP)
        return cls(typical, timeline, known, bound)

    @property
    def weights(self) -> np.ndarray:
        """(F - 2, P) weights of squared accelerations (`Timeline.stencils`)."""
        binds = self.timeline.triples(self.known)[:, None] / self.typical**2
        return binds * self.bound[1:-1]

    def cost(self, x: np.ndarray) -> float:
        """The cost of x (F, P)."""
        if len(x) < 3:
            return 0.0
        stencil = self.timeline.stencils
        found = np.asarray(sum(stencil[:, k, None] * x[k : len(x) - 2 + k] for k in range(3)))
        return 0.5 * float((self.weights * found**2).sum())
