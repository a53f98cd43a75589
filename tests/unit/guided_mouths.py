"""Meshes and sketches that the tests of guided correction share; no test may change one."""

from __future__ import annotations

from functools import cache

import numpy as np

from tests import heads
from tests.unit.procedural_mouth import mouth, weights_of
from vermilion.faces.model import FaceModel
from vermilion.faces.procedural import studio_model
from vermilion.geometry.camera import Camera, look_at, pinhole
from vermilion.guided.regions import GuidedRegions, regions_of_face
from vermilion.guided.silhouette import ContourSurface, Segments, inner_silhouettes, outer_contours
from vermilion.guided.sketch import Sketch, SketchCurve

IMAGE_PX = (640, 640)
UP = np.array([0.0, -1.0])


@cache
def face() -> FaceModel:
    """1.2 mm between vertices at the lips: fine enough for contours, quick to factor."""
    return studio_model(1.2, 2, None)


@cache
def regions() -> GuidedRegions:
    return regions_of_face(face(), inner_mm=5.0)


@cache
def small_face() -> FaceModel:
    return heads.small_studio()


@cache
def small_regions() -> GuidedRegions:
    return regions_of_face(small_face(), inner_mm=6.0)


@cache
def surface() -> ContourSurface:
    return ContourSurface.of_face(face(), regions())


def small_take(n_frames: int = 12, seed: int = 0) -> np.ndarray:
    """(F, V, 3) of the small face: mixtures of a few mouth shapes."""
    names = ("jawOpen", "mouthFunnel", "mouthSmile_L", "mouthSmile_R", "mouthRollLower")
    rng = np.random.default_rng(seed)
    weights = np.zeros((n_frames, small_face().n_expressions))
    for name in names:
        weights += rng.uniform(0, 0.7, (n_frames, 1)) * weights_of(small_face(), **{name: 1.0})
    return small_face().vertices(None, weights)


def camera(name: str = "front", from_side: float = 0.0, mouth_px: float = 120.0) -> Camera:
    """A camera 600 mm in front of the mouth of `face`, whose corners are `mouth_px` apart."""
    loop = face().neutral_mm[face().inner_contour]
    centre, width = loop.mean(axis=0), np.ptp(loop[:, 0])
    towards = np.array([from_side, 0.0, 1.0]) / np.hypot(from_side, 1.0)
    pose = look_at(centre + 600.0 * towards, centre, np.array([0.0, 1.0, 0.0]))
    return pinhole(name, 600.0 * mouth_px / width, *IMAGE_PX, pose)


def drawn(vertices: np.ndarray, view: Camera, outer: bool = False, kind: str = "sure") -> Sketch:
    """A sketch along the contours of a mesh, as a careful person would draw it."""
    found = inner_silhouettes(vertices, surface(), view, UP)
    upper, lower = (_edge_of(s, lowest) for s, lowest in zip(found, (True, False), strict=True))
    both = np.intersect1d(upper[:, 0], lower[:, 0])
    curves = {
        name: SketchCurve(points[np.isin(points[:, 0], both)], kind)
        for name, points in (("upper_inner", upper), ("lower_inner", lower))
    }
    if outer:
        names = ("upper_outer", "lower_outer")
        for name, segments in zip(names, outer_contours(vertices, surface(), view), strict=True):
            points = np.concatenate([segments.start_px, segments.end_px[-1:]])
            curves[name] = SketchCurve(points, kind)
    return Sketch(view.name, 0, IMAGE_PX, curves)


def open_mouth(**weights: float) -> np.ndarray:
    return mouth(face(), 0.3, **weights)


def _edge_of(segments: Segments, lowest: bool) -> np.ndarray:
    """(n, 2): the outermost point of the segments in columns two pixels apart."""
    start, end = segments.start_px, segments.end_px
    low, high = np.minimum(start, end)[:, 0], np.maximum(start, end)[:, 0]
    points = []
    for column in np.arange(2 * np.ceil(low.min() / 2), high.max(), 2.0):
        there = (low <= column) & (high >= column) & (high > low)
        if not there.any():
            continue
        a, b = start[there], end[there]
        heights = a[:, 1] + (column - a[:, 0]) / (b - a)[:, 0] * (b - a)[:, 1]
        points.append((column, heights.max() if lowest else heights.min()))
    return np.array(points)
