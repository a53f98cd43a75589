"""Two procedural people who speak with rolled lips, and the coarse track of a model that cannot.

Everything that comes before the correspondence is written as files, without images: H is the
truth, C is the tracker's model fitted to noisy landmarks, features are the model's weights and the
width and height of the lips.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from tests.heads import small_studio, small_tracker
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.mesh import submesh
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence
from vermilion.storage.tables import write_table
from vermilion.tracking.result import Identity, TrackedTake

N_FRAMES, CHUNK = 40, 20
CHUNKS = ["000000-000019", "000020-000039"]
TRAIN, TEST = range(0, 30), range(30, 40)
BAD_FRAME = 5  # the tracker says that it lost this one
LOST = {19: 0.5, 20: 0.7}  # frame -> how unlike the neutral's pattern that of the lips is; else 0.2
ACTIVE = (
    "jawOpen", "mouthPucker", "mouthSmile_L", "mouthSmile_R", "mouthRollUpper", "mouthRollLower",
    "mouthFunnel",
)  # fmt: skip


def models() -> tuple[FaceModel, FaceModel]:
    """(accurate model with expressions, coarse tracker model)."""
    studio = small_studio()
    keep = ~(studio.regions["teeth"] | studio.regions["eyes"])
    ids, triangles = submesh(studio.triangles, keep)
    renumber = np.full(studio.n_vertices, -1)
    renumber[ids] = np.arange(len(ids))
    accurate = replace(
        studio,
        neutral_mm=studio.neutral_mm[ids],
        triangles=triangles,
        expressions_mm=studio.expressions_mm[:, ids],
        identities_mm=studio.identities_mm[:, ids],
        uv=studio.uv[ids],
        regions={name: mask[ids] for name, mask in studio.regions.items()},
        landmarks=renumber[studio.landmarks],
        outer_contour=renumber[studio.outer_contour],
        inner_contour=renumber[studio.inner_contour],
    )
    return accurate, small_tracker()


def performance(model: FaceModel, seed: int) -> np.ndarray:
    """Smooth weights (F, K) that start at a slightly open neutral."""
    rng = np.random.default_rng(seed)
    time = np.arange(N_FRAMES) / 12.0
    weights = np.zeros((N_FRAMES, model.n_expressions))
    ease = np.clip(np.arange(N_FRAMES) / 6.0, 0, 1)
    for name in ACTIVE:
        wave = 0.5 + 0.5 * np.sin(rng.uniform(1.5, 4) * time + rng.uniform(0, 6))
        weights[:, model.expression_names.index(name)] = 0.7 * ease * wave**2
    weights[:, model.expression_names.index("jawOpen")] += 0.09
    return weights


def write_subject(root: Path, subject: str, accurate: FaceModel, tracker: FaceModel, seed: int):
    """Write all inputs of the stage; returns (features (F, M), truth (F, V_H, 3))."""
    rng = np.random.default_rng(seed)
    person = 0.7 * rng.normal(size=4)
    truth = accurate.vertices(person, performance(accurate, seed))
    seen = truth[:, accurate.landmarks] + rng.normal(scale=0.2, size=(N_FRAMES, 66, 3))
    weights, neutral = _fit(tracker, person + 0.1 * rng.normal(size=4), seen)
    local = neutral + np.tensordot(weights, tracker.expressions_mm.astype(float), axes=1)
    angles = np.stack([0.1 * np.sin(np.arange(N_FRAMES) / 9), 0.02 * np.arange(N_FRAMES) / 9], 1)
    rotation = Rotation.from_euler("yx", angles).as_matrix()
    translation = np.tile([3.0, -8.0, 40.0], (N_FRAMES, 1))

    def world(vertices):
        return vertices @ np.swapaxes(rotation, 1, 2) + translation[:, None]

    camera = pinhole(
        "face2",
        900.0,
        320,
        400,
        look_at(np.array([0.0, 0, 900]), np.zeros(3), np.array([0.0, 1, 0])),
    )
    folder = root / "takes" / subject / "rom"
    frames = np.arange(N_FRAMES)
    TrackedTake(
        frames, weights, np.array(tracker.expression_names), rotation, translation,
        frames != BAD_FRAME, np.ones(N_FRAMES), np.array(camera.name), np.array(camera.model),
        np.array(camera.params), np.array([320, 400]), camera.cam_from_world,
    ).save(folder / "tracking/fit.npz")  # fmt: skip
    Identity(
        person, neutral, np.zeros((66, 3)), np.array(["rom"]), np.array([900.0]), np.array([True])
    ).save(_made(root / f"subjects/{subject}/identity.npz"))
    coarse, high = world(local), world(truth)
    np.savez(_made(folder / "multiview/neutral.npz"), vertices_mm=high[0])
    features = np.column_stack([weights, _lip_sizes(seen)])
    names = [f"shape_{k:02d}" for k in range(weights.shape[1])] + ["outer_width", "outer_height_1"]
    for chunk in CHUNKS:
        first, last = (int(n) for n in chunk.split("-"))
        part = slice(first, last + 1)
        write_sequence(folder / f"tracking/C/{chunk}.npy", coarse[part])
        write_sequence(folder / f"multiview/H/{chunk}.npy", high[part])
        rows = [QualityRow(frame) for frame in range(first, last + 1)]
        write_quality(folder / f"multiview/quality/{chunk}.tsv", subject, "rom", "multiview", rows)
        drift = [
            {"frame": f, "camera": "all", "difference_vermilion": LOST.get(f, 0.2)}
            for f in frames[part]
        ]
        write_table(_made(folder / f"multiview/drift/{chunk}.tsv"), drift)
        np.savez(
            _made(folder / f"features/{chunk}.npz"), frames=frames[part],
            features=features[part], names=np.array(names), valid=np.ones(last + 1 - first, bool),
        )  # fmt: skip
    points = camera.project(high[:, accurate.landmarks])
    first = slice(0, CHUNK)
    LandmarkTrack(
        frames[first], points[first], np.ones((CHUNK, 66)), np.ones(CHUNK, dtype=bool)
    ).save(folder / f"landmarks/{CHUNKS[0]}.npz")
    write_srgb8(
        folder / f"inpaint/{CHUNKS[0]}/000000.png", np.full((400, 320, 3), 90, dtype=np.uint8)
    )
    return features, high


def _fit(tracker: FaceModel, identity: np.ndarray, seen: np.ndarray):
    """Weights in [0, 1] by least squares on landmarks, (F, K), and the neutral (V, 3)."""
    neutral = tracker.neutral_of(identity)
    basis = tracker.expressions_mm[:, tracker.landmarks].reshape(tracker.n_expressions, -1).T
    matrix = np.concatenate([basis, 3.0 * np.eye(tracker.n_expressions)])
    weights = []
    for points in seen:
        wanted = (points - neutral[tracker.landmarks]).ravel()
        right = np.concatenate([wanted, np.zeros(tracker.n_expressions)])
        weights.append(lsq_linear(matrix, right, (0, 1)).x)
    return np.array(weights), neutral


def _lip_sizes(seen: np.ndarray) -> np.ndarray:
    """Width and height of the lips over the distance of the eyes, (F, 2)."""
    eyes = np.linalg.norm(seen[:, 36] - seen[:, 45], axis=1)
    width = np.linalg.norm(seen[:, 58] - seen[:, 62], axis=1)
    height = np.linalg.norm(seen[:, 50] - seen[:, 55], axis=1)
    return np.stack([width, height], axis=1) / eyes[:, None]


def _made(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path
