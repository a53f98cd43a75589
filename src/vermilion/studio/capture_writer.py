"""Writing a synthetic take: images, cameras, labels, and the truth apart."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vermilion.geometry.camera import Camera
from vermilion.imaging.images import write_image
from vermilion.storage.arrays import write_array
from vermilion.storage.files import write_text
from vermilion.storage.progress import progress
from vermilion.studio.labels import lip_contours, write_contours, write_landmarks
from vermilion.studio.sensor import sensor_noise
from vermilion.studio.surface import surface_of
from vermilion.studio.take import StudioTakePlan


def image_path(capture: str | Path, camera: str, frame: int) -> Path:
    """Where a capture folder has an image."""
    return Path(capture) / "frames" / camera / f"{frame:06d}.png"


def label_path(capture: str | Path, kind: str, camera: str, frame: int) -> Path:
    """Where a capture folder has a label; `kind` is `contours` or `landmarks`."""
    return Path(capture) / "labels" / kind / camera / f"{frame:06d}.json"


def write_images(
    plan: StudioTakePlan,
    cameras: dict[str, Camera],
    capture: str | Path,
    frames: Iterable[int],
    first: int,
    *,
    name: str,
    seed: int,
    noise_read: float,
    noise_shot: float,
    **rays: int,
) -> None:
    """Render frames (numbers of the take, whose first is `first`) into a capture folder.

    `name` (subject/take) and `seed` decide the sensor's noise; `rays` are the renderer's counts.
    """
    from vermilion.studio.render import render  # compiled: a quarter of a second

    surface = surface_of(plan.model)
    for frame in progress(list(frames), f"{name}: frames"):
        index = frame - first
        images = render(plan.scene(index, surface, **rays), plan.vertices_mm(index), cameras)
        for camera, image in images.items():
            place = f"{name}/{camera}"
            noisy = sensor_noise(image, noise_read, noise_shot, seed, place, frame)
            write_image(image_path(capture, camera, frame), noisy)


def write_labels(
    plan: StudioTakePlan,
    cameras: dict[str, Camera],
    capture: str | Path,
    first: int,
    contour_frames: Iterable[tuple[str, int]],
    landmark_frames: Iterable[tuple[str, int]],
) -> None:
    """Write contour and landmark labels of (camera, frame) pairs into a capture folder."""
    surface = surface_of(plan.model)
    for camera, frame in contour_frames:
        vertices = plan.vertices_mm(frame - first)
        loops = lip_contours(plan.model, surface, vertices, cameras[camera])
        image = f"frames/{camera}/{frame:06d}.png"
        write_contours(label_path(capture, "contours", camera, frame), image, loops)
    for camera, frame in landmark_frames:
        vertices = plan.vertices_mm(frame - first)
        points = cameras[camera].project(vertices[plan.model.landmarks])
        image = f"frames/{camera}/{frame:06d}.png"
        write_landmarks(label_path(capture, "landmarks", camera, frame), image, points)


def write_truth(plan: StudioTakePlan, folder: str | Path) -> None:
    """Write `vertices_mm.npy` (F, V, 3), `triangles.npy` (T, 3) of skin and inside of the mouth,
    `neutral_mm.npy` (V, 3) and `weights.json`, a dict a frame."""
    folder, model = Path(folder), plan.model
    vertices = np.stack([plan.vertices_mm(i).astype(np.float32) for i in range(len(plan))])
    parts = (model.regions["teeth"] | model.regions["eyes"])[model.triangles].any(axis=1)
    names = plan.performance.names
    rows = [dict(zip(names, map(float, row), strict=True)) for row in plan.performance.weights]
    write_array(folder / "vertices_mm.npy", vertices)
    write_array(folder / "triangles.npy", model.triangles[~parts].astype(np.int64))
    write_array(folder / "neutral_mm.npy", plan.neutral_mm())
    write_text(folder / "weights.json", json.dumps(rows) + "\n")
