"""A synthetic take: who acts, what they do, how they look and are lit, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.studio import rig
from vermilion.studio.lighting import LIGHTINGS, Lighting
from vermilion.studio.live_link import mirrored_weights, read_live_link
from vermilion.studio.look import Look, look_of
from vermilion.studio.own_expressions import with_own_expressions
from vermilion.studio.performance import (
    Performance,
    generated_weights,
    head_motion,
    random_poses,
    start_at_neutral,
)
from vermilion.studio.surface import StudioSurface
from vermilion.studio.take_settings import TakeSettings

if TYPE_CHECKING:
    from vermilion.studio.render import Scene

#: Largest turn of the heads of a `people` take: sideways, nodding, tilting (degrees).
FREE_TURN_DEG = (24.0, 11.0, 7.0)


@dataclass(frozen=True)
class StudioTakePlan:
    """Everything that decides the images of a take except its cameras and its noise.

    Attributes:
        identities: (F, I) coefficients of each frame's person.
        performance: curves and head motion, a row a frame.
        looks: seed of each frame's look, (F,).
        lighting: name of each frame's light, (F,).
        tattoo: whether the lips are painted.
    """

    model: FaceModel
    identities: np.ndarray
    performance: Performance
    looks: np.ndarray
    lighting: tuple[str, ...]
    tattoo: bool

    def __len__(self) -> int:
        return len(self.performance)

    def vertices_mm(self, index: int) -> np.ndarray:
        """World vertices (V, 3) of the index-th frame of the take."""
        performance = self.performance
        local = self.model.vertices(self.identities[index], performance.weights[index])
        return local @ performance.rotations[index].T + performance.translations_mm[index]

    def neutral_mm(self) -> np.ndarray:
        """Neutral (V, 3) of the first frame's person, expression weights 0, head at rest."""
        return self.model.neutral_of(self.identities[0])

    def look(self, index: int) -> Look:
        """Colours of the index-th frame's person."""
        return look_of(int(self.looks[index]), self.tattoo)

    def light(self, index: int) -> Lighting:
        """Light of the index-th frame."""
        return LIGHTINGS[self.lighting[index]]

    def scene(self, index: int, surface: StudioSurface, **rays: int) -> Scene:
        """What the renderer needs of the index-th frame."""
        from vermilion.studio.render import Scene

        return Scene(self.model.triangles, surface, self.look(index), self.light(index), **rays)


def identity_of(
    model: FaceModel, coefficients: Sequence[float] | None, seed: int, spread: float
) -> np.ndarray:
    """Identity coefficients (I,): those given (the rest 0), or drawn from the seed."""
    if coefficients is None:
        drawn = np.random.default_rng([seed, 7000]).standard_normal(model.n_identities)
        return spread * np.clip(drawn, -2.0, 2.0)
    identity = np.zeros(model.n_identities)
    given = np.asarray(coefficients, dtype=float)[: model.n_identities]
    identity[: len(given)] = given
    return identity


def plan_take(model: FaceModel, settings: TakeSettings) -> StudioTakePlan:
    """Plan a take; the first frame of an actor's take is the neutral, mouth slightly open."""
    actor, performance, motion = settings.actor, settings.performance, settings.motion
    n_frames, names = settings.n_frames, model.expression_names
    if performance.performance == "people":
        return plan_people(model, n_frames, actor.seed + performance.seed, actor.identity_spread)
    seed = int(np.random.default_rng([actor.seed, performance.seed]).integers(2**31))
    weights = _weights(settings, names, seed)
    weights = start_at_neutral(names, weights, motion.slight_open, motion.ease_in_frames)
    neck_mm = model.neutral_mm[model.landmarks[8]] + [0.0, -40.0, -70.0]
    head = head_motion(
        n_frames, settings.fps, seed, motion.head_turn_deg, motion.head_shift_mm, neck_mm
    )
    identity = identity_of(model, actor.identity, actor.seed, actor.identity_spread)
    return StudioTakePlan(
        model=with_own_expressions(model, actor.seed, actor.expression_spread),
        identities=np.broadcast_to(identity, (n_frames, len(identity))),
        performance=Performance(names, weights, *head),
        looks=np.full(n_frames, actor.seed),
        lighting=(performance.lights,) * n_frames,
        tattoo=settings.role == "tattoo",
    )


def _weights(settings: TakeSettings, names: tuple[str, ...], seed: int) -> np.ndarray:
    """Expression curves (F, K) of an actor's take, recorded or generated from the seed."""
    how, n_frames, fps = settings.performance, settings.n_frames, settings.fps
    if how.performance == "live_link":
        weights = read_live_link(how.csv, names, n_frames, fps, how.csv_first, how.csv_fps)
        weights = mirrored_weights(names, weights) if how.mirrored else weights
        return np.clip(how.gain * weights, 0.0, 1.0)
    intensity = settings.motion.intensity
    return generated_weights(names, n_frames, fps, seed, intensity, how.poses, how.pose_seconds)


def plan_people(model: FaceModel, n_frames: int, seed: int, spread: float) -> StudioTakePlan:
    """A take whose every frame has another random person, expression, pose and light."""
    rng = np.random.default_rng([seed, 7005])
    identities = spread * np.clip(rng.standard_normal((n_frames, model.n_identities)), -2, 2)
    angles = rng.uniform(-1, 1, (n_frames, 3)) * FREE_TURN_DEG
    rotations = Rotation.from_euler("yxz", angles, degrees=True).as_matrix()
    centre = model.neutral_mm[model.landmarks[27]] - [0.0, 0.0, 60.0]
    shift = rng.uniform(-1, 1, (n_frames, 3)) * [14.0, 12.0, 90.0]
    translations = centre - rotations @ centre + shift
    weights = random_poses(model.expression_names, n_frames, seed)
    kinds = sorted(LIGHTINGS)
    return StudioTakePlan(
        model=model,
        identities=identities,
        performance=Performance(model.expression_names, weights, rotations, translations),
        looks=rng.integers(2**31, size=n_frames),
        lighting=tuple(kinds[i] for i in rng.integers(len(kinds), size=n_frames)),
        tattoo=False,
    )


def cameras_of(plan: StudioTakePlan, role: str, settings: rig.RigSettings) -> dict[str, Camera]:
    """The rig of a multi-view take, or the camera of a video, aimed at the actor's neutral."""
    one_person = (plan.identities == plan.identities[0]).all()
    neutral = plan.neutral_mm() if one_person else plan.model.neutral_mm
    aimed = rig.lips16_rig if role in ("tattoo", "plain") else rig.video_camera
    return aimed(plan.model, neutral, settings)
