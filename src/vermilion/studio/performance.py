"""What an actor does in a take: expression curves and the motion of the head.

Every take starts at the neutral with the mouth slightly open and eases into its curves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

#: Poses that generated curves visit, the most different first: ARKit weights (and outward rolls,
#: where a model has them); shapes that a model lacks are left out.
MOUTH_POSES: tuple[dict[str, float], ...] = (
    {"mouthRollLower": 0.75, "mouthRollUpper": 0.75, "jawOpen": 0.06},
    {"jawOpen": 0.55},
    {"mouthPucker": 0.85, "jawOpen": 0.08},
    {"mouthSmile_L": 0.90, "mouthSmile_R": 0.90, "mouthDimple_L": 0.3, "mouthDimple_R": 0.3},
    {"mouthFunnel": 0.80, "jawOpen": 0.25},
    {"mouthPress_L": 0.70, "mouthPress_R": 0.70, "mouthClose": 0.06, "jawOpen": 0.06},
    {"mouthRollOutLower": 0.7, "mouthRollOutUpper": 0.7, "jawOpen": 0.1},
    {"mouthLowerDown_L": 0.75, "mouthLowerDown_R": 0.75, "jawOpen": 0.08},
    {"mouthRollLower": 0.85, "jawOpen": 0.10},
    {"mouthUpperUp_L": 0.70, "mouthUpperUp_R": 0.70, "jawOpen": 0.12},
    {"mouthStretch_L": 0.70, "mouthStretch_R": 0.70, "jawOpen": 0.12},
    {"mouthRollUpper": 0.80, "jawOpen": 0.08},
    {"jawOpen": 0.30, "mouthSmile_L": 0.75, "mouthSmile_R": 0.75},
    {"mouthFrown_L": 0.75, "mouthFrown_R": 0.75, "mouthShrugLower": 0.35},
    {"mouthLeft": 0.70},
    {"mouthRight": 0.70},
    {"mouthRollOutLower": 0.8, "jawOpen": 0.1},
    {"mouthPucker": 0.45, "mouthFunnel": 0.45, "jawOpen": 0.35},
    {"jawLeft": 0.45, "jawOpen": 0.25},
    {"jawRight": 0.45, "jawOpen": 0.25},
    {"mouthShrugUpper": 0.5, "mouthShrugLower": 0.5},
    {"mouthSmile_L": 0.8, "mouthUpperUp_L": 0.3},
    {"mouthSmile_R": 0.8, "mouthUpperUp_R": 0.3},
)
_SIDED = ("browInnerUp", "browDown", "browOuterUp", "cheekSquint", "noseSneer", "eyeSquint")
#: Pairs; a shape without sides stands twice.
UPPER_FACE = ("browInnerUp", "browInnerUp", *(f"{name}_{side}" for name in _SIDED for side in "LR"))
OPENING = "jawOpen"


@dataclass(frozen=True)
class Performance:
    """Curves of one take.

    Attributes:
        names: K expression names, the model's.
        weights: (F, K) float64 in [0, 1].
        rotations: (F, 3, 3) and
        translations_mm: (F, 3): world_from_head; the identity in the first frame.
    """

    names: tuple[str, ...]
    weights: np.ndarray
    rotations: np.ndarray
    translations_mm: np.ndarray

    def __len__(self) -> int:
        return len(self.weights)


def generated_weights(
    names: tuple[str, ...],
    n_frames: int,
    fps: float,
    seed: int,
    intensity: float = 1.0,
    n_poses: int = 0,
    pose_seconds: tuple[float, float] = (0.22, 0.42),
) -> np.ndarray:
    """Curves (F, K) that visit the mouth poses in random order, with brows and blinks.

    The whole set (the first `n_poses` of it, or all where that is 0) is visited before one comes
    again. A pose takes `pose_seconds` (shortest, longest) to come; neighbouring poses blend into
    each other, mixtures included.
    """
    rng = np.random.default_rng([seed, 7002])
    poses = _poses(names)
    poses = poses[:n_poses] if n_poses else poses
    time_s, knots, values = 0.0, [0.0], [np.zeros(len(names))]
    end_s = n_frames / fps
    order: list[int] = []
    while time_s < end_s + 1.0:
        order = order or list(rng.permutation(len(poses)))
        pose = poses[order.pop()] * rng.uniform(0.7, 1.1)
        if rng.random() < 0.35:  # a mixture, as in speech
            pose = 0.6 * pose + 0.5 * poses[rng.integers(len(poses))]
        time_s += rng.uniform(*pose_seconds)
        knots.append(time_s)
        values.append(pose)
        if rng.random() < 0.3:
            time_s += rng.uniform(0.08, 0.2)
            knots.append(time_s)
            values.append(pose * rng.uniform(0.9, 1.0))
    weights = _eased(np.arange(n_frames) / fps, np.array(knots), np.array(values))
    weights += _upper_face(names, n_frames, fps, rng)
    return np.clip(weights * intensity, 0.0, 1.0)


def start_at_neutral(
    names: tuple[str, ...], weights: np.ndarray, slight_open: float, ease_in_frames: int
) -> np.ndarray:
    """Curves (F, K) that ease in from the neutral, mouth slightly open, in their first frame.

    `weights` (F, K) of the expressions `names`.
    """
    neutral = np.zeros(len(names))
    if OPENING in names:
        neutral[names.index(OPENING)] = slight_open
    share = np.clip(np.arange(len(weights)) / ease_in_frames, 0.0, 1.0)
    share = (share * share * (3.0 - 2.0 * share))[:, None]
    return neutral * (1.0 - share) + weights * share


def head_motion(
    n_frames: int, fps: float, seed: int, turn_deg: float, shift_mm: float, centre_mm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """world_from_head rotations (F, 3, 3) and translations (F, 3) mm: slow sways about a centre.

    `centre_mm` (3,) in the head frame. The first frame is the identity.
    """
    rng = np.random.default_rng([seed, 7003])
    time_s = np.arange(n_frames) / fps
    waves = np.zeros((n_frames, 6))
    for _ in range(3):
        hertz, phase = rng.uniform(0.1, 0.5, 6), rng.uniform(0, 2 * np.pi, 6)
        waves += (np.sin(2 * np.pi * hertz * time_s[:, None] + phase) - np.sin(phase)) / 6.0
    share = np.clip(time_s / 0.5, 0.0, 1.0)[:, None]
    waves *= share * share * (3.0 - 2.0 * share)
    rotations = Rotation.from_rotvec(np.radians(turn_deg) * waves[:, :3]).as_matrix()
    centre = np.asarray(centre_mm, dtype=float)
    return rotations, shift_mm * waves[:, 3:] + centre - rotations @ centre


def random_poses(names: tuple[str, ...], count: int, seed: int) -> np.ndarray:
    """Independent expressions (count, K): a mouth pose or a mixture, brows, blinks."""
    rng = np.random.default_rng([seed, 7004])
    poses = _poses(names)
    weights = np.zeros((count, len(names)))
    for row in weights:
        first, second = rng.integers(len(poses), size=2)
        row += rng.uniform(0, 1.0) * poses[first] + rng.uniform(0, 0.6) * poses[second]
        if OPENING in names:
            row[names.index(OPENING)] += rng.uniform(0.0, 0.35)
        for name in UPPER_FACE:
            if name in names and rng.random() < 0.25:
                row[names.index(name)] += rng.uniform(0.0, 0.8)
        blink = rng.uniform(0.0, 1.0) if rng.random() < 0.2 else rng.uniform(0.0, 0.2)
        _add_blink(row[None], names, np.array([blink]))
    return np.clip(weights, 0.0, 1.0)


def _poses(names: tuple[str, ...]) -> list[np.ndarray]:
    """The poses (K,) that a model with these expressions can take."""
    return [pose for pose in (_pose(weights, names) for weights in MOUTH_POSES) if pose.any()]


def _pose(weights: dict[str, float], names: tuple[str, ...]) -> np.ndarray:
    pose = np.zeros(len(names))
    for name, value in weights.items():
        if name in names:
            pose[names.index(name)] = value
    only_opening = OPENING in names and not np.delete(pose, names.index(OPENING)).any()
    return pose if len(weights) == 1 or not only_opening else np.zeros(len(names))


def _eased(time_s: np.ndarray, knots_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Between knots, a step whose speed is zero at both ends."""
    index = np.clip(np.searchsorted(knots_s, time_s, side="right") - 1, 0, len(knots_s) - 2)
    t = (time_s - knots_s[index]) / (knots_s[index + 1] - knots_s[index])
    t = np.clip(t, 0.0, 1.0)
    t = (t * t * (3.0 - 2.0 * t))[:, None]
    return values[index] * (1.0 - t) + values[index + 1] * t


def _upper_face(names: tuple[str, ...], n_frames: int, fps: float, rng) -> np.ndarray:
    time_s = np.arange(n_frames) / fps
    weights = np.zeros((n_frames, len(names)))
    for left, right in zip(UPPER_FACE[::2], UPPER_FACE[1::2], strict=True):
        hertz, phase = rng.uniform(0.15, 0.6), rng.uniform(0, 2 * np.pi)
        curve = 0.5 * np.clip(np.sin(2 * np.pi * hertz * time_s + phase) - 0.3, 0.0, 1.0)
        for name in (left, right):
            if name in names:
                weights[:, names.index(name)] = curve
    next_s = rng.uniform(0.8, 3.0)
    while next_s < n_frames / fps:
        blink = np.clip(1.0 - np.abs(time_s - next_s) / 0.13, 0.0, 1.0)
        _add_blink(weights, names, 0.95 * blink)
        next_s += rng.uniform(2.0, 4.5)
    return weights


def _add_blink(weights: np.ndarray, names: tuple[str, ...], blink: np.ndarray) -> None:
    for name in ("eyeBlink_L", "eyeBlink_R"):
        if name in names:
            column = names.index(name)
            weights[:, column] = np.maximum(weights[:, column], blink)
