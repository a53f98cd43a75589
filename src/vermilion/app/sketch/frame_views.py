"""Meshes as the page draws them: in 3D in the head's frame, and over an image in pixels."""

from __future__ import annotations

import numpy as np

from vermilion.app.sketch.lip_lines import LipLines
from vermilion.app.sketch.packet import pack
from vermilion.app.sketch.take_data import TakeData


class FrameViews:
    """Packets for the page.

    Attributes:
        drawn: (U,) vertices of the mouth, which are drawn over the image.
    """

    def __init__(self, data: TakeData, lines: LipLines):
        self._data, self._lines = data, lines
        self.drawn = data.regions.mouth_vertices
        number = np.full(data.face.n_vertices, -1)
        number[self.drawn] = np.arange(len(self.drawn))
        of_mouth = np.union1d(data.regions.predicted, data.regions.trusted)
        self._mouth = number[data.face.triangles[of_mouth]]
        self._inner = np.isin(of_mouth, data.regions.predicted)

    def topology(self) -> bytes:
        """Triangles of the mesh and of its mouth; which of these are predicted; where the mouth is."""
        face = self._data.face
        mouth = self._data.neutral_mm[face.inner_contour]
        header = {"mouth_mm": mouth.mean(axis=0).tolist(), "width_mm": float(np.ptp(mouth[:, 0]))}
        inner = np.zeros(face.n_vertices, dtype=np.uint8)
        inner[self._data.regions.inner_vertices] = 1
        return pack(
            header,
            {
                "triangles": face.triangles.astype(np.uint32),
                "mouth_triangles": self._mouth.astype(np.uint32),
                "predicted": self._inner.astype(np.uint8),
                "mouth_vertices": self.drawn.astype(np.uint32),
                "inner": inner,
            },
        )

    def mesh(self, mesh_mm: np.ndarray, base_mm: np.ndarray, camera_name: str) -> bytes:
        """A mesh (V, 3), world, beside `base_mm` (V, 3) that it was made from, seen by a camera.

        Both in the head frame of the base, so that the 3D view keeps still.
        """
        camera = self._data.camera(camera_name)
        to_head = self._data.head_from_world(base_mm)
        seen = mesh_mm[self.drawn]
        moved = np.linalg.norm(mesh_mm - base_mm, axis=1)
        arrays = {
            "vertices_mm": to_head.apply(mesh_mm).astype(np.float32),
            "moved_mm": moved.astype(np.float32),
            "mouth_px": np.nan_to_num(camera.project(seen), nan=-1e6).astype(np.float32),
            "mouth_depth_mm": camera.to_camera(seen)[:, 2].astype(np.float32),
        }
        for name, segments in self._lines.segments(mesh_mm, camera).items():
            ends = np.concatenate([segments.start_px, segments.end_px], axis=1)
            arrays[f"contour_{name}"] = ends.reshape(-1, 4).astype(np.float32)
        inner = self._data.regions.inner_vertices
        header = {
            "largest_mm": float(moved.max()),
            "inner_mean_mm": float(moved[inner].mean()),
        }
        return pack(header, arrays)
