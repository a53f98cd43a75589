"""A simulated tracker of another make: its own topology, blend shapes, pose, frame, unit and errors.

It knows less than the studio: shapes without lip rolls and presses, mouth shapes that fall short, half a
frame of lag, jitter, a person whose proportions are a little off, and a head that drifts along the view.
Its meshes are in metres, in the frame of its own camera (y up, z towards the viewer).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymeshlab
from scipy.ndimage import shift
from scipy.spatial.transform import Rotation

from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import align_frames
from vermilion.geometry.camera import Camera
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import submesh, vertex_areas
from vermilion.geometry.surface_points import SurfacePoints

#: Shapes that the tracker has not: what rolls, presses and shrugs the lips.
UNKNOWN = ("Roll", "Press", "Shrug", "Close", "Dimple", "Stretch")
#: Its mouth shapes reach this share of the truth.
SHORT = 0.75
LAG_FRAMES = 0.5
#: Jitter: of weights, of the head (degrees, mm); drift along the view (mm); proportions (deviations).
WEIGHT_JITTER, TURN_DEG, SHIFT_MM, DRIFT_MM, PERSON = 0.02, 0.15, 0.15, 4.0, 0.3
METRE_MM = 1000.0
#: Its camera's frame in that of COLMAP: y up, z towards the viewer.
OPENGL = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class ForeignTracker:
    """Its topology, bound to the studio's face model.

    Attributes:
        face: the studio's model.
        points: (V,) its vertices on the studio's mesh.
        triangles: (T, 3).
    """

    face: FaceModel
    points: SurfacePoints
    triangles: np.ndarray

    @classmethod
    def of(cls, face: FaceModel, n_triangles: int = 9000) -> ForeignTracker:
        """A mesh of about so many triangles, which follows no line of the face."""
        opening = face.expressions_mm[face.expression_names.index("jawOpen")]
        pose = face.neutral_mm + 0.5 * opening  # lips apart: none is bound to the other
        kept, triangles = submesh(face.triangles, ~face.regions["teeth"])
        meshes = pymeshlab.MeshSet(verbose=False)
        meshes.add_mesh(pymeshlab.Mesh(pose[kept].astype(float), triangles.astype(np.int32)))
        # All parameters: what is left out has the value of the last call in this process.
        meshes.meshing_decimation_quadric_edge_collapse(
            targetfacenum=n_triangles, targetperc=0.0, qualitythr=0.3, preserveboundary=True,
            boundaryweight=1.0, preservenormal=False, preservetopology=True, optimalplacement=True,
            planarquadric=False, planarweight=0.001, qualityweight=False, autoclean=True, selected=False,
        )  # fmt: skip
        mesh = meshes.current_mesh()
        points = Surface(pose, face.triangles).closest(np.array(mesh.vertex_matrix()))
        # Another order of vertices than any that the decimation has of the original's.
        order = np.random.default_rng(7).permutation(len(points))
        rank = np.empty(len(order), dtype=np.int32)
        rank[order] = np.arange(len(order))
        return cls(face, points[order], rank[np.array(mesh.face_matrix())])

    def sample(self, values: np.ndarray) -> np.ndarray:
        """Values (..., V', D) of the studio's vertices at the tracker's, (..., V, D)."""
        return self.points.sample(values, self.face.triangles)

    def track(
        self, truth_mm: np.ndarray, neutral_mm: np.ndarray, camera: Camera, seed: int, person: int
    ) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """What it makes of a take.

        Args:
            truth_mm: (F, V', 3) of the studio, world; neutral_mm: (V', 3) the actor's, head frame.
            camera: that the take was seen by.
            seed: of the take's noise; person: of the actor's proportions.

        Returns:
            meshes (F, V, 3) in metres in its own camera's frame, weights (F, K), K names.
        """
        rng, face = np.random.default_rng(seed), self.face
        rigid = face.regions["rigid"] * vertex_areas(face.neutral_mm, face.triangles)
        heads = align_frames(truth_mm, neutral_mm, rigid)
        known = [not any(part in name for part in UNKNOWN) for name in face.expression_names]
        names = [n for n, has in zip(face.expression_names, known, strict=True) if has]
        shapes = face.expressions_mm[known].astype(np.float64)
        weights = self._weights(heads.apply(truth_mm) - neutral_mm, shapes, names, rng)
        modes = face.identities_mm.astype(np.float64)
        wrong = PERSON * np.random.default_rng(person).normal(size=len(modes))
        own_neutral = self.sample(neutral_mm + np.tensordot(wrong, modes, axes=1))
        head = own_neutral + np.tensordot(weights, self.sample(shapes), axes=1)
        rotation = np.swapaxes(heads.rotations, 1, 2)
        translation = -np.einsum("fij,fj->fi", rotation, heads.translations_mm)
        count = len(truth_mm)
        noise = Rotation.from_rotvec(np.radians(TURN_DEG) * rng.normal(size=(count, 3)))
        rotation = noise.as_matrix() @ rotation
        translation = translation + SHIFT_MM * rng.normal(size=(count, 3))
        world = head @ np.swapaxes(rotation, 1, 2) + translation[:, None]
        drift = DRIFT_MM * np.sin(np.arange(count) / 11.0)[:, None, None]
        in_camera = camera.to_camera(world) + drift * np.array([0.0, 0.0, 1.0])
        return in_camera @ OPENGL / METRE_MM, weights, names

    def _weights(
        self, moved_mm: np.ndarray, shapes: np.ndarray, names: list[str], rng: np.random.Generator
    ) -> np.ndarray:
        """Its weights (F, K) for true displacements (F, V', 3): nearest shapes, short, late, unsteady."""
        skin = self.face.regions["face"]
        matrix = shapes[:, skin].reshape(len(shapes), -1).T
        ridge = 1e-3 * np.trace(matrix.T @ matrix) / len(shapes) * np.eye(len(shapes))
        right = matrix.T @ moved_mm[:, skin].reshape(len(moved_mm), -1).T
        weights = np.clip(np.linalg.solve(matrix.T @ matrix + ridge, right).T, 0.0, 1.0)
        mouth = np.array([n.startswith(("mouth", "jaw")) for n in names])
        weights = weights * np.where(mouth, SHORT, 1.0)
        weights = shift(weights, (LAG_FRAMES, 0.0), order=1, mode="nearest")
        return np.clip(weights + WEIGHT_JITTER * rng.normal(size=weights.shape), 0.0, 1.0)


def write_objs(folder: Path, meshes: np.ndarray, triangles: np.ndarray, first: int) -> None:
    """A numbered OBJ a frame: `meshes` (F, V, 3) from frame `first`."""
    folder.mkdir(parents=True, exist_ok=True)
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in triangles + 1)
    for row, vertices in enumerate(meshes):
        lines = "".join(f"v {x:.8f} {y:.8f} {z:.8f}\n" for x, y, z in vertices)
        (folder / f"head.{first + row:04d}.obj").write_text(lines + faces)
