"""A face of 66 vertices, its landmarks, for tests of fitting: known shape, known motion."""

from __future__ import annotations

import numpy as np

from vermilion.faces.model import REGIONS, FaceModel
from vermilion.landmarks.scheme import BROWS, EYE_LEFT, EYE_RIGHT, JAW, LIP_INNER, LIP_OUTER, NOSE


def landmark_layout() -> np.ndarray:
    """(66, 3) mm in the head frame: x to the subject's left, y up, z out of the face."""
    points = np.zeros((66, 3))
    angle = np.radians(np.linspace(-100, 100, 17))
    points[JAW] = np.stack(
        [70 * np.sin(angle), 5 - 75 * np.cos(angle), 10 + 45 * np.cos(angle)], axis=1
    )
    x = np.concatenate([np.linspace(-55, -15, 5), np.linspace(15, 55, 5)])
    points[BROWS] = np.stack([x, 52 + 4 * np.cos(x / 14), 75 - (x / 14) ** 2], axis=1)
    points[NOSE[:4]] = [[0, 30, 80], [0, 20, 87], [0, 10, 94], [0, 0, 100]]
    points[NOSE[4:]] = [[-14, -8, 80], [-7, -10, 86], [0, -11, 88], [7, -10, 86], [14, -8, 80]]
    turn = np.radians([180, 120, 60, 0, -60, -120])
    for ids, centre in ((EYE_RIGHT, -32), (EYE_LEFT, 32)):
        eye = [centre + 14 * np.cos(turn), 32 + 6 * np.sin(turn), np.full(6, 70.0)]
        points[ids] = np.stack(eye, axis=1)
    turn = np.radians(180 - np.arange(12) * 30.0)
    points[LIP_OUTER] = np.stack(
        [26 * np.cos(turn), -38 + 11 * np.sin(turn), 84 - 8 * np.cos(turn) ** 2], axis=1
    )
    turn = np.radians(180 - np.arange(8) * 45.0)
    points[LIP_INNER] = np.stack(
        [26 * np.cos(turn), -38 + 3 * np.sin(turn), 84 - 8 * np.cos(turn) ** 2], axis=1
    )
    return points


def synthetic_model(n_identities: int = 4) -> FaceModel:
    """Six expressions (jaw, two smiles, pucker, two brows) and smooth identities."""
    points = landmark_layout()
    expressions = np.zeros((6, 66, 3))
    lower = np.array([53, 54, 55, 56, 57, 63, 64, 65])
    expressions[0, lower] = [0, -18, -4]
    expressions[0, JAW[4:13]] = [0, -18, -6]
    expressions[0, [58, 62]] = [0, -7, -2]
    for k, corner in ((1, [58, 48, 57]), (2, [62, 52, 53])):
        expressions[k, corner] = [-9 if k == 1 else 9, 7, -3]
    mouth = np.arange(48, 66)
    expressions[3, mouth] = np.stack(
        [-0.45 * points[mouth, 0], np.zeros(18), np.full(18, 7.0)], axis=1
    )
    expressions[4, BROWS[:5]] = [0, 9, 0]
    expressions[5, BROWS[5:]] = [0, 9, 0]
    rng = np.random.default_rng(3)
    identities = np.stack([_wave(points, rng) for _ in range(n_identities)])
    everywhere = np.ones(66, dtype=bool)
    return FaceModel(
        name="synthetic",
        neutral_mm=points,
        triangles=np.stack([np.arange(64), np.arange(1, 65), np.arange(2, 66)], axis=1),
        expression_names=("jawOpen", "smile_R", "smile_L", "pucker", "brow_R", "brow_L"),
        expressions_mm=expressions,
        identities_mm=identities,
        uv=np.zeros((66, 2), dtype=np.float32),
        landmarks=np.arange(66),
        outer_contour=LIP_OUTER,
        inner_contour=LIP_INNER,
        regions={name: everywhere & (name in ("face", "rigid")) for name in REGIONS},
    )


def _wave(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A smooth displacement of about 2 mm."""
    direction, phase = rng.normal(size=(3, 3)) / 60, rng.uniform(0, 6, 3)
    return 2.5 * np.sin(points @ direction + phase)
