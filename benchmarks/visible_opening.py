"""The mouth's opening as a camera sees it on a mesh: where the lips end in the image.

A fixed loop of the mesh is not that border: lips roll, and what hides the mouth changes. So rays are cast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.contours import edge_graph, geodesic_distance, upper_side
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster, interpolate

#: Surface further past the line where the lips meet is the inside of the mouth, not a lip (mm).
LIP_DEPTH_MM = 4.0
#: Rays a pixel of the mouth's height, at a mouth of `_WIDTH_PX`.
_STEP_PX, _WIDTH_PX = 0.2, 120.0


@dataclass(frozen=True)
class VisibleOpening:
    """The lips of one topology; build it once.

    Attributes:
        triangles: (T, 3).
        inside_mm: (V,) distance along the neutral past the line where the lips meet; 0 before it.
        upper: (V,) bool, nearer to the upper lip than to the lower.
        outer: (n,) vertices of the outer contour.
    """

    triangles: np.ndarray
    inside_mm: np.ndarray
    upper: np.ndarray
    outer: np.ndarray

    @classmethod
    def of(cls, model: FaceModel) -> VisibleOpening:
        """On a face model with an inside of the lips."""
        graph = edge_graph(model.neutral_mm, model.triangles)
        distance = geodesic_distance(graph, model.inner_contour)
        inside = np.where(model.regions["mouth_inner"], distance, 0.0)
        upper = upper_side(graph, model.outer_contour, model.inner_contour, model.landmarks)
        return cls(model.triangles, inside, upper, model.outer_contour)

    def borders(
        self,
        vertices_mm: np.ndarray,
        camera: Camera,
        start_px: np.ndarray,
        end_px: np.ndarray,
        n: int,
    ) -> np.ndarray:
        """Where the upper lip ends and the lower begins, across the line between two points.

        Args:
            vertices_mm: (V, 3) world; camera: of the image.
            start_px, end_px: (2,) of the line, from the right corner of the mouth to the left one.
            n: columns, evenly along the line, its ends left out.

        Returns:
            (2, n, 2) px: the end of the upper lip, the start of the lower. The same point where no opening
            is seen, NaN where there is no lip.
        """
        along = end_px - start_px
        width = max(float(np.linalg.norm(along)), 1e-9)
        down = np.array([-along[1], along[0]]) / width
        border = camera.project(vertices_mm[self.outer])
        heights = (border - start_px) @ down
        step = _STEP_PX * width / _WIDTH_PX
        rows = np.arange(np.nanmin(heights) - 2.0, np.nanmax(heights) + 2.0, step)
        places = start_px + along * ((np.arange(n) + 1.0) / (n + 1.0))[:, None]
        pixels = places[:, None] + rows[:, None] * down
        origin, directions = camera.rays(pixels)
        hits = RayCaster(vertices_mm, self.triangles).cast(origin, directions)
        corners = vertices_mm[self.triangles[np.maximum(hits.triangle, 0)]]
        normals = np.cross(
            corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
        )
        front = (normals * directions).sum(
            axis=-1
        ) < 0  # the back of a cheek, seen from the mouth, is no lip
        values = np.stack([self.inside_mm, self.upper], axis=1).astype(np.float32)
        inside, upper = np.moveaxis(interpolate(hits, self.triangles, values), -1, 0)
        lip = hits.hit & front & (inside < LIP_DEPTH_MM)
        return _ends(lip & (upper > 0.5), lip & (upper <= 0.5), pixels, step * down)


def _ends(upper: np.ndarray, lower: np.ndarray, pixels: np.ndarray, step: np.ndarray) -> np.ndarray:
    """`VisibleOpening.borders` of masks (n, m) at `pixels` (n, m, 2), `step` (2,) apart."""
    n, m = upper.shape
    columns = np.arange(n)
    last = m - 1 - np.argmax(upper[:, ::-1], axis=1)
    first = np.argmax(lower, axis=1)
    over = pixels[columns, last] + 0.5 * step
    under = pixels[columns, first] - 0.5 * step
    middle = 0.5 * (over + under)
    crossed = (first <= last)[:, None]
    over, under = np.where(crossed, middle, over), np.where(crossed, middle, under)
    seen = upper.any(axis=1, keepdims=True) & lower.any(axis=1, keepdims=True)
    return np.where(seen, np.stack([over, under]), np.nan)
