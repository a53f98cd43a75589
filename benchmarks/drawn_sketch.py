"""Sketches as a person would draw them: the contours that a camera sees, with a hand's error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.polylines import evenly_along
from vermilion.guided.curves import first_self_crossing
from vermilion.guided.sketch import Sketch, SketchCurve
from vermilion.studio.labels import lip_contours
from vermilion.studio.surface import StudioSurface

#: Points of a stroke, and its parts over which the hand's error is about the same.
N_POINTS, N_SWAYS = 25, 4


@dataclass(frozen=True)
class Hand:
    """Who draws.

    Attributes:
        error_px: deviation of a stroke from the contour (1 px at a mouth of 120 px).
        outer: whether the border of the red is drawn as well.
        seed: of the error.
    """

    error_px: float = 1.0
    outer: bool = True
    seed: int = 0


def drawn_sketch(
    face: FaceModel,
    surface: StudioSurface,
    vertices_mm: np.ndarray,
    camera: Camera,
    frame: int,
    hand: Hand,
) -> Sketch:
    """Both inner contours of a mesh and, if the hand draws them, the outer ones.

    Args:
        face: of the mesh's topology.
        surface: of the face.
        vertices_mm: (V, 3) true mesh, the camera's world.
        camera: of the image.
        frame: number of the frame.
        hand: who draws.
    """
    loops = lip_contours(face, surface, vertices_mm, camera)
    rng = np.random.default_rng([hand.seed, frame, sum(camera.name.encode())])
    curves = {}
    for part in ("inner", "outer") if hand.outer else ("inner",):
        for side, points in zip(("upper", "lower"), halves(loops[part]), strict=True):
            stroke = evenly_along(points, N_POINTS)
            for _ in range(10):
                drawn = stroke + hand.error_px * smooth_error(len(stroke), rng)
                if first_self_crossing(drawn) is None:
                    break
            inside = np.clip(drawn, 0.0, [camera.width_px, camera.height_px])
            curves[f"{side}_{part}"] = SketchCurve(inside)
    size = (camera.width_px, camera.height_px)
    return Sketch(camera.name, frame, size, curves)


def halves(loop_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed loop (n, 2) px split at its leftmost and rightmost points: the upper and the lower part."""
    left, right = loop_px[:, 0].argmin(), loop_px[:, 0].argmax()
    loop = np.roll(loop_px, -left, axis=0)
    turn = (right - left) % len(loop)
    first = loop[: turn + 1]
    second = np.concatenate([loop[turn:], loop[:1]])[::-1]
    if first[:, 1].mean() <= second[:, 1].mean():
        return first, second
    return second, first


def smooth_error(count: int, rng: np.random.Generator) -> np.ndarray:
    """Errors (count, 2) of deviation 1 that change smoothly along a stroke."""
    places = np.linspace(0.0, N_SWAYS, count)
    knots = np.arange(-2, N_SWAYS + 3)
    reach = np.exp(-0.5 * ((places[:, None] - knots) / 0.7) ** 2)
    reach /= np.linalg.norm(reach, axis=1, keepdims=True)
    return reach @ rng.standard_normal((len(knots), 2))
