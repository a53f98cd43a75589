"""A painted dome as a face model, and images of it: known pose, expression, light and albedo."""

from __future__ import annotations

import numpy as np

from vermilion.appearance.harmonics import irradiance
from vermilion.faces.model import REGIONS, FaceModel
from vermilion.geometry.camera import Camera, pinhole
from vermilion.geometry.mesh import normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.geometry.rotations import rotation_matrix
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.tracking.image_fit.take import TakeStart
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import LandmarkFitSettings

SIDE = 41
CAMERA = pinhole("cam", 1200.0, 360, 360)
LIGHT = np.zeros((9, 3))
LIGHT[0], LIGHT[1], LIGHT[2], LIGHT[3] = 0.8, -0.25, -0.35, 0.2
FACING = np.diag([1.0, -1.0, -1.0])  # head to camera: y up to y down


def dome() -> FaceModel:
    """A dome 120 mm wide with three expressions, each a smooth bump that slides sideways."""
    x, y = np.meshgrid(np.linspace(-60, 60, SIDE), np.linspace(-60, 60, SIDE))
    x, y = x.ravel(), y.ravel()
    points = np.stack([x, y, 60 - (x**2 + y**2) / 120], axis=1)
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    triangles = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + SIDE], axis=1),
            np.stack([corner + 1, corner + SIDE + 1, corner + SIDE], axis=1),
        ]
    )
    shapes = []
    for centre, move in (((-20, -20), (6, 0, 0)), ((20, -20), (0, 6, 0)), ((0, 25), (0, -5, 3))):
        near = np.exp(-((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (2 * 12.0**2))
        shapes.append(near[:, None] * np.array(move, dtype=float))
    all_of_it = np.ones(len(points), dtype=bool)
    n_landmarks = np.linspace(0, len(points) - 1, 66).astype(np.int32)
    return FaceModel(
        name="dome",
        neutral_mm=points,
        triangles=triangles.astype(np.int32),
        expression_names=("a", "b", "c"),
        expressions_mm=np.array(shapes, dtype=np.float32),
        identities_mm=np.zeros((0, len(points), 3), dtype=np.float32),
        uv=(points[:, :2] / 120 + 0.5).astype(np.float32),
        landmarks=n_landmarks,
        outer_contour=np.arange(4, dtype=np.int32),
        inner_contour=np.arange(4, dtype=np.int32),
        regions={name: all_of_it if name == "face" else ~all_of_it for name in REGIONS},
    )


def paint(model: FaceModel) -> np.ndarray:
    """Smooth blotches on one skin colour, (V, 3) linear."""
    x, y = model.neutral_mm[:, 0], model.neutral_mm[:, 1]
    blotches = np.sin(x / 5) * np.cos(y / 6 + 1) + np.sin((x + y) / 7) * np.cos((x - y) / 9)
    return np.array([0.45, 0.33, 0.27]) * (1 + 0.25 * blotches)[:, None]


def motion(n_frames: int) -> np.ndarray:
    """(F, 6 + 3): a head that turns slowly while its expression changes."""
    t = np.arange(n_frames) / 10
    x = np.zeros((n_frames, 9))
    x[:, 0], x[:, 1] = 0.10 * np.sin(t), 0.15 * np.cos(t)
    x[:, 3], x[:, 4], x[:, 5] = 4 * np.sin(t), 3 * np.cos(t), 500 + 5 * np.sin(2 * t)
    x[:, 6:] = 0.5 + 0.4 * np.sin(t[:, None] + [0.0, 2.0, 4.0])
    return x


def mesh_of(model: FaceModel, x: np.ndarray, offsets_mm: np.ndarray | float = 0.0) -> np.ndarray:
    """(V, 3) in the camera frame."""
    local = model.vertices(None, x[6:]) + offsets_mm
    return local @ (rotation_matrix(x[:3]) @ FACING).T + x[3:6]


def image_of(model: FaceModel, vertices_mm: np.ndarray, camera: Camera = CAMERA) -> np.ndarray:
    """Linear RGB (h, w, 3), lit by `LIGHT` on black."""
    hits = RayCaster(vertices_mm, model.triangles).see(camera)
    normals = normalised(
        interpolate(hits, model.triangles, vertex_normals(vertices_mm, model.triangles))
    )
    colours = interpolate(hits, model.triangles, paint(model)) * irradiance(normals, LIGHT)
    return np.where(hits.hit[..., None], colours, 0.0).astype(np.float32)


def take_parts(
    model: FaceModel, truth: np.ndarray, x: np.ndarray
) -> tuple[TrackedTake, Identity, LandmarkTrack]:
    """A fit at x (F, P), its person, and landmarks of little trust where the truth (F, P) is."""
    points = np.stack([CAMERA.project(mesh_of(model, row)[model.landmarks]) for row in truth])
    frames, valid = np.arange(len(x)), np.ones(len(x), dtype=bool)
    track = LandmarkTrack(frames, points, np.full((len(x), 66), 0.05), valid)
    rotation = np.stack([rotation_matrix(row[:3]) @ FACING for row in x])
    head = HeadMotion(rotation, x[:, 3:6], x[:, 6:], np.ones(len(x)))
    fit = TrackedTake.of(frames, head, valid, CAMERA, model)
    person = Identity(
        np.zeros(0), model.neutral_mm, np.zeros((66, 3)), np.array(["t"]), np.array([1200.0]),
        np.array([True]),
    )  # fmt: skip
    return fit, person, track


def take_start(model: FaceModel, truth: np.ndarray, x: np.ndarray) -> TakeStart:
    """Starts at x (F, P) with landmarks where the truth (F, P) has them."""
    fit, person, track = take_parts(model, truth, x)
    return TakeStart.of(model, person, fit, track, LandmarkFitSettings())
