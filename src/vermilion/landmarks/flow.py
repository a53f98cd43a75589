"""Dense flow between consecutive images of a face, and points that it carries (Mono13 5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.landmarks.scheme import face_size_px

#: Room round the landmarks, in face sizes.
_MARGIN = 0.12


@dataclass(frozen=True)
class PairFlow:
    """Flow both ways between the crops of two images a and b round the face.

    Attributes:
        forward, backward: (h, w, 2) float16, crop pixels, from a to b and from b to a.
        corner_a, corner_b: (2,) image pixels of the crops' corners.
        scale: (2,) crop pixels of an image pixel.
    """

    forward: np.ndarray
    backward: np.ndarray
    corner_a: np.ndarray
    corner_b: np.ndarray
    scale: np.ndarray

    def reversed(self) -> PairFlow:
        """From b to a."""
        return PairFlow(self.backward, self.forward, self.corner_b, self.corner_a, self.scale)

    def carry(self, points_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where points (N, 2) of a lie in b, px, and how far from where they were (N,), px, the
        flow back from there leads."""
        start = (points_px - self.corner_a) * self.scale
        there = start + _sample(self.forward, start)
        astray = there + _sample(self.backward, there) - start
        moved = there / self.scale + self.corner_b
        return moved, np.linalg.norm(astray / self.scale, axis=1)


class FaceFlow:
    """Flow of faces by dense inverse search (Kroeger et al. 2016), always at the same size.

    Attributes:
        face_px: root of the area of the landmarks' bounding box in the crops.
    """

    def __init__(self, face_px: float = 280.0):
        self.face_px = face_px
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._flow.setFinestScale(0)

    def between(
        self, grey_a: np.ndarray, grey_b: np.ndarray, shape_a: np.ndarray, shape_b: np.ndarray
    ) -> PairFlow:
        """Flow between two images of a face.

        Args:
            grey_a, grey_b: (h, w) in [0, 1].
            shape_a, shape_b: (66, 2) px, about where the face is in each.
        """
        low = [shape.min(axis=0) for shape in (shape_a, shape_b)]
        high = [shape.max(axis=0) for shape in (shape_a, shape_b)]
        size = max(face_size_px(shape_a), face_size_px(shape_b))
        extent = np.maximum(high[0] - low[0], high[1] - low[1]) + 2 * _MARGIN * size
        extent = np.ceil(extent).astype(int)
        corners = [
            np.rint((a + b - extent) / 2).astype(int) for a, b in zip(low, high, strict=True)
        ]
        target = np.maximum(np.rint(extent * (self.face_px / size)).astype(int), 32)
        crops = [
            _crop(grey, corner, extent, target)
            for grey, corner in zip((grey_a, grey_b), corners, strict=True)
        ]
        forward, backward = self._dense(*crops), self._dense(*crops[::-1])
        return PairFlow(forward, backward, corners[0], corners[1], target / extent)

    def _dense(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        flow = self._flow.calc(a, b, None)  # type: ignore[call-overload] # the last may be None
        return flow.astype(np.float16)


def carry_along(flows: Sequence[PairFlow], points_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`points_px` (N, 2) of the first image in all images of a row (Mono13 eq. 5).

    Returns:
        (len(flows) + 1, N, 2) px, and (len(flows) + 1, N) px how far the flows have not led back,
        summed up to each image.
    """
    points, astray = [points_px], [np.zeros(len(points_px))]
    for flow in flows:
        moved, off = flow.carry(points[-1])
        points.append(moved)
        astray.append(astray[-1] + off)
    return np.array(points), np.array(astray)


def _crop(grey: np.ndarray, corner: np.ndarray, extent: np.ndarray, target: np.ndarray):
    """The box at `corner` of size `extent` (x, y) resized to `target`, uint8; edges go on."""
    rows = np.clip(np.arange(corner[1], corner[1] + extent[1]), 0, grey.shape[0] - 1)
    columns = np.clip(np.arange(corner[0], corner[0] + extent[0]), 0, grey.shape[1] - 1)
    box = np.rint(np.clip(grey[rows][:, columns], 0, 1) * 255).astype(np.uint8)
    shrinks = (target < extent).any()
    return cv2.resize(
        box, tuple(map(int, target)), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    )


def _sample(flow: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Flow (h, w, 2) at points (N, 2) by bilinear interpolation; beyond the edge as on it."""
    height, width = flow.shape[:2]
    place = np.clip(points - 0.5, 0, [width - 1, height - 1])
    low = np.minimum(place.astype(int), [width - 2, height - 2])
    x, y = (place - low).T[..., None]
    c, r = low.T
    top = (1 - x) * flow[r, c] + x * flow[r, c + 1]
    bottom = (1 - x) * flow[r + 1, c] + x * flow[r + 1, c + 1]
    return (1 - y) * top + y * bottom
