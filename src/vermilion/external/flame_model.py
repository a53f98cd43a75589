"""FLAME (Li et al. 2017) from the user's own model file: meshes of parameters, and what moves them.

With v the template, S shape and expression, P pose correctives, J the joints' regressor, and R_j the rotations of
root, neck, jaw and eyes,

    shaped = v + S (shape, expr) + offset;   posed = shaped + P (R_j - 1, j > 0)

and `posed` is skinned (linear blend skinning) by the joints J shaped: a vertex is A posed + b, with A and b the
blends of its joints' motions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from vermilion.external.sequence import Request
from vermilion.storage.arrays import read_arrays

#: Coefficients of shape in FLAME's `shapedirs`; those of expression follow.
SHAPES = 300
#: Joints: root, neck, jaw, then eyes.
JAW = 2
_MODEL = ("v_template", "f", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table")
#: Half a step (radians) of the derivative of a rotation by differences.
_STEP = 1e-4


@dataclass(frozen=True)
class Pose:
    """The joints' motions in one frame: a vertex is turn @ posed + shift.

    Attributes:
        turns: (K, 3, 3) of the joints, in the frame of the model.
        places: (K, 3) of the joints at rest.
        posed: (V, 3) the mesh before it is skinned.
        turn: (V, 3, 3) of the vertices.
        vertices: (V, 3) metres, before the translation.
    """

    turns: np.ndarray
    places: np.ndarray
    posed: np.ndarray
    turn: np.ndarray
    vertices: np.ndarray

    def at_rest(self, vectors: np.ndarray) -> np.ndarray:
        """The `vectors` (V, 3) of the vertices in the frame of the mesh at rest, but for what skinning shears."""
        return (self.turn * vectors[..., None]).sum(axis=1)


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

    @property
    def n_expressions(self) -> int:
        """Coefficients of expression."""
        return self.shapes.shape[2] - SHAPES

    def shaped(self, shape: np.ndarray, expression: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """The mesh (V, 3) at rest, metres.

        Args:
            shape: (S,) coefficients of the person, at most 300.
            expression: (E,) coefficients of the frame.
            offset: (V, 3) of the person.
        """
        moved = self.shapes[..., : len(shape)] @ shape
        return (
            self.template + moved + self.shapes[..., SHAPES:][..., : len(expression)] @ expression
        ) + offset

    def pose(self, shaped: np.ndarray, turns: np.ndarray) -> Pose:
        """The mesh of one frame.

        Args:
            shaped: (V, 3) the mesh at rest, metres.
            turns: (K, 3) rotation vectors of the joints, each in the frame of the one above.
        """
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
        blended = (self.weights @ turn.reshape(len(turn), 9)).reshape(-1, 3, 3)
        vertices = (blended * posed[:, None]).sum(axis=2) + self.weights @ shift
        return Pose(turn, places, posed, blended, vertices)

    def pull(self, pose: Pose, forces: np.ndarray) -> np.ndarray:
        """What `forces` (V, 3) on the vertices are at rest, (V, 3): the transposed derivative by `shaped`."""
        result = pose.at_rest(forces)
        # A joint's place moves all that hangs on it, and its own rotation takes a part of that back.
        shifts = self.weights.T @ forces
        places = np.empty_like(shifts)
        for joint in range(len(shifts) - 1, -1, -1):
            above = np.eye(3) if joint == 0 else pose.turns[self.parents[joint]]
            places[joint] = (above - pose.turns[joint]).T @ shifts[joint]
            if joint:
                shifts[self.parents[joint]] += shifts[joint]
        return result + self.joints.T @ places

    def jaw_motion(self, pose: Pose, jaw: np.ndarray) -> np.ndarray:
        """Derivative (3, V, 3) of the vertices by the jaw's rotation vector `jaw` (3,).

        Joints that hang on the jaw are not followed: FLAME has none.
        """
        turned, above = _turned(jaw), pose.turns[self.parents[JAW]]
        from_joint = self.weights[:, JAW, None] * (pose.posed - pose.places[JAW])
        carried = from_joint @ np.swapaxes(above @ turned, 1, 2)
        lifted = np.moveaxis(self._jaw_shapes @ turned.reshape(3, 9).T, 1, 0)
        return carried + np.stack(
            [(pose.turn * one.reshape(-1, 1, 3)).sum(axis=2) for one in lifted]
        )

    def jaw_pull(self, pose: Pose, jaw: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """What `forces` (V, 3) on the vertices are to the `jaw` (3,), (3,): the transposed `jaw_motion`."""
        turned, above = _turned(jaw), pose.turns[self.parents[JAW]]
        from_joint = self.weights[:, JAW, None] * (pose.posed - pose.places[JAW])
        carried = ((above @ turned) * (forces.T @ from_joint)).sum(axis=(1, 2))
        return carried + turned.reshape(3, 9) @ (pose.at_rest(forces).ravel() @ self._jaw_shapes)

    @cached_property
    def _jaw_shapes(self) -> np.ndarray:
        """(3 V, 9) displacements of the jaw's rotation."""
        first = 9 * (JAW - 1)
        return np.ascontiguousarray(self.pose_shapes[..., first : first + 9]).reshape(-1, 9)


def _turned(vector: np.ndarray) -> np.ndarray:
    """Derivative (3, 3, 3) of the rotation matrix by its vector (3,)."""
    steps = _STEP * np.eye(3)
    ends = [Rotation.from_rotvec(vector + sign * steps).as_matrix() for sign in (1, -1)]
    return (ends[0] - ends[1]) / (2 * _STEP)


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
    if n_joints <= JAW:
        raise request.error(
            f"a model of {n_joints} joints",
            "root, neck and jaw at least",
            remedy,
            path=request.flame,
        )
    parents = np.asarray(found["kintree_table"])[0].astype(np.int64)
    return Flame(template, faces.astype(np.int32), shapes, poses, joints, weights, parents)
