"""Cameras of an Agisoft Metashape project exported as XML."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from vermilion.capture.camera_files.rig_file import RawCamera, RigFile, pose, unreadable

_FRAME = "frame"


def read_metashape(path: Path) -> RigFile:
    """Read the aligned cameras of the first chunk; the chunk's transform carries them to metres.

    Raises InputError where the file is none of Metashape, or no camera of it is aligned.
    """
    try:
        root = ElementTree.parse(path).getroot()
        chunk = root if root.tag == "chunk" else root.find("chunk")
        if chunk is None:
            raise ValueError("no chunk")
        lenses = {sensor.get("id"): _lens(sensor) for sensor in chunk.iter("sensor")}
        scale, placed = _chunk_transform(chunk)
        cameras, left_out = {}, []
        for camera in chunk.iter("camera"):
            label, numbers = camera.get("label") or "", camera.findtext("transform")
            lens = lenses.get(camera.get("sensor_id"))
            if numbers is None or lens is None:
                left_out.append(label)
                continue
            chunk_from_cam = np.array(numbers.split(), dtype=float).reshape(4, 4)
            rotation = placed[:3, :3] @ chunk_from_cam[:3, :3]
            centre = scale * (placed[:3, :3] @ chunk_from_cam[:3, 3]) + placed[:3, 3]
            model, params, size = lens
            cameras[_name(label)] = RawCamera(
                model, params, pose(rotation.T, -rotation.T @ centre), size
            )
    except (ElementTree.ParseError, ValueError, OSError) as error:
        raise unreadable(path, "cameras exported from Metashape as XML", error) from error
    if not cameras:
        raise unreadable(path, "aligned cameras", "none is aligned")
    facts = [f"Metashape, {len(cameras)} cameras"]
    if left_out:
        facts.append(f"not aligned, left out: {', '.join(left_out)}")
    if scale != 1.0:
        facts.append("scale, rotation and place of the chunk applied")
    return RigFile(cameras, 1000.0, tuple(facts))


def _name(label: str) -> str:
    """Name of the camera of a label, which may be its image's."""
    head, dot, tail = label.rpartition(".")
    return head if dot and tail.isalpha() and len(tail) <= 4 else label


def _chunk_transform(chunk: ElementTree.Element) -> tuple[float, np.ndarray]:
    """Scale, and (4, 4) rotation and translation of the chunk; the identity where it has none."""
    matrix, scale = np.eye(4), 1.0
    transform = chunk.find("transform")
    if transform is not None:
        rotation, place = transform.findtext("rotation"), transform.findtext("translation")
        if rotation:
            matrix[:3, :3] = np.array(rotation.split(), dtype=float).reshape(3, 3)
        if place:
            matrix[:3, 3] = np.array(place.split(), dtype=float)
        scale = float(transform.findtext("scale") or 1.0)
    return scale, matrix


def _lens(sensor: ElementTree.Element) -> tuple[str, tuple[float, ...], tuple[int, int]] | None:
    """Model, parameters and size of a sensor; None where it is not calibrated."""
    found = [item for item in sensor.findall("calibration") if item.find("f") is not None]
    if not found:
        return None
    adjusted = [item for item in found if item.get("class") == "adjusted"]
    item = (adjusted or found)[0]
    if (item.get("type") or _FRAME) != _FRAME:
        raise ValueError(f"a lens of type {item.get('type')}, and frame cameras are read")
    resolution = item.find("resolution")
    resolution = sensor.find("resolution") if resolution is None else resolution
    if resolution is None:
        raise ValueError("a sensor without resolution")
    width, height = int(resolution.get("width") or 0), int(resolution.get("height") or 0)

    def value(name: str) -> float:
        return float(item.findtext(name) or 0.0)

    if value("b2"):
        raise ValueError(
            "a skew (b2), which no lens model here has: fix it to 0 and optimise again"
        )
    focal = value("f")
    params = (focal + value("b1"), focal, width / 2 + value("cx"), height / 2 + value("cy"))
    # Metashape's p1 and p2 stand the other way round than OpenCV's.
    bends = (value("k1"), value("k2"), value("p2"), value("p1"), value("k3"))
    if not any(bends):
        return "PINHOLE", params, (width, height)
    if value("k4"):
        raise ValueError("a coefficient k4, which no lens model here has: fix it to 0")
    return "FULL_OPENCV", (*params, *bends, 0.0, 0.0, 0.0), (width, height)
