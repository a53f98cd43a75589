"""Images of a scan, and the landmarks that a detector finds in them, put back on its surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vermilion.geometry.camera import Camera, look_at, pinhole
from vermilion.geometry.mesh import Mesh, normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.landmarks.detector import LandmarkDetector, Landmarks
from vermilion.landmarks.scheme import N_LANDMARKS

_SKIN = np.array([0.42, 0.30, 0.24])
_BACKGROUND = 0.15


@dataclass(frozen=True)
class ScanViews:
    """A scan that can be looked at from anywhere; build it once.

    Attributes:
        mesh: the scan, in any unit.
    """

    mesh: Mesh

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(self.mesh.vertices_mm, self.mesh.triangles)

    def image(self, camera: Camera) -> np.ndarray:
        """The bare surface in a lamp above the camera, (h, w, 3) linear in [0, 1].

        Colours of the scan are not used: lips and brows have enough shape, and paint or shadow
        baked into a texture can mislead.
        """
        origins, directions = camera.rays(camera.pixel_grid())
        hits = self._caster.cast(origins, directions)
        normals = vertex_normals(self.mesh.vertices_mm, self.mesh.triangles)
        normals = normalised(interpolate(hits, self.mesh.triangles, normals))
        lamp = normalised(-directions + 0.5 * -camera.rotation[1])
        shade = 0.08 + 0.92 * np.abs((normals * lamp).sum(axis=-1))
        return np.where(hits.hit[..., None], shade[..., None] * _SKIN, _BACKGROUND)

    def on_surface(self, camera: Camera, points_px: np.ndarray) -> np.ndarray:
        """Where the rays of points_px (N, 2) meet the scan, (N, 3) in its unit; NaN where they miss."""
        origins, directions = camera.rays(points_px)
        distance = self._caster.cast(origins, directions).distance_mm.astype(np.float64)
        hit = np.isfinite(distance)
        points = origins + np.where(hit, distance, 0.0)[:, None] * directions
        return np.where(hit[:, None], points, np.nan)

    def landmarks(self, camera: Camera, detector: LandmarkDetector) -> tuple[Landmarks, np.ndarray]:
        """What the detector finds in one view, and its points (66, 3) on the surface, NaN elsewhere."""
        found = detector.detect(self.image(camera)).as_ibug66()
        if not found.found:
            return found, np.full((N_LANDMARKS, 3), np.nan)
        return found, self.on_surface(camera, found.points_px)


def camera_towards(
    middle: np.ndarray, size: float, front: np.ndarray, up: np.ndarray, size_px: int
) -> Camera:
    """A camera in front of a point.

    Args:
        middle: (3,) what it looks at, in the scan's unit and frame.
        size: width of the image there.
        front: (3,) from the point to the camera.
        up: (3,) what is up in the image.
        size_px: of the square image.
    """
    distance = 4.0 * size
    pose = look_at(np.asarray(middle) + distance * normalised(front), middle, up)
    return pinhole("scan", size_px * distance / size, size_px, size_px, pose)
