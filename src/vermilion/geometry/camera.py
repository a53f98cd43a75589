"""Cameras as COLMAP has them, read and written through pycolmap."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pycolmap

from vermilion.geometry.camera_check import check_camera
from vermilion.geometry.colmap import camera_of_images, read_colmap_model
from vermilion.geometry.vectors import vector_lengths
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_folder


@dataclass(frozen=True)
class Camera:
    """A calibrated camera.

    x right, y down, z forward; the centre of the top-left pixel is (0.5, 0.5). World and camera
    frames are in millimetres.

    Attributes:
        name: the camera's name (its folder under `frames/`).
        model: COLMAP model name (`PINHOLE`, `OPENCV`, ...).
        params: the model's parameters, pixels first.
        width_px: width of the image.
        height_px: height of the image.
        cam_from_world: (3, 4) [R | t].
    """

    name: str
    model: str
    params: tuple[float, ...]
    width_px: int
    height_px: int
    cam_from_world: np.ndarray

    @property
    def rotation(self) -> np.ndarray:
        """(3, 3) of `cam_from_world`."""
        return self.cam_from_world[:, :3]

    @property
    def translation(self) -> np.ndarray:
        """(3,) mm of `cam_from_world`."""
        return self.cam_from_world[:, 3]

    @property
    def centre_mm(self) -> np.ndarray:
        """Projection centre in the world, (3,)."""
        return -self.rotation.T @ self.translation

    @property
    def is_pinhole(self) -> bool:
        return self.model in ("PINHOLE", "SIMPLE_PINHOLE")

    def colmap(self) -> pycolmap.Camera:
        return pycolmap.Camera(
            model=self.model, width=self.width_px, height=self.height_px, params=list(self.params)
        )

    @property
    def calibration(self) -> np.ndarray:
        """(3, 3) matrix K of the undistorted camera."""
        return np.asarray(self.colmap().calibration_matrix())

    def to_camera(self, points_mm: np.ndarray) -> np.ndarray:
        """The points_mm (..., 3) of the world in the camera frame, (..., 3) mm."""
        return points_mm @ self.rotation.T + self.translation

    def project(self, points_mm: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of points_mm (..., 3) in the world; NaN for points behind the camera."""
        local = self.to_camera(np.asarray(points_mm, dtype=np.float64))
        depth = local[..., 2:3]
        with np.errstate(divide="ignore", invalid="ignore"):
            normal = np.where(depth > 1e-9, local[..., :2] / depth, np.nan)
        if self.is_pinhole:
            k = self.calibration
            return normal * [k[0, 0], k[1, 1]] + [k[0, 2], k[1, 2]]
        flat = local.reshape(-1, 3)
        pixels = np.asarray(self.colmap().img_from_cam(flat)).reshape(*local.shape[:-1], 2)
        return np.where(depth > 1e-9, pixels, np.nan)

    def pixel_jacobian(self, points_mm: np.ndarray, step_mm: float = 0.05) -> np.ndarray:
        """Change of the pixel by the world point, (..., 2, 3) px/mm, at points_mm (..., 3), world.

        Exact for a pinhole; by central differences of `step_mm` for other lenses.
        """
        points_mm = np.asarray(points_mm, dtype=np.float64)
        if not self.is_pinhole:
            moves = step_mm * np.eye(3)
            slopes = [self.project(points_mm + m) - self.project(points_mm - m) for m in moves]
            return np.stack(slopes, axis=-1) / (2 * step_mm)
        k, local = self.calibration, self.to_camera(points_mm)
        x, y, z = np.moveaxis(local, -1, 0)
        inner = np.zeros((*local.shape[:-1], 2, 3))
        inner[..., 0, 0], inner[..., 1, 1] = k[0, 0] / z, k[1, 1] / z
        inner[..., 0, 2], inner[..., 1, 2] = -k[0, 0] * x / z**2, -k[1, 1] * y / z**2
        return inner @ self.rotation

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions in the world of pixels (..., 2), both (..., 3)."""
        pixels = np.asarray(pixels, dtype=np.float64)
        if self.is_pinhole:
            k = self.calibration
            normal = (pixels - [k[0, 2], k[1, 2]]) / [k[0, 0], k[1, 1]]
        else:
            flat = np.asarray(self.colmap().cam_from_img(pixels.reshape(-1, 2)))
            normal = flat[:, :2].reshape(pixels.shape)
        local = np.concatenate([normal, np.ones((*normal.shape[:-1], 1))], axis=-1)
        directions = local @ self.rotation
        directions /= vector_lengths(directions)
        return np.broadcast_to(self.centre_mm, directions.shape), directions

    def pixel_grid(self) -> np.ndarray:
        """Centres of all pixels, (height, width, 2)."""
        x, y = np.meshgrid(np.arange(self.width_px) + 0.5, np.arange(self.height_px) + 0.5)
        return np.stack([x, y], axis=-1)

    def in_image(self, pixels: np.ndarray, margin_px: float = 0.0) -> np.ndarray:
        """Which pixels (..., 2) lie in the image, at least `margin_px` from its border."""
        x, y = pixels[..., 0], pixels[..., 1]
        with np.errstate(invalid="ignore"):
            return (
                (x >= margin_px)
                & (y >= margin_px)
                & (x <= self.width_px - margin_px)
                & (y <= self.height_px - margin_px)
            )

    def resized(self, scale: float) -> Camera:
        """The camera of the image resized by `scale` (sizes rounded)."""
        return self.resized_to(round(self.width_px * scale), round(self.height_px * scale))

    def resized_to(self, width_px: int, height_px: int) -> Camera:
        """The camera of the image resized to a width and height."""
        camera = self.colmap()
        camera.rescale(width_px, height_px)
        return replace(
            self,
            params=tuple(camera.params),
            width_px=camera.width,
            height_px=camera.height,
        )


def pinhole(
    name: str,
    focal_px: float,
    width_px: int,
    height_px: int,
    cam_from_world: np.ndarray | None = None,
) -> Camera:
    """A pinhole camera with its principal point in the middle.

    Args:
        name: of the camera.
        focal_px: of both axes.
        width_px, height_px: size of its image.
        cam_from_world: (3, 4), mm; None: the camera is the world's frame.

    Returns:
        the camera.
    """
    if cam_from_world is None:
        cam_from_world = np.eye(3, 4)
    params = (float(focal_px), float(focal_px), width_px / 2, height_px / 2)
    return Camera(name, "PINHOLE", params, width_px, height_px, np.asarray(cam_from_world, float))


def look_at(centre_mm: np.ndarray, target_mm: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Pose of a camera that looks at a point.

    Args:
        centre_mm: (3,) its centre, world, mm.
        target_mm: (3,) what it looks at, world, mm.
        up: (3,) what is up in its image, world.

    Returns:
        (3, 4) `cam_from_world`, mm.
    """
    forward = np.asarray(target_mm, float) - centre_mm
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return np.concatenate([rotation, (-rotation @ centre_mm)[:, None]], axis=1)


def read_cameras(folder: str | Path) -> dict[str, Camera]:
    """Cameras of a COLMAP model (text or binary, with rigs or without), sorted by name.

    An image is named after its camera (`face0`, `face0.jpg`), or lies in the camera's folder
    (`face0/000000.jpg`).

    Raises:
        InputError: the folder holds no such model, or a camera has images of different poses.
    """
    model = read_colmap_model(folder)
    images = {image.name: image for image in model.images.values()}
    cameras: dict[str, Camera] = {}
    for image_name, name in sorted(camera_of_images(images).items()):
        image = images[image_name]
        camera = model.cameras[image.camera_id]
        transform = image.cam_from_world()
        pose = np.asarray(transform.matrix())
        if not np.any(transform.rotation.quat):  # whose matrix is the identity
            pose = np.full((3, 4), np.nan)
        size = (camera.width, camera.height)
        found = Camera(name, camera.model_name, tuple(camera.params), *size, pose)
        check_camera(folder, name, found.model, found.params, size, pose)
        if name in cameras and not np.allclose(cameras[name].cam_from_world, pose, atol=1e-6):
            raise InputError(
                f"images of camera {name} with different poses ('{image_name}' is one)",
                "one pose a camera: the rig does not move during a take",
                "Leave one image of each camera in the model.",
                camera=name,
                path=folder,
            )
        cameras.setdefault(name, found)
    if not cameras:
        raise InputError(
            "no image in the model", "one image a camera", "Add a pose a camera.", path=folder
        )
    return dict(sorted(cameras.items()))


def write_cameras(folder: str | Path, cameras: dict[str, Camera]) -> None:
    """Write a COLMAP text model (one image a camera, named after it), whole or not at all."""
    lines, poses = (
        ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"],
        ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME (cam_from_world, millimetres)"],
    )
    for index, (name, camera) in enumerate(sorted(cameras.items()), start=1):
        params = " ".join(repr(float(p)) for p in camera.params)
        lines.append(f"{index} {camera.model} {camera.width_px} {camera.height_px} {params}")
        pose = pycolmap.Rigid3d(camera.cam_from_world)
        x, y, z, w = pose.rotation.quat
        numbers = " ".join(repr(float(v)) for v in (w, x, y, z, *pose.translation))
        poses += [f"{index} {numbers} {index} {name}", ""]
    with atomic_folder(folder) as temporary:
        (temporary / "cameras.txt").write_text("\n".join(lines) + "\n")
        (temporary / "images.txt").write_text("\n".join(poses) + "\n")
        (temporary / "points3D.txt").write_text("")


def portrait_camera(vertices_mm: np.ndarray, size_px: int = 420) -> Camera:
    """A camera in front of a face, vertices_mm (V, 3) in its head frame, which fills the image."""
    low, high = vertices_mm.min(axis=0), vertices_mm.max(axis=0)
    middle, distance = (low + high) / 2, 900.0
    extent = float(max(high[0] - low[0], high[1] - low[1])) * 1.05
    centre = middle + np.array([0.25 * distance, 0.0, distance])
    pose = look_at(centre, middle, np.array([0.0, 1.0, 0.0]))
    focal = size_px / extent * distance * np.hypot(1.0, 0.25)
    return pinhole("portrait", focal, size_px, size_px, pose)
