"""Sequences of parameters of FLAME (Li et al. 2017), whose meshes the user's own model file gives.

The names are those that VHAP writes. With v the template, S shape and expression, P pose correctives, J the
joints' regressor, and R_j the rotations of root, neck, jaw and eyes,

    shaped = v + S (shape, expr) + static_offset;   posed = shaped + P (R_j - 1, j > 0)

and `posed` is skinned (linear blend skinning) by the joints J shaped, and moved by the translation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from vermilion.external.sequence import RawSequence, Request, filled
from vermilion.geometry.polygons import Polygons
from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError

#: Coefficients of shape in FLAME's `shapedirs`; those of expression follow.
_SHAPES = 300
_MODEL = ("v_template", "f", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table")
#: Parameters a file must have, and those that are zero where it has none: name -> numbers a frame.
_NEEDED = ("shape", "expr", "jaw_pose")
_POSES = {"rotation": 3, "neck_pose": 3, "jaw_pose": 3, "eyes_pose": 6}
_METRE_MM = 1000.0


@dataclass(frozen=True)
class Flame:
    """The user's model.

    Attributes:
        template: (V, 3) metres.
        faces: (T, 3).
        shapes: (V, 3, S) displacements of shape and expression.
        pose_shapes: (V, 3, 9 (K - 1)) displacements of the joints' rotations.
        joints: (K, V) sparse, joints of vertices.
        weights: (V, K) of the skinning.
        parents: (K,) joint above each; that of the root is not used.
    """

    template: np.ndarray
    faces: np.ndarray
    shapes: np.ndarray
    pose_shapes: np.ndarray
    joints: sparse.csr_matrix
    weights: np.ndarray
    parents: np.ndarray

    def vertices(
        self, coefficients: np.ndarray, offset: np.ndarray, turns: np.ndarray
    ) -> np.ndarray:
        """The mesh (V, 3) of one frame before its translation, metres.

        Args:
            coefficients: (S,) of shape and expression.
            offset: (V, 3) of the person.
            turns: (K, 3) rotation vectors of the joints, each in the frame of the one above.
        """
        shaped = self.template + self.shapes @ coefficients + offset
        rotations = Rotation.from_rotvec(turns).as_matrix()
        posed = shaped + self.pose_shapes @ (rotations[1:] - np.eye(3)).ravel()
        places = self.joints @ shaped
        turn, shift = np.empty((len(turns), 3, 3)), np.empty((len(turns), 3))
        for joint, parent in enumerate(self.parents):
            above_turn, above = (
                (np.eye(3), np.zeros(3)) if joint == 0 else (turn[parent], shift[parent])
            )
            turn[joint] = above_turn @ rotations[joint]
            # A joint stays where the one above takes it.
            shift[joint] = above_turn @ places[joint] + above - turn[joint] @ places[joint]
        moved = np.einsum("kij,vj->vki", turn, posed) + shift
        return (self.weights[:, :, None] * moved).sum(axis=1)


def read_flame_model(request: Request) -> Flame:
    """Read the model file that the request names.

    Raises InputError where there is none, or its arrays are not those of FLAME.
    """
    if request.flame is None:
        raise request.error(
            "parameters of FLAME", "your model file in `tracking.external.flame`",
            "Convert it to .npz as docs/interchange.md says.",
        )  # fmt: skip
    remedy = "Convert the model as docs/interchange.md says."
    found = read_arrays(request.flame, "FLAME model", _MODEL, remedy=remedy, **request.place)
    template, weights = (found[name].astype(np.float64) for name in ("v_template", "weights"))
    shapes, poses = (found[name].astype(np.float64) for name in ("shapedirs", "posedirs"))
    joints, faces = sparse.csr_matrix(found["J_regressor"].astype(np.float64)), found["f"]
    count, n_joints = len(template), weights.shape[-1]
    wanted = {
        "v_template": (template.shape, (count, 3)), "weights": (weights.shape, (count, n_joints)),
        "shapedirs": (shapes.shape[:2], (count, 3)), "J_regressor": (joints.shape, (n_joints, count)),
        "posedirs": (poses.shape, (count, 3, 9 * (n_joints - 1))), "f": (faces.shape[1:], (3,)),
    }  # fmt: skip
    for name, (shape, expected) in wanted.items():
        if shape != expected:
            raise request.error(
                f"{name} of shape {shape}", f"{expected}", remedy, path=request.flame
            )
    parents = np.asarray(found["kintree_table"])[0].astype(np.int64)
    return Flame(template, faces.astype(np.int32), shapes, poses, joints, weights, parents)


def is_flame(names: Mapping[str, object] | set[str]) -> bool:
    """Whether an archive with these names holds parameters of FLAME."""
    return "expr" in names and "jaw_pose" in names


def read_flame(request: Request, parameters: Mapping[str, np.ndarray]) -> RawSequence:
    """The meshes of `parameters` (F, c) by name, of one file; frames count from 0 where it has no `frames`.

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
    if len(shape) > _SHAPES or _SHAPES + expr.shape[1] > model.shapes.shape[2]:
        raise request.error(
            f"{len(shape)} coefficients of shape and {expr.shape[1]} of expression",
            f"at most {_SHAPES} and {model.shapes.shape[2] - _SHAPES}, as the model has",
            "Name the model that the tracker used in `tracking.external.flame`.",
        )
    turns = np.concatenate(
        [_frames(request, parameters, name, len(expr), width) for name, width in _POSES.items()], axis=1
    ).reshape(len(expr), -1, 3)[:, : len(model.parents)]  # fmt: skip
    places = _frames(request, parameters, "translation", len(expr), 3)
    offset = _offset(request, parameters, len(model.template))
    meshes, rows = {}, {number: row for row, number in enumerate(numbers)}
    for frame in request.frames:
        if frame in rows:
            row, coefficients = rows[frame], np.zeros(model.shapes.shape[2])
            coefficients[: len(shape)] = shape
            coefficients[_SHAPES : _SHAPES + expr.shape[1]] = expr[row]
            meshes[frame] = model.vertices(coefficients, offset, turns[row]) + places[row]
    return RawSequence(
        np.array(request.frames), filled(request.frames, meshes), Polygons.of_triangles(model.faces),
        unit_mm=_METRE_MM, up="y", lost=lost,
        facts=(f"parameters of FLAME, {len(expr)} frames, {expr.shape[1]} of expression",),
    )  # fmt: skip


def read_flame_folder(request: Request, paths: Mapping[int, Path]) -> RawSequence:
    """The same of a file a frame, `paths` by frame number; one that is damaged costs its frame.

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
    found = read_flame(request, joined | {"frames": np.array(list(tables))})
    return replace(found, lost=found.lost | lost)


def _frames(
    request: Request, parameters: Mapping[str, np.ndarray], name: str, count: int, width: int
) -> np.ndarray:
    """A parameter (count, width), zero where the file has none."""
    values = np.atleast_2d(parameters.get(name, np.zeros((count, width)))).astype(np.float64)
    if values.shape != (count, width):
        raise request.error(
            f"{name} of shape {values.shape}", f"{(count, width)}", "Export the parameters again."
        )
    return values


def _offset(request: Request, parameters: Mapping[str, np.ndarray], n_vertices: int) -> np.ndarray:
    """The person's offset (V, 3); vertices that the tracker added to the model (teeth) are left out."""
    found = np.asarray(parameters.get("static_offset", np.zeros((n_vertices, 3))), np.float64)
    found = found.reshape(-1, 3)
    if len(found) < n_vertices:
        raise request.error(
            f"a static_offset of {len(found)} vertices", f"{n_vertices}, as the model has",
            "Name the model that the tracker used in `tracking.external.flame`.",
        )  # fmt: skip
    return found[:n_vertices]
