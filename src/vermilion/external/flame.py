"""Sequences of parameters of FLAME, whose meshes the user's own model file gives (`external.flame_model`).

The names are those that VHAP writes. Our own files have one more, `corrective` with its weights (`export.flame`):

    offset_f = static_offset + corrective_weight_f * corrective
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.external.flame_model import SHAPES, Flame, read_flame_model
from vermilion.external.sequence import RawSequence, Request, filled
from vermilion.geometry.polygons import Polygons
from vermilion.imaging.numbering import numbered_files
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError

#: Parameters a file must have, and those that are zero where it has none: name -> numbers a frame.
_NEEDED = ("shape", "expr", "jaw_pose")
_POSES = {"rotation": 3, "neck_pose": 3, "jaw_pose": 3, "eyes_pose": 6}
_CORRECTIVE, _WEIGHT = "corrective", "corrective_weight"
METRE_MM = 1000.0


@dataclass(frozen=True)
class FlameTake:
    """Parameters of a take.

    Attributes:
        model: the user's.
        frames: (F,) numbers.
        shape: (S,) coefficients of the person.
        expr: (F, E) coefficients of expression.
        poses: (F, 15) rotation vectors of root, neck, jaw and eyes.
        translation: (F, 3) metres.
        offset: (W, 3) of the person, metres; V of the model's vertices, then those that the tracker added.
        corrective: (V, 3) metres, a shape that stands beside the offset.
        corrective_weight: (F,) its weights.
        lost: frame -> why it is lost.
    """

    model: Flame
    frames: np.ndarray
    shape: np.ndarray
    expr: np.ndarray
    poses: np.ndarray
    translation: np.ndarray
    offset: np.ndarray
    corrective: np.ndarray
    corrective_weight: np.ndarray
    lost: dict[int, str] = field(default_factory=dict)

    @property
    def turns(self) -> np.ndarray:
        """Rotation vectors (F, K, 3) of the model's joints."""
        return self.poses.reshape(len(self.poses), -1, 3)[:, : len(self.model.parents)]

    @property
    def own_offset(self) -> np.ndarray:
        """The offset (V, 3) of the model's own vertices."""
        return self.offset[: len(self.model.template)]

    def vertices(self, row: int) -> np.ndarray:
        """The mesh (V, 3) of a frame, metres."""
        offset = self.own_offset + self.corrective_weight[row] * self.corrective
        shaped = self.model.shaped(self.shape, self.expr[row], offset)
        return self.model.pose(shaped, self.turns[row]).vertices + self.translation[row]

    def of_rows(self, rows: np.ndarray) -> FlameTake:
        """The frames of `rows` (n,) int."""
        return replace(
            self, frames=self.frames[rows], expr=self.expr[rows], poses=self.poses[rows],
            translation=self.translation[rows], corrective_weight=self.corrective_weight[rows],
        )  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write `.npz`, float32, as `read_parameters` reads it."""
        ends = np.cumsum(list(_POSES.values()))[:-1]
        poses = dict(zip(_POSES, np.split(self.poses, ends, axis=1), strict=True))
        tables = poses | {
            "shape": self.shape, "expr": self.expr, "translation": self.translation,
            "static_offset": self.offset[None], _CORRECTIVE: self.corrective,
            _WEIGHT: self.corrective_weight,
        }  # fmt: skip
        single: dict[str, Any] = {k: table.astype(np.float32) for k, table in tables.items()}
        write_arrays(path, frames=np.asarray(self.frames, np.int64), **single)


def is_flame(names: Mapping[str, object] | set[str]) -> bool:
    """Whether an archive with these names holds parameters of FLAME."""
    return "expr" in names and "jaw_pose" in names


def read_flame(request: Request, parameters: Mapping[str, np.ndarray]) -> RawSequence:
    """The meshes of `parameters` (F, c) by name, of one file; frames count from 0 where it has no `frames`.

    Raises InputError where there is no model, or parameters are missing or do not go with it.
    """
    return _meshes(request, take_of(request, parameters))


def read_flame_folder(request: Request, paths: Mapping[int, Path]) -> RawSequence:
    """The same of a file a frame, `paths` by frame number; one that is damaged costs its frame.

    Raises InputError where no frame can be read.
    """
    joined, lost = _joined(request, paths)
    found = _meshes(request, take_of(request, joined))
    return replace(found, lost=found.lost | lost)


def read_parameters(request: Request) -> FlameTake:
    """The parameters of a file or folder, of all frames asked for that it has.

    Raises InputError where there are none, there is no model, or they do not go with it.
    """
    if request.path.is_dir():
        paths = numbered_files(request.path, [".npz"])
        found: Mapping[str, np.ndarray] = _joined(request, paths)[0] if paths else {}
    else:
        is_archive = request.path.suffix.lower() == ".npz"
        found = (
            read_arrays(request.path, "parameters of FLAME", **request.place) if is_archive else {}
        )
    if not is_flame(found):
        raise request.error(
            "meshes", "parameters of FLAME (expr, jaw_pose), whose weights are solved",
            "Set `apply.export.flame: false`, or name the tracker's parameters in the take sheet.",
        )  # fmt: skip
    take = take_of(request, found)
    rows = {int(number): row for row, number in enumerate(take.frames)}
    return take.of_rows(np.array([rows[frame] for frame in request.frames if frame in rows]))


def take_of(request: Request, parameters: Mapping[str, np.ndarray]) -> FlameTake:
    """All frames of the `parameters` (F, c) by name; those asked for that are not there are lost.

    Raises InputError where there is no model, or parameters are missing or do not go with it.
    """
    missing = [name for name in _NEEDED if name not in parameters]
    if missing:
        raise request.error(
            f"no {', '.join(missing)}", f"{', '.join(_NEEDED)}", "Export the parameters again."
        )
    model = read_flame_model(request)
    expr = np.atleast_2d(parameters["expr"])
    numbers = np.asarray(parameters.get("frames", np.arange(len(expr)))).astype(int).tolist()
    lost = request.absent(numbers)
    shape = np.asarray(parameters["shape"], dtype=np.float64).reshape(-1)
    if len(shape) > SHAPES or expr.shape[1] > model.n_expressions:
        raise request.error(
            f"{len(shape)} coefficients of shape and {expr.shape[1]} of expression",
            f"at most {SHAPES} and {model.n_expressions}, as the model has",
            "Name the model that the tracker used in `tracking.external.flame`.",
        )
    count, n_vertices = len(expr), len(model.template)
    poses = [_frames(request, parameters, name, count, width) for name, width in _POSES.items()]
    weight = _frames(request, parameters, _WEIGHT, count, 1)[:, 0]
    corrective = np.asarray(parameters.get(_CORRECTIVE, np.zeros((n_vertices, 3))), np.float64)
    if corrective.shape != (n_vertices, 3):
        raise request.error(
            f"a corrective of shape {corrective.shape}", f"{(n_vertices, 3)}, as the model has",
            "Name the model that the tracker used in `tracking.external.flame`.",
        )  # fmt: skip
    return FlameTake(
        model, np.array(numbers), shape, expr.astype(np.float64), np.concatenate(poses, axis=1),
        _frames(request, parameters, "translation", count, 3),
        _offset(request, parameters, n_vertices), corrective, weight, lost,
    )  # fmt: skip


def _meshes(request: Request, take: FlameTake) -> RawSequence:
    rows = {int(number): row for row, number in enumerate(take.frames)}
    meshes = {frame: take.vertices(rows[frame]) for frame in request.frames if frame in rows}
    fact = f"parameters of FLAME, {len(take.frames)} frames, {take.expr.shape[1]} of expression"
    return RawSequence(
        np.array(request.frames), filled(request.frames, meshes),
        Polygons.of_triangles(take.model.faces), unit_mm=METRE_MM, up="y", lost=take.lost,
        facts=(fact,),
    )  # fmt: skip


def _joined(
    request: Request, paths: Mapping[int, Path]
) -> tuple[dict[str, np.ndarray], dict[int, str]]:
    """Parameters (F, c) by name of a file a frame, and the frames that are lost.

    Raises InputError where no frame can be read.
    """
    lost, tables = request.absent(paths), {}
    problem = None
    for frame in request.frames:
        if frame not in lost:
            try:
                tables[frame] = read_arrays(paths[frame], "parameters of FLAME", **request.place)
            except InputError as error:
                lost[frame], problem = error.brief, error
    if not tables:
        assert problem is not None
        raise problem
    first = next(iter(tables.values()))
    names = [name for name in ("expr", "translation", *_POSES) if name in first]
    joined = {
        name: np.concatenate([np.atleast_2d(t[name]) for t in tables.values()]) for name in names
    }
    joined |= {name: first[name] for name in ("shape", "static_offset") if name in first}
    return joined | {"frames": np.array(list(tables))}, lost


def _frames(
    request: Request, parameters: Mapping[str, np.ndarray], name: str, count: int, width: int
) -> np.ndarray:
    """A parameter (count, width), zero where the file has none."""
    values = np.asarray(parameters.get(name, np.zeros((count, width)))).astype(np.float64)
    values = values[:, None] if values.ndim == 1 and width == 1 else np.atleast_2d(values)
    if values.shape != (count, width):
        raise request.error(
            f"{name} of shape {values.shape}", f"{(count, width)}", "Export the parameters again."
        )
    return values


def _offset(request: Request, parameters: Mapping[str, np.ndarray], n_vertices: int) -> np.ndarray:
    """The person's offset (W, 3), also of vertices that the tracker added to the model (teeth)."""
    found = np.asarray(parameters.get("static_offset", np.zeros((n_vertices, 3))), np.float64)
    found = found.reshape(-1, 3)
    if len(found) < n_vertices:
        raise request.error(
            f"a static_offset of {len(found)} vertices", f"{n_vertices}, as the model has",
            "Name the model that the tracker used in `tracking.external.flame`.",
        )  # fmt: skip
    return found
