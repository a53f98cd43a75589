"""Virtual make-up: pigments on the tracked skin, lit with the estimated lighting (Mono13 9)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from vermilion.appearance.harmonics import irradiance
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.mesh import normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster, interpolate
from vermilion.imaging.images import srgb_to_linear
from vermilion.landmarks.scheme import EYE_LEFT, EYE_RIGHT

_SMOOTH = 1.5  # vertices of the contour
_LUMA = np.array([0.2126, 0.7152, 0.0722])
#: The checkerboard lies on a cylinder round the head: its radius, its axis behind the face's middle.
_CYLINDER_MM, _AXIS_BEHIND_MM = 75.0, 70.0


@dataclass(frozen=True)
class Pigment:
    """One layer of make-up.

    Attributes:
        colour: (3,) linear albedo.
        opacity: where it is thickest, 0 to 1.
        inside: points (..., 3) of the neutral, head frame -> how far (...,) mm inside its outline
            they lie, negative outside; None for lipstick, whose outline is the model's.
        soft_mm: over which the layer fades at its outline.
    """

    colour: np.ndarray
    opacity: float
    inside: Callable[[np.ndarray], np.ndarray] | None
    soft_mm: float


def colour_of_hex(text: str) -> np.ndarray:
    """Linear RGB (3,) of `#rrggbb`."""
    values = [int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    return np.asarray(srgb_to_linear(np.array(values)), dtype=np.float64)


def lipstick(colour: str, opacity: float) -> Pigment:
    """On the red of the lips: it ends at the outer contour; the mouth's inside has none."""
    return Pigment(colour_of_hex(colour), opacity, None, 0.9)


def eye_shadow(
    model: FaceModel, neutral_mm: np.ndarray, colour: str, opacity: float, height_mm: float = 14.0
) -> Pigment:
    """From the edge of the upper lids of `neutral_mm` (V, 3) up to `height_mm` above them, fading out."""
    lids = [neutral_mm[model.landmarks[eye[:4]]] for eye in (EYE_RIGHT, EYE_LEFT)]
    lids = [lid[np.argsort(lid[:, 0])] for lid in lids]

    def inside(points: np.ndarray) -> np.ndarray:
        x, y = points[..., 0], points[..., 1]
        shapes = []
        for lid in lids:
            above = y - np.interp(x, lid[:, 0], lid[:, 1])
            # Full at the lid, nothing at the arch over it, which meets the lid beyond its corners.
            middle, half = 0.5 * (lid[0, 0] + lid[-1, 0]), 0.6 * (lid[-1, 0] - lid[0, 0])
            arch = height_mm * (1 - ((x - middle) / half) ** 4)
            shapes.append(np.where(above > -0.5, arch - above - 0.5 * height_mm, -height_mm))
        return np.where(points[..., 2] > 0, np.maximum(*shapes), -height_mm)

    return Pigment(colour_of_hex(colour), opacity, inside, height_mm)


def star(
    centre_mm: np.ndarray, size_mm: float, turn: float, colour: str, opacity: float
) -> Pigment:
    """A five-pointed star about `centre_mm` (3,), head frame, seen from the front; `turn` in radians."""
    # The edge from a tip (straight up) to a notch (36 degrees), as a line's normal form.
    tip = np.array([0.0, size_mm])
    notch = 0.42 * size_mm * np.array([np.sin(np.pi / 5), np.cos(np.pi / 5)])
    normal = np.array([tip[1] - notch[1], notch[0] - tip[0]])
    normal /= np.linalg.norm(normal)

    def inside(points: np.ndarray) -> np.ndarray:
        offset = points[..., :2] - centre_mm[:2]
        radius = np.linalg.norm(offset, axis=-1)
        angle = np.arctan2(offset[..., 0], offset[..., 1]) + turn
        wedge = np.abs(np.mod(angle + np.pi / 5, 2 * np.pi / 5) - np.pi / 5)
        place = np.stack([radius * np.sin(wedge), radius * np.cos(wedge)], axis=-1)
        return np.where(points[..., 2] > 0, (tip - place) @ normal, -size_mm)

    return Pigment(colour_of_hex(colour), opacity, inside, 0.6)


def lip_outline(model: FaceModel, neutral_mm: np.ndarray) -> np.ndarray:
    """How far (V,) mm inside the lips' outer contour `neutral_mm` (V, 3) lies, seen from the front."""
    # The loop runs along edges of the mesh, in steps that no lipstick has.
    loop = gaussian_filter1d(neutral_mm[model.outer_contour, :2], _SMOOTH, axis=0, mode="wrap")
    loop = loop.astype(np.float32)
    points = [(float(x), float(y)) for x, y in neutral_mm[:, :2]]
    signed = np.array([cv2.pointPolygonTest(loop, point, True) for point in points])
    return np.where(neutral_mm[:, 2] > 0, signed, -np.abs(signed))


class MakeUp:
    """Draws make-up and the checkerboard on one person's face in images of one light.

    Args:
        model, neutral_mm: the tracker's model and the person's neutral (V, 3).
        light: (9, 3) harmonics, camera frame.
        albedo: (V, 3) estimated skin, linear.
        pigments: from below to above.
        checker_mm: side of a square of the checkerboard.
    """

    def __init__(
        self,
        model: FaceModel,
        neutral_mm: np.ndarray,
        light: np.ndarray,
        albedo: np.ndarray,
        pigments: list[Pigment],
        checker_mm: float = 8.0,
    ):
        keep = model.regions["face"] | model.regions["mouth_inner"]
        self.triangles = model.triangles[keep[model.triangles].all(axis=1)]
        skin = (model.regions["face"] & ~model.regions["mouth_inner"]).astype(float)
        self.light, self.pigments, self.checker_mm = light, pigments, checker_mm
        # Of each vertex: albedo (3), whether it is skin, place in the neutral (3), depth in the lips.
        self.values = np.column_stack([albedo, skin, neutral_mm, lip_outline(model, neutral_mm)])
        self.axis_mm = np.median(neutral_mm[:, 2]) - _AXIS_BEHIND_MM

    def draw(
        self, image: np.ndarray, camera: Camera, vertices_mm: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The image with make-up, and with the checkerboard, both (h, w, 3) linear.

        Args:
            image: (h, w, 3) linear RGB of `camera`.
            vertices_mm: (V, 3) in the world.
        """
        # Twice as fine as the image, so that outlines are smooth.
        fine = camera.resized(2.0)
        x0, y0, x1, y1 = _box(camera, vertices_mm)
        grid = fine.pixel_grid()[2 * y0 : 2 * y1, 2 * x0 : 2 * x1]
        hits = RayCaster(vertices_mm, self.triangles).cast(*fine.rays(grid))
        normals = vertex_normals(vertices_mm, self.triangles) @ camera.rotation.T
        light = irradiance(normalised(interpolate(hits, self.triangles, normals)), self.light)
        found = interpolate(hits, self.triangles, self.values)
        part = cv2.resize(image[y0:y1, x0:x1], grid.shape[1::-1], interpolation=cv2.INTER_CUBIC)
        part = np.maximum(part, 0.0)
        trusted = hits.hit * np.clip(found[..., 3], 0, 1)
        results = []
        for drawn in (
            self._make_up(part, found, light, trusted),
            self._checkerboard(part, found, light, trusted),
        ):
            result = image.copy()
            change = cv2.resize(drawn - part, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
            result[y0:y1, x0:x1] = np.clip(image[y0:y1, x0:x1] + change, 0, None)
            results.append(result)
        return results[0], results[1]

    def _make_up(self, part, found, light, trusted):
        # What the smooth light does not explain (creases, shadows, gloss) shades the pigment too.
        expected = np.maximum((found[..., :3] * light) @ _LUMA, 1e-3)
        detail = (part @ _LUMA) / expected
        # Teeth and the dark between the lips are no skin.
        like_skin = _step(detail, 0.2, 0.45) * (1 - _step(detail, 2.2, 3.2))
        shaded = light * np.clip(detail, 0.0, 2.5)[..., None]
        result = part
        for pigment in self.pigments:
            if pigment.inside is None:
                inside = found[..., 7]
            else:
                inside = pigment.inside(found[..., 4:7])
            cover = _step(inside, -0.5 * pigment.soft_mm, 0.5 * pigment.soft_mm)
            cover = (pigment.opacity * cover * trusted * like_skin)[..., None]
            result = (1 - cover) * result + cover * pigment.colour * shaded
        return result

    def _checkerboard(self, part, found, light, trusted):
        x, y, z = (found[..., k] for k in (4, 5, 6))
        around = np.arctan2(x, z - self.axis_mm) * _CYLINDER_MM
        square = (np.floor(around / self.checker_mm) + np.floor(y / self.checker_mm)) % 2
        colour = np.where(square[..., None] > 0, [0.75, 0.75, 0.75], [0.05, 0.09, 0.22])
        cover = 0.75 * trusted[..., None]
        return (1 - cover) * part + cover * colour * light


def _box(camera: Camera, vertices_mm: np.ndarray) -> tuple[int, int, int, int]:
    """Left, top, right, bottom (pixels) of the part of the image that the vertices are in."""
    pixels = camera.project(vertices_mm)
    size = np.array([camera.width_px, camera.height_px])
    low = np.clip(np.floor(np.nanmin(pixels, axis=0)) - 2, 0, size - 4).astype(int)
    high = np.clip(np.ceil(np.nanmax(pixels, axis=0)) + 2, low + 4, size).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _step(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """0 below `low`, 1 above `high`, smooth between."""
    t = np.clip((values - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)
