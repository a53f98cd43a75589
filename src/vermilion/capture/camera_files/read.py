"""Reads the calibrated cameras of a folder, whatever wrote them; says what it understood."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.capture.camera_files.json_rigs import read_json, read_krt
from vermilion.capture.camera_files.metashape import read_metashape
from vermilion.capture.camera_files.opencv_files import read_opencv
from vermilion.capture.camera_files.rig_file import RigFile, Sizes
from vermilion.capture.camera_files.usd_cameras import read_usd_cameras
from vermilion.geometry.camera import Camera, read_cameras
from vermilion.geometry.camera_check import check_camera
from vermilion.geometry.colmap import model_files
from vermilion.storage.errors import InputError

_USD = (".usd", ".usda", ".usdc", ".usdz")
_YAML = (".yml", ".yaml")
_UNITS_MM = {"millimetres": 1.0, "centimetres": 10.0, "metres": 1000.0}
#: Usual distance from the cameras of a rig to the face.
_USUAL_MM = 1000.0


@dataclass(frozen=True)
class GivenCameras:
    """Cameras of a folder.

    Attributes:
        cameras: name -> camera, world in millimetres.
        understood: what was understood and guessed, sentences.
    """

    cameras: dict[str, Camera]
    understood: tuple[str, ...]


def camera_files(folder: str | Path) -> list[Path]:
    """Files of a folder that cameras are read from: those of a COLMAP model, else all."""
    folder = Path(folder)
    paths = sorted(path for path in folder.glob("*") if path.is_file())
    return model_files(folder) or [path for path in paths if not path.name.startswith(".")]


def read_given_cameras(folder: str | Path, sizes: Sizes) -> GivenCameras:
    """Read a COLMAP model, Metashape's XML, OpenCV's YAML, USD, NeRSemble's JSON or Multiface's KRT.

    Args:
        folder: `cameras/` of a capture.
        sizes: camera -> (width, height) of its images, for files that do not name them.

    Raises:
        InputError: there is no such file, or it cannot be read.
    """
    folder = Path(folder)
    if model_files(folder):
        cameras = read_cameras(folder)
        return GivenCameras(cameras, (f"COLMAP, {len(cameras)} cameras, taken as millimetres",))
    path, raw = _read(folder, camera_files(folder), sizes)
    for name, camera in raw.cameras.items():
        known = camera.size_px or sizes.get(name) or (1, 1)
        check_camera(path, name, camera.model, camera.params, known, camera.cam_from_world)
    unit, said = _unit(raw)
    cameras = {}
    for name, camera in raw.cameras.items():
        size = camera.size_px or sizes.get(name)
        if size is None:
            continue
        pose = camera.cam_from_world.astype(float).copy()
        pose[:, 3] *= unit
        cameras[name] = Camera(name, camera.model, camera.params, size[0], size[1], pose)
    return GivenCameras(dict(sorted(cameras.items())), (*raw.facts, said))


def _read(folder: Path, paths: list[Path], sizes: Sizes) -> tuple[Path, RigFile]:
    """The file that cameras were read from (the first of several), and what it holds."""
    by_suffix: dict[str, list[Path]] = {}
    for path in paths:
        by_suffix.setdefault(path.suffix.lower(), []).append(path)
    yaml = [path for suffix in _YAML for path in by_suffix.get(suffix, [])]
    usd = [path for suffix in _USD for path in by_suffix.get(suffix, [])]
    if yaml:
        return yaml[0], read_opencv(yaml)
    if by_suffix.get(".xml"):
        return by_suffix[".xml"][0], read_metashape(by_suffix[".xml"][0])
    if by_suffix.get(".json"):
        return by_suffix[".json"][0], read_json(by_suffix[".json"][0], sizes)
    if usd:
        return usd[0], read_usd_cameras(usd[0], sizes)
    named = [path for path in paths if path.stem.upper() == "KRT"]
    if named:
        return named[0], read_krt(named[0])
    raise InputError(
        f"no file of cameras that is known ({', '.join(path.name for path in paths) or 'empty'})",
        "a COLMAP model (cameras.txt and images.txt, or .bin), Metashape's .xml, OpenCV's .yml, USD, "
        "NeRSemble's .json or Multiface's KRT",
        "Export the rig in one of these forms, or give calibration views.",
        path=folder,
    )


def convergence(cameras: dict[str, Camera]) -> np.ndarray:
    """The point (3,) mm, world, nearest to all optical axes: where the face is."""
    centres = np.stack([camera.centre_mm for camera in cameras.values()])
    axes = np.stack([camera.rotation[2] for camera in cameras.values()])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    right = np.einsum("kij,kj->i", across, centres)
    # A single camera, or parallel ones: a point before the first.
    weight = 1e-6
    middle = centres.mean(axis=0) + _USUAL_MM * axes.mean(axis=0)
    return np.linalg.solve(across.sum(axis=0) + weight * np.eye(3), right + weight * middle)


def _unit(raw: RigFile) -> tuple[float, str]:
    if raw.unit_mm is not None:
        return raw.unit_mm, f"unit {raw.unit_mm:g} mm, as the format has it"
    centres = np.stack(
        [-c.cam_from_world[:, :3].T @ c.cam_from_world[:, 3] for c in raw.cameras.values()]
    )
    axes = np.stack([camera.cam_from_world[2, :3] for camera in raw.cameras.values()])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    if len(centres) < 2 or np.linalg.cond(across.sum(axis=0)) > 1e6:
        return 1.0, "unit unknown, taken as millimetres: the cameras do not look at one point"
    right = np.einsum("kij,kj->i", across, centres)
    target = np.linalg.solve(across.sum(axis=0), right)
    distance = float(np.median(np.linalg.norm(centres - target, axis=1)))
    name = min(_UNITS_MM, key=lambda unit: abs(np.log(distance * _UNITS_MM[unit] / _USUAL_MM)))
    return _UNITS_MM[name], (
        f"unit guessed: {name}, since the cameras are {distance:.4g} units from what they look at"
    )
