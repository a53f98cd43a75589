"""Landmarks of a head that is turned away: hidden ones do not count, the far jaw slides on the silhouette.

A detector answers with all its points. Of those that the nose or the cheek hides it can only guess, and the points
of the far jaw it puts where the face ends in the image, not where the jaw is. So, given about where the head is,

- a landmark that the mesh hides, or that lies on a side that faces away, has no trust;
- an observed point of the far jaw is compared with the nearest point of the mesh's silhouette. The observation is
  moved by the difference between the model's jaw and that point, so that at the solution the silhouette lies on it.

Frames whose head looks at the camera are left as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import triangle_cross
from vermilion.geometry.raycast import RayCaster
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.landmark_fit.observation import Observations, project

#: Heads turned by less are left alone, degrees between the face's axis and the line to the camera.
LEAST_TURN_DEG = 22.0
#: A landmark this far behind the mesh is hidden, mm; lips and lids are not hidden by themselves.
_BEHIND_MM = 4.0
#: Cosine to the camera at which a landmark's side stops to count, and at which it counts in full.
_AWAY, _TOWARDS = 0.0, 0.3
#: The silhouette is looked for within this many inter-ocular distances of an observed point.
_REACH = 0.5


def turned_frames(rotation: np.ndarray, translation_mm: np.ndarray) -> np.ndarray:
    """Frames (F,) bool whose head is turned away from the camera.

    Args:
        rotation: (F, 3, 3) camera from head.
        translation_mm: (F, 3) of the head in the camera frame.
    """
    towards = -translation_mm / np.linalg.norm(translation_mm, axis=1, keepdims=True)
    cosine = (rotation[:, :, 2] * towards).sum(axis=1)
    return cosine < np.cos(np.radians(LEAST_TURN_DEG))


def model_meshes(
    model: FaceModel, identity: np.ndarray, motion: HeadMotion
) -> Callable[[int], np.ndarray]:
    """Row -> mesh (V, 3) mm in the camera frame, of a person's `identity` (I,) in motion."""

    def mesh_of(row: int) -> np.ndarray:
        local = model.vertices(identity, motion.weights[row][None])[0]
        return local @ motion.rotation[row].T + motion.translation_mm[row]

    return mesh_of


def as_seen_turned(
    seen: Observations,
    model: FaceModel,
    mesh_of: Callable[[int], np.ndarray],
    turned: np.ndarray,
    focal_px: float,
) -> Observations:
    """Observations with what turned heads hide taken out, given about where the heads are.

    Args:
        seen: F frames, of the 66 landmarks that the model names.
        model: topology.
        mesh_of: row -> mesh (V, 3) mm, camera frame.
        turned: (F,) bool, frames to look at (`turned_frames`).
        focal_px: of the camera.
    """
    rows = np.flatnonzero(turned & seen.valid)
    if not len(rows) or seen.landmark_set.n_points != len(model.landmarks):
        return seen
    image, trust = seen.image.copy(), seen.trust.copy()
    for row in rows:
        mesh = mesh_of(int(row))
        facing, hidden = _facing(mesh, model), _hidden(mesh, model)
        factor = np.clip((facing - _AWAY) / (_TOWARDS - _AWAY), 0.0, 1.0) * ~hidden
        at_jaw = project(mesh[model.landmarks], focal_px)
        outline = project(mesh[_silhouette(mesh, model)], focal_px)
        corners = at_jaw[seen.landmark_set.eye_corners]
        reach_px = _REACH * max(float(np.linalg.norm(corners[0] - corners[1])), 1.0)
        for point in seen.landmark_set.jaw:
            if factor[point] >= 1.0:
                continue
            factor[point] = 0.0
            away = np.linalg.norm(outline - image[row, point], axis=1)
            if len(away) and away.min() < reach_px:
                image[row, point] += at_jaw[point] - outline[np.argmin(away)]
                factor[point] = 1.0
        trust[row] *= factor
    return replace(seen, image=image, trust=trust)


def _facing(mesh_mm: np.ndarray, model: FaceModel) -> np.ndarray:
    """Cosine (N,) to the camera of the side that each landmark lies on: out of the head, not of a lip."""
    points = mesh_mm[model.landmarks]
    jaw_ends = points[[0, 16]].mean(axis=0)
    out = points - jaw_ends
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
    rays = points / np.linalg.norm(points, axis=1, keepdims=True)
    return -(out * rays).sum(axis=1)


def _hidden(mesh_mm: np.ndarray, model: FaceModel) -> np.ndarray:
    """(N,) bool, landmarks behind the mesh."""
    points = mesh_mm[model.landmarks]
    distance = np.linalg.norm(points, axis=1)
    hits = RayCaster(mesh_mm, model.triangles).cast(np.zeros(3), points / distance[:, None])
    return np.asarray(hits.distance_mm < distance - _BEHIND_MM)


def _silhouette(mesh_mm: np.ndarray, model: FaceModel) -> np.ndarray:
    """Vertices (n,) of the face that the camera sees edge-on, between what faces it and what does not."""
    cross = triangle_cross(mesh_mm, model.triangles)
    front = (cross * mesh_mm[model.triangles[:, 0]]).sum(axis=1) < 0
    touched = np.zeros((2, len(mesh_mm)), dtype=bool)
    for side in (0, 1):
        touched[side, model.triangles[front == bool(side)]] = True
    edge = np.flatnonzero(touched.all(axis=0) & model.regions["face"])
    points = mesh_mm[edge]
    distance = np.linalg.norm(points, axis=1)
    hits = RayCaster(mesh_mm, model.triangles).cast(np.zeros(3), points / distance[:, None])
    return edge[hits.distance_mm > distance - _BEHIND_MM]
