"""Mesh sequences in glTF 2.0: morph targets and node motion (`.glb`, `.gltf`)."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any
from urllib.parse import unquote

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vermilion.external.sequence import RawSequence, Request, filled
from vermilion.geometry.polygons import Polygons

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_METRE_MM = 1000.0
#: Values that a file may have without storing them.
_MOST_ZEROS = 10_000_000


class _File:
    """The document and its arrays."""

    def __init__(self, request: Request) -> None:
        self.request = request
        try:
            data = request.path.read_bytes()
            self.binary = b""
            if data[:4] == b"glTF":
                length = struct.unpack_from("<I", data, 12)[0]
                self.document = json.loads(data[20 : 20 + length])
                self.binary = data[28 + length :]
            else:
                self.document = json.loads(data)
            self.buffers = [self._buffer(entry) for entry in self.document.get("buffers", [])]
        except (OSError, ValueError, KeyError, struct.error) as error:
            raise request.error(
                f"an unreadable glTF file ({error})", "glTF 2.0", "Export it again."
            ) from error

    def _buffer(self, entry: dict[str, Any]) -> bytes:
        uri = entry.get("uri")
        if uri is None:
            return self.binary
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        folder = self.request.path.parent.resolve()
        path = (folder / unquote(uri)).resolve()
        if not path.is_relative_to(folder):
            raise ValueError(f"the buffer {uri!r:.60} lies outside of the file's folder")
        return path.read_bytes()

    def array(self, index: int) -> np.ndarray:
        """Accessor `index` as (N,) or (N, c)."""
        entry = self.document["accessors"][index]
        kind, count, width = (
            np.dtype(_TYPES[entry["componentType"]]),
            entry["count"],
            _SIZES[entry["type"]],
        )
        if "bufferView" in entry:
            values = self._strided(
                entry["bufferView"], entry.get("byteOffset", 0), kind, count, width
            ).copy()
        elif count <= _MOST_ZEROS:
            values = np.zeros((count, width), dtype=kind)
        else:
            raise ValueError(f"an accessor of {count} zeros")
        if "sparse" in entry:
            sparse = entry["sparse"]
            number, at = sparse["count"], sparse["indices"]
            rows = self._strided(
                at["bufferView"],
                at.get("byteOffset", 0),
                np.dtype(_TYPES[at["componentType"]]),
                number,
                1,
            )
            at = sparse["values"]
            values[rows[:, 0]] = self._strided(
                at["bufferView"], at.get("byteOffset", 0), kind, number, width
            )
        if entry.get("normalized") and kind.kind in "iu":
            values = np.maximum(values / np.iinfo(kind).max, -1.0)
        return values[:, 0] if width == 1 else values

    def _strided(
        self, view: int, offset: int, kind: np.dtype, count: int, width: int
    ) -> np.ndarray:
        entry = self.document["bufferViews"][view]
        stride = entry.get("byteStride", kind.itemsize * width)
        start = entry.get("byteOffset", 0) + offset
        shape, strides = (count, width), (stride, kind.itemsize)
        return np.ndarray(shape, kind, self.buffers[entry["buffer"]], start, strides)

    def parents(self) -> dict[int, int]:
        """Parent of each node that has one."""
        nodes = self.document.get("nodes", [])
        return {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}


class _Curve:
    """One animated value: keys in seconds, (n, ...) values, interpolation."""

    def __init__(self, file: _File, sampler: dict[str, Any], path: str) -> None:
        self.times = file.array(sampler["input"]).astype(np.float64)
        values = file.array(sampler["output"]).astype(np.float64)
        self.mode, self.path = sampler.get("interpolation", "LINEAR"), path
        count = len(self.times)
        if self.mode == "CUBICSPLINE":  # keys alone: tangents shape what lies between
            values = values.reshape(count, 3, -1)[:, 1]
        self.values = values.reshape(count, -1)

    def at(self, time: float) -> np.ndarray:
        """Value (c,) at `time`, held beyond the ends."""
        time = float(np.clip(time, self.times[0], self.times[-1]))
        if self.mode == "STEP":
            return self.values[np.searchsorted(self.times, time + 1e-6, side="right") - 1]
        if self.path == "rotation" and len(self.times) > 1:
            return Slerp(self.times, Rotation.from_quat(self.values))(time).as_quat()
        return np.array([np.interp(time, self.times, column) for column in self.values.T])


def read_gltf(request: Request) -> RawSequence:
    """Read the mesh of the node that the request names, or of the only one with morph targets.

    Frames are times multiplied by the request's rate, or by that in the asset's `extras`.

    Raises InputError where the file is unreadable, has no such mesh, or skins it with joints.
    """
    file = _File(request)
    node = _chosen(file)
    nodes = file.document["nodes"]
    if "skin" in nodes[node]:
        raise request.error(
            "a mesh with joints", "morph targets and node motion", "Export it as USD or Alembic."
        )
    extras = file.document.get("asset", {}).get("extras", {})
    fps = request.fps or (extras.get("fps") if isinstance(extras, dict) else None)
    if not fps:
        raise request.error(
            "no frame rate", "one", "Give `fps` in the take sheet: glTF counts seconds."
        )
    curves = _curves(file)
    parts = file.document["meshes"][nodes[node]["mesh"]]["primitives"]
    rest, targets, polygons = _geometry(file, parts)
    rest, targets, polygons = _without_seams(
        file.document["meshes"][nodes[node]["mesh"]], rest, targets, polygons
    )
    times = np.concatenate([curve.times for curve in curves.values()]) if curves else np.zeros(0)
    keys = np.rint(times * fps).astype(int)
    lost = request.absent(range(keys.min(), keys.max() + 1)) if len(keys) else {}
    lost |= _gaps(request, curves, node, fps)
    chain = _chain(file, node)
    meshes = {}
    for frame in request.frames:
        if frame not in lost:
            local = rest + np.tensordot(_weights(file, node, curves, frame / fps), targets, axes=1)
            for link in chain:
                matrix = _matrix(nodes[link], curves, link, frame / fps)
                local = local @ matrix[:3, :3].T + matrix[:3, 3]
            meshes[frame] = local
    name = nodes[node].get("name", f"node {node}")
    return RawSequence(
        np.array(request.frames), filled(request.frames, meshes), polygons,
        unit_mm=_METRE_MM, up="y", lost=lost,
        facts=(f"node {name}, {len(targets)} morph targets, {fps:g} frames a second",),
    )  # fmt: skip


def _gaps(request: Request, curves: dict, node: int, fps: float) -> dict[int, str]:
    """Frames between the keys of weights that have one a frame, but none there."""
    curve = curves.get((node, "weights"))
    if curve is None or len(curve.times) < 2:
        return {}
    keys = set(np.rint(curve.times * fps).astype(int).tolist())
    if len(keys) < 0.5 * (max(keys) - min(keys) + 1):
        return {}
    return {frame: f"not in {request.path.name}" for frame in request.frames if frame not in keys}


def _chosen(file: _File) -> int:
    request, nodes = file.request, file.document.get("nodes", [])
    with_mesh = [k for k, node in enumerate(nodes) if "mesh" in node]
    names = [nodes[k].get("name", f"node {k}") for k in with_mesh]
    if request.mesh is not None:
        found = [k for k, name in zip(with_mesh, names, strict=True) if name == request.mesh]
    else:
        meshes = file.document.get("meshes", [])
        found = [
            k
            for k in with_mesh
            if any("targets" in part for part in meshes[nodes[k]["mesh"]]["primitives"])
        ]
        found = with_mesh if len(with_mesh) == 1 else found
    return request.only(found, names)


def _geometry(file: _File, parts: list[dict]) -> tuple[np.ndarray, np.ndarray, Polygons]:
    """Positions (V, 3), targets (K, V, 3) and polygons of all parts of a mesh."""
    rest, targets, triangles, total = [], [], [], 0
    for part in parts:
        if part.get("mode", 4) != 4:
            raise file.request.error("a mesh that is no triangles", "triangles", "Export it again.")
        own = file.array(part["attributes"]["POSITION"]).astype(np.float64)
        ids = file.array(part["indices"]) if "indices" in part else np.arange(len(own))
        triangles.append(ids.astype(np.int64).reshape(-1, 3) + total)
        moves = [
            file.array(t["POSITION"]).astype(np.float64) if "POSITION" in t else np.zeros_like(own)
            for t in part.get("targets", [])
        ]
        rest.append(own)
        targets.append(np.array(moves).reshape(-1, len(own), 3))
        total += len(own)
    polygons = Polygons.of_triangles(np.concatenate(triangles))
    return np.concatenate(rest), np.concatenate(targets, axis=1), polygons


def _without_seams(
    mesh: dict[str, Any], rest: np.ndarray, targets: np.ndarray, polygons: Polygons
) -> tuple[np.ndarray, np.ndarray, Polygons]:
    """The geometry without the vertices that repeat others at texture seams, where our own files name them.

    `rest` (V, 3), `targets` (K, V, 3).
    """
    extras = mesh.get("extras")
    doubles = extras.get("seamVertices") if isinstance(extras, dict) else None
    if not isinstance(doubles, list) or not doubles:
        return rest, targets, polygons
    count = len(rest) - len(doubles)
    source = np.concatenate([np.arange(max(count, 0)), np.asarray(doubles, dtype=np.int64)])
    if count < 3 or len(source) != len(rest) or source.min() < 0 or source.max() >= count:
        return rest, targets, polygons
    return rest[:count], targets[:, :count], Polygons.of_triangles(source[polygons.triangles])


def _curves(file: _File) -> dict[tuple[int, str], _Curve]:
    """(node, path) -> curve, of all animations."""
    found = {}
    for animation in file.document.get("animations", []):
        for channel in animation["channels"]:
            target = channel["target"]
            if "node" in target:
                sampler = animation["samplers"][channel["sampler"]]
                found[target["node"], target["path"]] = _Curve(file, sampler, target["path"])
    return found


def _weights(file: _File, node: int, curves: dict, time: float) -> np.ndarray:
    if (node, "weights") in curves:
        return curves[node, "weights"].at(time)
    entry = file.document["nodes"][node]
    mesh = file.document["meshes"][entry["mesh"]]
    count = len(mesh["primitives"][0].get("targets", []))
    return np.array(entry.get("weights", mesh.get("weights", [0.0] * count)), dtype=float)


def _chain(file: _File, node: int) -> list[int]:
    """The node and its ancestors, upwards."""
    parents, chain = file.parents(), [node]
    while chain[-1] in parents:
        chain.append(parents[chain[-1]])
        if len(chain) > len(file.document["nodes"]):
            raise ValueError("a node that is its own ancestor")
    return chain


def _matrix(entry: dict[str, Any], curves: dict, node: int, time: float) -> np.ndarray:
    """(4, 4) parent from node at `time`."""
    if "matrix" in entry:
        return np.array(entry["matrix"], dtype=float).reshape(4, 4).T

    def value(name: str, default: list[float]) -> np.ndarray:
        curve = curves.get((node, name))
        return np.array(entry.get(name, default), float) if curve is None else curve.at(time)

    matrix = np.eye(4)
    turn = Rotation.from_quat(value("rotation", [0, 0, 0, 1.0])).as_matrix()
    matrix[:3, :3] = turn * value("scale", [1.0, 1, 1])
    matrix[:3, 3] = value("translation", [0.0, 0, 0])
    return matrix
