"""What a synthetic take is planned from, as frozen nouns of plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Actor:
    """Who acts.

    Attributes:
        seed: of shape and skin.
        identity: coefficients (standard deviations); None: drawn from the seed.
        identity_spread: deviation of drawn coefficients.
        expression_spread: how far the actor's expressions are from the model's (`with_own_expressions`).
    """

    seed: int
    identity: Sequence[float] | None
    identity_spread: float
    expression_spread: float


@dataclass(frozen=True)
class PerformanceSettings:
    """What is acted, as the section of a take in the configuration.

    Attributes:
        performance: `generated`, `live_link` or `people`.
        seed: of the curves and of the head's motion.
        poses: how many mouth poses generated curves visit (0: all).
        pose_seconds: shortest and longest time that a pose takes to come.
        csv: the recorded curves of `live_link`, "" for the others.
        csv_first, csv_fps: first row used, and rows a second.
        mirrored: whether left and right of the recording are exchanged.
        gain: factor of the recorded weights.
        lights: name of the light.
    """

    performance: str
    seed: int
    poses: int
    pose_seconds: tuple[float, float]
    csv: str
    csv_first: int
    csv_fps: float
    mirrored: bool
    gain: float
    lights: str


@dataclass(frozen=True)
class MotionSettings:
    """How large the motion of all takes is.

    Attributes:
        slight_open: weight of jawOpen in the first frame.
        ease_in_frames: frames from the neutral into the performance.
        intensity: scale of generated expressions.
        head_turn_deg, head_shift_mm: largest turn and shift of the head.
    """

    slight_open: float
    ease_in_frames: int
    intensity: float
    head_turn_deg: float
    head_shift_mm: float


@dataclass(frozen=True)
class TakeSettings:
    """What a take is planned from; `role` is that of the take sheet: only `tattoo` paints the lips."""

    role: str
    n_frames: int
    fps: float
    actor: Actor
    performance: PerformanceSettings
    motion: MotionSettings


def take_settings(values: Mapping[str, Any]) -> TakeSettings:
    """Settings of a take from plain values.

    Args:
        values: `role`, `first`, `last`, `fps` of the take sheet; `actor` with `seed` and `identity`;
            `performance` with the fields of `PerformanceSettings`; `seed`, `identity_spread`
            and `expression_spread` of the studio, and the fields of `MotionSettings`.
    """
    actor, performance = values["actor"], dict(values["performance"])
    seed = int(np.random.default_rng([values["seed"], actor["seed"]]).integers(2**31))
    performance["csv"] = performance["csv"] or ""
    shortest_s, longest_s = performance["pose_seconds"]
    performance["pose_seconds"] = (shortest_s, longest_s)
    return TakeSettings(
        role=values["role"],
        n_frames=values["last"] - values["first"] + 1,
        fps=values["fps"],
        actor=Actor(
            seed, actor["identity"], values["identity_spread"], values["expression_spread"]
        ),
        performance=PerformanceSettings(**performance),
        motion=MotionSettings(**{key.name: values[key.name] for key in fields(MotionSettings)}),
    )
