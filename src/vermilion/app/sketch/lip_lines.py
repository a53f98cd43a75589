"""Contours of a mesh in an image, for the page: as segments, and as curves to start a sketch from."""

from __future__ import annotations

import numpy as np

from vermilion.faces.contours import contour_halves
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.guided.curves import first_self_crossing, mouth_axes
from vermilion.guided.refinement import RefinementSettings, SketchView
from vermilion.guided.silhouette import ContourSurface, Segments, inner_silhouettes, outer_contours
from vermilion.guided.sketch import CURVE_NAMES, Sketch

#: A line of the mesh further from its silhouette than this share of the mouth is not its contour.
_NEAR_SHARE = 0.15


class LipLines:
    """Finds the four contours of a topology's meshes in cameras."""

    def __init__(self, face: FaceModel, surface: ContourSurface):
        self._surface = surface
        self._lines: dict[str, np.ndarray] = {}
        for part, loop in (("inner", face.inner_contour), ("outer", face.outer_contour)):
            upper, lower = contour_halves(face.neutral_mm, face.landmarks, loop)
            self._lines |= {f"upper_{part}": upper, f"lower_{part}": lower}

    def segments(self, vertices_mm: np.ndarray, camera: Camera) -> dict[str, Segments]:
        """Curve name -> segments of that contour of a mesh vertices_mm (V, 3), world."""
        line = camera.project(vertices_mm[np.concatenate([*self._lines.values()])])
        line = line[np.isfinite(line).all(axis=1)]
        up = mouth_axes([line])[1] if len(line) > 1 else np.array([0.0, -1.0])
        inner = inner_silhouettes(vertices_mm, self._surface, camera, up)
        outer = outer_contours(vertices_mm, self._surface, camera)
        return dict(zip(CURVE_NAMES, (*inner, *outer), strict=True))

    def curve(self, name: str, vertices_mm: np.ndarray, camera: Camera) -> np.ndarray | None:
        """A contour of a mesh `vertices_mm` (V, 3), world, as an open curve (n, 2) px from corner to corner.

        The line of vertices where the lips meet, moved onto the silhouette that is near; None where
        the camera does not see it.
        """
        line = camera.project(vertices_mm[self._lines[name]])
        if not np.isfinite(line).all():
            return None
        segments = self.segments(vertices_mm, camera)[name]
        if len(segments) == 0:
            return line
        points, distance = segments.nearest(line)
        onto = camera.project(points.sample(vertices_mm, self._surface.triangles))
        near = distance <= _NEAR_SHARE * np.linalg.norm(line[-1] - line[0])
        moved = np.where(near[:, None], onto, line)
        keep = np.r_[True, np.linalg.norm(np.diff(moved, axis=0), axis=1) > 0.3]
        moved = moved[keep]
        usable = len(moved) > 3 and first_self_crossing(moved) is None
        return moved if usable else line

    def off_px(self, sketch: Sketch, vertices_mm: np.ndarray, camera: Camera) -> float:
        """Mean distance of the strokes of a sketch from the contours of a mesh vertices_mm (V, 3), world."""
        view = SketchView.of(sketch, camera, RefinementSettings())
        found = view.contours(vertices_mm, self._surface)
        return float(
            np.concatenate([found[name].nearest(view.samples[name])[1] for name in found]).mean()
        )
