"""A small animated head for the tests of files that other programs open."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.unit.evaluation_face import sheet_face
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.geometry.camera import Camera, look_at
from vermilion.geometry.polygons import Polygons

FRAMES = np.array([10, 11, 12, 13, 15])
NAMES = ("jawOpen", "mouthSmile_L")


def plate_camera() -> Camera:
    """A calibrated camera with a principal point off the middle, its world y up."""
    pose = look_at(np.array([60.0, 20, 700]), np.array([0.0, 0, 10]), np.array([0.0, 1, 0]))
    return Camera("cam", "PINHOLE", (1500.0, 1480.0, 300.0, 260.0), 640, 480, pose)


def animated_head(frames: np.ndarray = FRAMES, camera: Camera | None = None, **more) -> Animation:
    """A sheet face that turns, moves and opens its mouth, with corrections outside its shapes."""
    model, rng = sheet_face(), np.random.default_rng(3)
    count, n = len(frames), model.n_vertices
    near = np.exp(-(model.neutral_mm[:, :2] ** 2).sum(axis=1) / 600)[:, None]
    shapes = np.stack([near * [0, -8.0, 0], near * [4.0, 3.0, -1.0]])
    weights = np.clip(rng.random((count, 2)), 0, 1)
    steps = np.arange(count)
    turn = Rotation.from_euler("yx", np.stack([4.0 * steps, -2.0 * steps], axis=1), degrees=True)
    head = HeadFrame(turn.as_matrix(), np.stack([2.0 * steps, 0 * steps, 5 - steps], axis=1))
    rest = near * rng.normal(0, 0.7, (count, n, 3))
    local = model.neutral_mm + np.tensordot(weights, shapes, axes=1) + rest
    world = np.stack([head.to_world(row, mesh) for row, mesh in enumerate(local)])
    uv = (model.neutral_mm[:, :2] / 130 + 0.5).astype(np.float32)
    return Animation(
        frames, 25.0, world.astype(np.float32), Polygons.with_quads(ordered(model.triangles)),
        model.neutral_mm, head, NamedShapes(NAMES, shapes, weights), 1.0, uv,
        plate_camera() if camera is None else camera, **more,
    )  # fmt: skip


def ordered(triangles: np.ndarray) -> np.ndarray:
    """Triangles (T, 3) of the sheet with the two of each square one after the other."""
    half = len(triangles) // 2
    return np.stack([triangles[:half], triangles[half:]], axis=1).reshape(-1, 3)
