"""FLAME's jaw and expression that give the corrected lips, in the parameters that the tracker wrote.

Root, neck, eyes and shape stay those of the track (the head moves where the correction moved it). Of all frames f
with vertices d_f, jaw and expression t_f, each scaled to [0, 1] over its range, minimise

    sum_f |M(t_f) - d_f|^2 / n + HOLD sum_f |t_f - track_f|^2 + SMOOTH sum_f |t_f - t_(f-1)|^2

over weighted vertices (n: the sum of their weights), by Newton steps with the curvature of a few frames: M is linear
in the expression, and a turn of the jaw carries all that hangs on it. What is then left and stands still in the
shot goes to `static_offset`, which any reader of these files adds at rest; the first principal component of the
rest is one more shape, `corrective`, with a weight in [-1, 1] a frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.export.animation import Animation
from vermilion.export.rig import LIPS
from vermilion.export.smoothed_gram import SmoothedGram
from vermilion.external.flame import METRE_MM, FlameTake
from vermilion.external.flame_model import JAW, SHAPES, Pose
from vermilion.geometry.alignment import similarity_alignment
from vermilion.tracking.landmark_fit.banded_qp import solve_in_box

#: mm^2 for a change over the whole range. SMOOTH is that of a rig's weights; HOLD decides only what lips do not show.
HOLD, SMOOTH = 2e-3, 2e-2
#: Ranges, wider where the track is: standard deviations of expression; radians of the jaw, whose x opens the mouth
#: (40 degrees are the widest that people reach).
_EXPRESSION = 4.0
_JAW_LOW, _JAW_HIGH = np.array([-0.1, -0.2, -0.2]), np.array([0.7, 0.2, 0.2])
#: Steps at most; the last lowers the energy by less than this share.
_STEPS, _GAIN = 8, 0.01
#: Offset and parameters in turn: later rounds move what the parameters show into the offset.
_ROUNDS = 2
_CURVED, _BLOCK = 5, 64  # frames whose curvature is taken; frames at once
_POWER = 50  # steps to the first principal component
#: A head that moved by less stands where the track has it.
_MOVED_MM = 0.01


@dataclass(frozen=True)
class FlameWeights:
    """Parameters of the corrected take, and what they leave of the lips.

    Attributes:
        take: parameters, static offset and corrective.
        alone_mm: (F,) mean distance over the lips by jaw and expression, with the track's own offset.
        offset_mm: (F,) the same with the static offset, without the corrective.
        corrected_mm: (F,) the same with the corrective.
    """

    take: FlameTake
    alone_mm: np.ndarray
    offset_mm: np.ndarray
    corrected_mm: np.ndarray


def solve_flame(
    animation: Animation, track: FlameTake, lips: np.ndarray, face: np.ndarray, steady: np.ndarray
) -> FlameWeights:
    """Parameters for the frames that both the animation and the track have.

    Args:
        animation: of the model's V vertices, in the frame and unit of the parameters.
        track: the parameters of the base.
        lips, face: (V,) bool, vertices of the vermilion, and all that are looked at.
        steady: (V,) bool, vertices that no expression moves.
    """
    has_mesh = {int(animation.frames[row]): row for row in animation.rows}
    track = track.of_rows(np.flatnonzero([int(frame) in has_mesh for frame in track.frames]))
    # One that an earlier correction left is found anew.
    track = replace(
        track, corrective=0.0 * track.corrective, corrective_weight=0.0 * track.corrective_weight
    )
    wanted = np.stack(
        [
            np.asarray(animation.vertices_mm[has_mesh[int(frame)]], np.float64) / animation.unit_mm
            for frame in track.frames
        ],
        dtype=np.float32,
    )
    track = _with_head_of(track, wanted, steady)
    solver = _Solver(track, wanted, lips, np.where(lips, LIPS, np.where(face, 1.0, 0.0)))
    alone = solver.solve(track)
    take, alone_mm = alone, solver.lips_mm(alone)
    for _ in range(_ROUNDS):
        offset = take.offset.copy()
        offset[: wanted.shape[1]] += solver.left_at_rest(take).mean(axis=0)
        take = solver.solve(replace(take, offset=offset))
    corrective, weight = _first_component(solver.left_at_rest(take), solver.trust)
    full = replace(take, corrective=corrective, corrective_weight=weight)
    return FlameWeights(full, alone_mm, solver.lips_mm(take), solver.lips_mm(full))


def _with_head_of(track: FlameTake, wanted: np.ndarray, steady: np.ndarray) -> FlameTake:
    """The track with the head where the frames wanted (F, V, 3), metres, have it."""
    poses, places = track.poses.copy(), track.translation.copy()
    for row in range(len(track.frames)):
        own = track.vertices(row)
        move = similarity_alignment(own[steady], wanted[row][steady], scale=1.0)
        if METRE_MM * np.abs(move.apply(own) - own).max() < _MOVED_MM:
            continue
        shaped = track.model.shaped(track.shape, track.expr[row], track.own_offset)
        root = (track.model.joints @ shaped)[0]
        turn = Rotation.from_matrix(move.rotation) * Rotation.from_rotvec(poses[row, :3])
        poses[row, :3] = turn.as_rotvec()
        places[row] = move.apply(root + places[row]) - root
    return replace(track, poses=poses, translation=places)


class _Solver:
    """Steps of the energy of this module; jaw first, then expression."""

    def __init__(self, track: FlameTake, wanted: np.ndarray, lips: np.ndarray, trust: np.ndarray):
        """Prepare for frames wanted (F, V, 3), metres; lips (V,) bool; weights trust (V,) of the vertices."""
        self.track, self.wanted, self.lips, self.trust = track, wanted, lips, trust
        self._share = METRE_MM**2 * trust / trust.sum()
        n_expr = track.expr.shape[1]
        shapes = track.model.shapes[..., SHAPES : SHAPES + n_expr]
        self._shapes = np.ascontiguousarray(shapes.reshape(-1, n_expr))
        start = _parameters(track)
        low = np.concatenate([_JAW_LOW, np.full(n_expr, -_EXPRESSION)])
        high = np.concatenate([_JAW_HIGH, np.full(n_expr, _EXPRESSION)])
        self._low = np.minimum(low, start.min(axis=0))
        self._span = np.maximum(high, start.max(axis=0)) - self._low
        rows = np.linspace(0, len(start) - 1, min(_CURVED, len(start))).astype(int)
        grams = [self._curvature(row) for row in np.unique(rows)]
        self._gram = np.mean(grams, axis=0) * np.outer(self._span, self._span)

    def solve(self, take: FlameTake) -> FlameTake:
        """The take with jaw and expression that minimise the energy, for its offset."""
        held = (_parameters(self.track) - self._low) / self._span
        found = (_parameters(take) - self._low) / self._span
        gram = self._gram + HOLD * np.eye(len(self._gram))
        matrix = SmoothedGram(gram, len(found), SMOOTH)
        best, least = take, np.inf
        for _ in range(_STEPS):
            pulls, energy = self._pulls(take)
            energy += HOLD * ((found - held) ** 2).sum()
            energy += SMOOTH * (np.diff(found, axis=0) ** 2).sum()
            gain, least = least - energy, min(energy, least)
            if gain > 0:
                best = take
            if not gain > _GAIN * energy:
                break
            target = pulls * self._span + found @ self._gram + HOLD * held
            found = solve_in_box(matrix, target, 0.0, 1.0, found)
            take = _with_parameters(take, self._low + self._span * found)
        return best

    def lips_mm(self, take: FlameTake) -> np.ndarray:
        """Mean distance (F,) over the lips, mm."""
        result = np.empty(len(take.frames))

        def keep(row: int, off: np.ndarray, pose: Pose) -> None:
            result[row] = METRE_MM * np.linalg.norm(off[self.lips], axis=1).mean()

        self._each(take, keep)
        return result

    def left_at_rest(self, take: FlameTake) -> np.ndarray:
        """What each frame misses, (F, V, 3) metres, in the frame of the mesh at rest; without what moves joints."""
        left = np.empty_like(self.wanted)

        def keep(row: int, off: np.ndarray, pose: Pose) -> None:
            rest = pose.at_rest(off)
            left[row] = rest - free @ (joints @ rest)

        # The nearest displacement that leaves the joints in place, which would turn all that hangs on them.
        joints = take.model.joints
        free = joints.T @ np.linalg.pinv((joints @ joints.T).toarray())
        self._each(take, keep)
        return left

    def _each(self, take: FlameTake, call: Callable[[int, np.ndarray, Pose], None]) -> None:
        """Call with row, what the mesh misses (V, 3), metres, and its `Pose`, of each frame."""
        model, turns = take.model, take.turns
        person = model.shaped(take.shape, np.zeros(0), take.own_offset)
        for start in range(0, len(take.frames), _BLOCK):
            moved = (take.expr[start : start + _BLOCK] @ self._shapes.T).reshape(-1, *person.shape)
            for row, shape in enumerate(moved, start=start):
                more = take.corrective_weight[row] * take.corrective
                pose = model.pose(person + shape + more, turns[row])
                call(row, self.wanted[row] - take.translation[row] - pose.vertices, pose)

    def _pulls(self, take: FlameTake) -> tuple[np.ndarray, float]:
        """Half the descent (F, 3 + E) of the first term of the energy, mm^2 for a unit; and that term."""
        jaw, at_rest, energy = [], np.empty((len(take.frames), len(self._shapes))), 0.0
        turns = take.turns[:, JAW]

        def pull(row: int, off: np.ndarray, pose: Pose) -> None:
            nonlocal energy
            forces = self._share[:, None] * off
            energy += float((forces * off).sum())
            jaw.append(take.model.jaw_pull(pose, turns[row], forces))
            at_rest[row] = take.model.pull(pose, forces).ravel()

        self._each(take, pull)
        return np.concatenate([np.array(jaw), at_rest @ self._shapes], axis=1), energy

    def _curvature(self, row: int) -> np.ndarray:
        """Products (3 + E, 3 + E) of the derivatives of the vertices in a frame of the track, mm^2 for a unit."""
        take, model = self.track, self.track.model
        shaped = model.shaped(take.shape, take.expr[row], take.own_offset)
        turns = take.turns[row]
        pose = model.pose(shaped, turns)
        columns = [*model.jaw_motion(pose, turns[JAW])]
        for shape in self._shapes.T:
            columns.append(
                model.pose(shaped + shape.reshape(-1, 3), turns).vertices - pose.vertices
            )
        flat = np.stack(columns).reshape(len(columns), -1)
        return (flat * np.repeat(self._share, 3)) @ flat.T


def _parameters(take: FlameTake) -> np.ndarray:
    """Jaw and expression (F, 3 + E)."""
    return np.concatenate([take.turns[:, JAW], take.expr], axis=1)


def _with_parameters(take: FlameTake, values: np.ndarray) -> FlameTake:
    poses = take.poses.copy()
    poses[:, 3 * JAW : 3 * JAW + 3] = values[:, :3]
    return replace(take, poses=poses, expr=values[:, 3:])


def _first_component(left: np.ndarray, trust: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The shape (V, 3) and weights (F,) in [-1, 1] whose product is nearest to left (F, V, 3)."""
    flat, heavy = left.reshape(len(left), -1), np.repeat(trust, 3).astype(np.float32)
    strength = ((flat * heavy) * flat).sum(axis=1)
    weights = np.zeros(len(flat), np.float32)
    weights[int(np.argmax(strength))] = 1.0
    for _ in range(_POWER):
        shape = weights @ flat / max(float(weights @ weights), 1e-12)
        weights = flat @ (shape * heavy) / max(float(shape @ (shape * heavy)), 1e-30)
    top = max(float(np.abs(weights).max(initial=0.0)), 1e-12)
    return (shape * top).reshape(-1, 3).astype(np.float64), (weights / top).astype(np.float64)
