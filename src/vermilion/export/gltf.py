"""A mesh sequence as binary glTF 2.0 (`.glb`): morph targets, their weights, the head's motion.

glTF is in metres and seconds; the frame `n` is at `n / fps` seconds. The asset's `extras` name the
rate and the first frame, and what glTF's cameras cannot hold: the principal point.
"""

from __future__ import annotations

import json
import shutil
import struct
import tempfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.export.animation import Animation
from vermilion.export.shape_basis import ShapeBasis
from vermilion.export.usd_shapes import continuous_quaternions
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised
from vermilion.geometry.vertex_normals import VertexNormals
from vermilion.storage.files import atomic_path

_FLOAT, _UINT = 5126, 5125
_ARRAY, _ELEMENTS = 34962, 34963
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_METRES = 0.001


class _Buffer:
    """The binary part of a file, and the accessors that point into it.

    The part is as large as the file, whose head is known at its end: it is collected in a stream.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self.stream = stream
        self.length = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add_bytes(self, data: bytes, target: int | None = None) -> int:
        """Append, aligned to four bytes; the index of the view."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.length, "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        padded = data + b"\0" * (-len(data) % 4)
        self.stream.write(padded)
        self.length += len(padded)
        self.views.append(view)
        return len(self.views) - 1

    def add(self, values: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """Append values (N,) or (N, c); the index of the accessor."""
        is_index = target == _ELEMENTS
        values = np.ascontiguousarray(values, dtype="<u4" if is_index else "<f4")
        accessor: dict[str, Any] = {
            "bufferView": self.add_bytes(values.tobytes(), target),
            "componentType": _UINT if is_index else _FLOAT,
            "count": len(values),
            "type": _KINDS[1 if values.ndim == 1 else values.shape[1]],
        }
        if bounds:
            table = values.reshape(len(values), -1)
            accessor["min"] = [float(value) for value in table.min(axis=0)]
            accessor["max"] = [float(value) for value in table.max(axis=0)]
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def write_gltf(
    path: str | Path, animation: Animation, basis: ShapeBasis, texture: bytes | None = None
) -> None:
    """Write one node `head` with the morph targets of `basis`, animated, and the camera.

    Args:
        path: `.glb`.
        animation: the sequence.
        basis: its blend shapes.
        texture: PNG of the albedo.
    """
    with (
        atomic_path(path) as temporary,
        tempfile.TemporaryFile(dir=temporary.parent) as collected,
    ):
        buffer = _Buffer(collected)
        _write(temporary, _document(buffer, animation, basis, texture), buffer)


def _document(
    buffer: _Buffer, animation: Animation, basis: ShapeBasis, texture: bytes | None
) -> dict[str, Any]:
    """The head of the file; the buffer takes the rest."""
    children = [{"name": "head", "mesh": 0}]
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "Vermilion", "extras": _facts(animation)},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "materials": [_material()],
    }
    if texture is not None:
        document["images"] = [
            {"name": "albedo", "mimeType": "image/png", "bufferView": buffer.add_bytes(texture)}
        ]
        document["textures"] = [{"source": 0}]
        surface = document["materials"][0]["pbrMetallicRoughness"]
        surface |= {"baseColorTexture": {"index": 0}, "baseColorFactor": [1.0, 1.0, 1.0, 1.0]}
    document["meshes"] = [_mesh(buffer, animation, basis)]
    document["animations"] = [_motion(buffer, animation, basis)]
    if animation.camera is not None:
        document["cameras"] = [_camera(animation.camera)]
        children.append(_camera_node(animation.camera))
    root: dict[str, Any] = {"name": "Face", "children": list(range(1, 1 + len(children)))}
    if animation.turned_upright:
        root["rotation"] = [1.0, 0.0, 0.0, 0.0]
    document["nodes"] = [root, *children]
    document |= {"accessors": buffer.accessors, "bufferViews": buffer.views}
    document["buffers"] = [{"byteLength": buffer.length}]
    return document


def _write(path: Path, document: dict[str, Any], buffer: _Buffer) -> None:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + buffer.length
    with path.open("wb") as stream:
        stream.write(struct.pack("<4sII", b"glTF", 2, total))
        stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
        stream.write(struct.pack("<I4s", buffer.length, b"BIN\0"))
        buffer.stream.seek(0)
        shutil.copyfileobj(buffer.stream, stream)


def _facts(animation: Animation) -> dict[str, Any]:
    facts: dict[str, Any] = {"fps": float(animation.fps), "first_frame": int(animation.frames[0])}
    facts["last_frame"] = int(animation.frames[-1])
    if animation.camera is not None:
        k = animation.camera.calibration
        facts["principal_point_px"] = [float(k[0, 2]), float(k[1, 2])]
    if animation.plate is not None:
        facts["plate"] = animation.plate
    return facts


def _material() -> dict[str, Any]:
    colour = [0.42, 0.31, 0.26, 1.0]
    surface = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.5}
    return {"name": "skin", "pbrMetallicRoughness": surface, "doubleSided": True}


def _mesh(buffer: _Buffer, animation: Animation, basis: ShapeBasis) -> dict[str, Any]:
    cut, neutral = animation.cut_at_seams(), basis.neutral_mm.astype(np.float64)
    facing = VertexNormals(animation.polygons.triangles, len(neutral))
    normals = facing.of(neutral)
    primitive: dict[str, Any] = {
        "attributes": {
            "POSITION": buffer.add(neutral[cut.source] * _METRES, _ARRAY, bounds=True),
            "NORMAL": buffer.add(_unit(normals)[cut.source], _ARRAY),
        },
        "indices": buffer.add(cut.polygons.triangles.ravel(), _ELEMENTS),
        "material": 0,
    }
    if cut.uv is not None:
        # glTF's v points down.
        uv = np.stack([cut.uv[:, 0], 1.0 - cut.uv[:, 1]], axis=1)
        primitive["attributes"]["TEXCOORD_0"] = buffer.add(uv, _ARRAY)
    targets = []
    for shape in basis.shapes.shapes_mm:
        turned = (facing.of(neutral + shape) - normals)[cut.source]
        targets.append(
            {
                "POSITION": buffer.add(shape[cut.source] * _METRES, _ARRAY, bounds=True),
                "NORMAL": buffer.add(turned, _ARRAY),
            }
        )
    mesh: dict[str, Any] = {"name": "corrected", "primitives": [primitive], "extras": {}}
    if targets:
        primitive["targets"] = targets
        mesh["weights"] = [0.0] * len(targets)
        mesh["extras"]["targetNames"] = list(basis.shapes.names)
    if len(cut.source) > len(neutral):
        # Vertices beyond those of the mesh repeat these, which a texture seam cuts.
        mesh["extras"]["seamVertices"] = cut.source[len(neutral) :].tolist()
    return mesh


def _unit(normals: np.ndarray) -> np.ndarray:
    """Unit normals (V, 3) in float32; those of vertices without area point forwards."""
    normals = np.where(np.linalg.norm(normals, axis=1, keepdims=True) > 0.5, normals, [0, 0, 1.0])
    return normalised(normals.astype(np.float64))


def _motion(buffer: _Buffer, animation: Animation, basis: ShapeBasis) -> dict[str, Any]:
    rows = basis.rows
    times = buffer.add(animation.frames[rows] / animation.fps, bounds=True)
    values = {
        "translation": animation.head.translation_mm[rows] * _METRES,
        "rotation": continuous_quaternions(animation.head.rotation[rows]),
    }
    if len(basis.shapes.names):
        values["weights"] = basis.shapes.weights.ravel()
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for name, table in values.items():
        samplers.append({"input": times, "output": buffer.add(table), "interpolation": "LINEAR"})
        channels.append({"sampler": len(channels), "target": {"node": 1, "path": name}})
    return {"name": "take", "samplers": samplers, "channels": channels}


def _camera(camera: Camera) -> dict[str, Any]:
    k = camera.calibration
    lens = {
        "yfov": float(2 * np.arctan(0.5 * camera.height_px / k[1, 1])),
        "aspectRatio": float(camera.width_px / k[0, 0] / (camera.height_px / k[1, 1])),
        "znear": 0.001,
        "zfar": 100.0,
    }
    return {"name": "camera", "type": "perspective", "perspective": lens}


def _camera_node(camera: Camera) -> dict[str, Any]:
    turn = Rotation.from_matrix(camera.rotation.T @ np.diag([1.0, -1.0, -1.0])).as_quat()
    return {
        "name": "camera",
        "camera": 0,
        "translation": [float(value) for value in camera.centre_mm * _METRES],
        "rotation": [float(value) for value in turn],
    }
