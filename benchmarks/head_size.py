"""How large a head is: the face model alone, a measured distance of the pupils, irises.

Random people of all the face model's identities, seen by one camera of unknown focal length: their landmarks,
with noise and with an offset a landmark that stays, are what the identity is fitted to, with the identities and
the priors of the tracker. Printed is by how much the size of the found neutral is off (percent; over the
landmarks but the jaw's, after a similarity alignment): mean absolute value and greatest.

- `model`: as it is found;
- `pupils`: scaled until the pupils are as far apart as in truth;
- `pupils, share`: by a share of that, as faces differ in proportion too; the share is chosen on the first half
  of the people, the figures are of the other half;
- `irises`: the same share method for a distance that irises of 11.7 mm tell, people's differing by 0.5 mm; the
  diameter that a network finds is off by `--iris-noise`.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.common import print_table
from vermilion.config.face_model import FaceModelConfig
from vermilion.config.tracking import TrackingConfig
from vermilion.faces.build import FaceModelSettings, build_tracker
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.rotations import rotation_matrix
from vermilion.landmarks.scheme import JAW
from vermilion.studio.performance import random_poses
from vermilion.tracking.identity.head_size import pupil_distance_mm
from vermilion.tracking.identity.landmark_identity import IdentitySettings, TakeSample, fit_identity
from vermilion.tracking.landmark_fit.observation import Observations
from vermilion.tracking.settings import identity_settings

PEOPLE_IDENTITIES, FRAMES, TURN_DEG = 100, 16, 20.0
FOCAL_PX, GUESS_PX, DISTANCE_MM = 1500.0, 1536.0, 700.0
IRIS_MM, IRIS_SPREAD_MM = 11.7, 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--people", type=int, default=60, help="random people (%(default)s)")
    parser.add_argument("--face-model", choices=("ict", "procedural"), default="ict")
    parser.add_argument("--path", help="folder or archive of ICT-FaceKit")
    parser.add_argument(
        "--iris-noise", type=float, default=0.03, help="deviation of a diameter (%(default)s of it)"
    )


def run(arguments: argparse.Namespace) -> None:
    name, path = arguments.face_model, arguments.path
    people = tracker_of(name, path, tracker_identities=PEOPLE_IDENTITIES)
    tracker = tracker_of(name, path)
    found = [found_size(people, tracker, seed) for seed in range(arguments.people)]
    size, pupils = (np.array(part) for part in zip(*found, strict=True))
    spread = np.hypot(IRIS_SPREAD_MM / IRIS_MM, arguments.iris_noise)
    irises = pupils + np.random.default_rng(0).normal(scale=spread, size=len(pupils))
    half = len(size) // 2
    rows = [_row("model", None, size[half:]), _row("pupils", None, (size - pupils)[half:])]
    for name, told in (("pupils, share", pupils), ("irises, share", irises)):
        share = float(told[:half] @ size[:half] / (told[:half] @ told[:half]))
        rows.append(_row(name, share, (size - share * told)[half:]))
    print_table(rows)


def _row(name: str, share: float | None, left: np.ndarray) -> dict[str, object]:
    off = 100 * np.abs(left)
    return {"told by": name, "share": share, "off (%)": off.mean(), "most (%)": off.max()}


def tracker_of(name: str, path: str | None, **changes: int) -> FaceModel:
    """The face model of the tracker by the configuration's defaults, with some values changed."""
    config = FaceModelConfig.model_validate({"name": name, "path": path, **changes})
    return build_tracker(config.name, config.path, FaceModelSettings.of(config.model_dump()))


def found_size(people: FaceModel, tracker: FaceModel, seed: int) -> tuple[float, float]:
    """Logarithms of the truth over what was found of a random person: size, distance of the pupils."""
    random = np.random.default_rng([seed, 31])
    true = people.neutral_of(random.normal(size=people.n_identities))
    cfg = TrackingConfig().model_dump(mode="json")
    settings = identity_settings(cfg["fit"], cfg["identity"])
    person = fit_identity(tracker, [seen(people, true, settings, random)], settings).identity
    neutral = tracker.neutral_of(person)
    marks = len(JAW)
    aligned = similarity_alignment(
        neutral[tracker.landmarks][marks:], true[people.landmarks][marks:]
    )
    apart = pupil_distance_mm(people, true) / pupil_distance_mm(tracker, neutral)
    return float(np.log(aligned.scale)), float(np.log(apart))


def seen(
    people: FaceModel,
    neutral_mm: np.ndarray,
    settings: IdentitySettings,
    random: np.random.Generator,
) -> TakeSample:
    """Landmarks of a video of a person, neutral (V, 3) mm: head turning, mouth moving, detector's errors."""
    marks = people.landmarks
    weights = random_poses(people.expression_names, FRAMES, int(random.integers(2**31)))
    heads = neutral_mm[marks] + np.tensordot(weights, people.expressions_mm[:, marks], axes=1)
    iod = np.linalg.norm(neutral_mm[marks[36]] - neutral_mm[marks[45]])
    own = random.normal(size=(len(marks), 3)) * (iod * settings.bias.per_landmark())[:, None]
    turns = np.radians(random.uniform(-TURN_DEG, TURN_DEG, size=(FRAMES, 3)) * [0.6, 1.0, 0.3])
    facing = np.diag([1.0, -1.0, -1.0])  # the head's y up and z forward, the camera's down and away
    points = (heads + 0.5 * own) @ np.swapaxes(facing @ rotation_matrix(turns), 1, 2)
    points[..., 2] += DISTANCE_MM
    image = FOCAL_PX * points[..., :2] / points[..., 2:]
    noise = settings.fit.noise.per_landmark() * iod * FOCAL_PX / DISTANCE_MM
    image = image + 0.5 * random.normal(size=image.shape) * noise[:, None]
    known = np.ones(FRAMES, dtype=bool)
    sample = Observations(image, np.ones(image.shape[:2]), known)
    return TakeSample("video", sample, GUESS_PX, False, np.zeros(FRAMES, dtype=bool))
