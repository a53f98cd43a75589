"""Likelihood maps where nobody labelled contours: from the landmarks' lip loops and the picture.

The spline through each loop is moved to the border of the lips' colour, as one smooth ring near
the landmarks, and a ridge is drawn about it. What is lip-coloured is learnt in each frame by
itself, from the band between the loops; then again between the borders that were found, where shade
and gloss are the lips' own and not those of a landmark that missed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from vermilion.contours.channels import image_channels
from vermilion.contours.detector import ContourDetector
from vermilion.contours.gums import creases, flesh_plane
from vermilion.contours.paths import cheapest_ring
from vermilion.contours.region import SIDE, MouthRegion

BLUR_PX = 1.0  # of the colours
LINE_PX = (0.7, 1.2)  # of the dark line where lips touch: as fine as the shade above it allows
CONTACT = 0.03  # a mouth open by less may be closed: per inter-ocular distance
LEAST_SPREAD = 0.01  # of the lips' colour: evenly coloured lips are not surrounded by strangers
LINE_SHARE = 0.7  # what the dark line counts there, against the fall


@dataclass(frozen=True)
class Pass:
    """One search for the borders.

    Attributes:
        band: where lips are sure to be, from the outer (0) to the inner (1) border.
        tolerance: squared deviations from the lips' colour at which a colour is 63 % strange.
        outer_reach: of the search for the outer border about the last one found, per the detector's.
        inner_reach: of the search for the inner border. A whole reach starts at the landmarks, a
            part at the border found before.
        step_px: between the places along a normal, region pixels.
    """

    band: tuple[float, float]
    tolerance: float
    outer_reach: float
    inner_reach: float
    step_px: float


#: First the middle of the lips, as landmarks may miss: those of the outer border by a whole lip, where
#: gums are taken for one. Then all up to the dark of the opening, but
#: strictly, as gums and tongue are nearly lip-coloured. Last leniently, so that the lips' own shade
#: beside the opening does not count as opening, close to the borders that are known by then.
PASSES = (
    Pass((0.3, 0.7), 18.0, 1.5, 1.0, 0.5),
    Pass((0.5, 0.95), 18.0, 1.0, 1.0, 0.5),
    Pass((0.5, 0.95), 50.0, 0.3, 0.3, 0.25),
)


@dataclass(frozen=True)
class Inside:
    """What else tells the inner border: (size, size) planes.

    Attributes:
        lightness: of the picture.
        contact: dark lines, as where lips touch.
        flesh: where the picture is lips, gums or tongue, 0 or 1.
        lip: 1 inside the outer border.
    """

    lightness: np.ndarray
    contact: np.ndarray
    flesh: np.ndarray
    lip: np.ndarray


@dataclass(frozen=True)
class LandmarkRidgeDetector(ContourDetector):
    """Ridges about the lips' borders near the landmarks.

    Attributes:
        interocular_size_px: inter-ocular distance of the region that is looked at.
        margin: of the region round the mouth, per inter-ocular distance.
        width: deviation of the ridge, per inter-ocular distance.
        reach: a border farther from the landmarks is not looked for, per inter-ocular distance.
        edge_weight: what the strongest edge is worth against the landmarks; 0: landmarks alone.
        stiffness: cost of a slope of 1 of the moved ring against the spline, squared.
    """

    interocular_size_px: float = 200.0
    margin: float = 0.16
    width: float = 0.008
    reach: float = 0.08
    edge_weight: float = 4.0
    stiffness: float = 6.0

    def region_likelihood(self, picture: np.ndarray, region: MouthRegion) -> dict[str, np.ndarray]:
        """Name of the contour -> (size, size) likelihood of a cropped region."""
        colours = image_channels(picture)[:3]
        colours = np.stack([cv2.GaussianBlur(plane, (0, 0), BLUR_PX) for plane in colours])
        landmarks = {"inner": loop_spline(region.inner_px), "outer": loop_spline(region.outer_px)}
        reach = self.reach * self.interocular_size_px
        contact = dark_lines(colours[0])
        curves, strengths = dict(landmarks), {}
        for once in PASSES:
            planes = lip_planes(colours, curves, once)
            curves["outer"], strengths["outer"] = self._moved(
                curves["outer"], planes["outer"], once.outer_reach * reach, once.step_px
            )
            lip = _filled(curves["outer"], region.size_px).astype(np.float32)
            curves["inner"], strengths["inner"] = self._moved(
                curves["inner"] if once.inner_reach < 1 else landmarks["inner"],
                planes["inner"],
                once.inner_reach * reach,
                once.step_px,
                Inside(colours[0], contact, planes["flesh"], lip),
            )
        return {name: self._ridge(curves[name], strengths[name], region) for name in curves}

    def _moved(
        self,
        curve: np.ndarray,
        plane: np.ndarray,
        reach_px: float,
        step_px: float,
        inside: Inside | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The curve on the strongest fall of `plane` near it, and the fall (n,) in [0, 1].

        The inner one (with `inside`) also where lips touch or gums begin.
        """
        normals, count = _outward_normals(curve), int(reach_px / step_px)
        places = step_px * np.arange(-count, count + 1)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        fall = np.maximum(-np.gradient(_sampled(plane, points), step_px, axis=1), 0.0)
        fall = np.minimum(fall / max(np.percentile(fall.max(axis=1), 75), 1e-6), 1.0)
        if inside is not None:
            near = np.exp(-((_gap(curve) / (CONTACT * self.interocular_size_px)) ** 2))[:, None]
            line = _sampled(inside.contact, points)
            line = np.minimum(line / max(np.percentile(line.max(axis=1), 50), 1e-6), 1.0)
            fall += LINE_SHARE * near * (line - fall)
            crease, beyond = self._creases(curve, normals, inside, step_px, count)
            fall += (1.0 - near) * (crease - beyond * fall)
        cost = (places / reach_px) ** 2 - self.edge_weight * fall
        apart = np.linalg.norm(np.roll(curve, -1, axis=0) - curve, axis=1)
        chosen = cheapest_ring(cost, self.stiffness * (step_px / np.maximum(apart, step_px)) ** 2)
        rows = np.arange(len(curve))
        moved = curve + places[chosen][:, None] * normals
        for _ in range(2):
            moved = 0.25 * np.roll(moved, 1, axis=0) + 0.5 * moved + 0.25 * np.roll(moved, -1, 0)
        return moved, np.minimum(fall[rows, chosen], 1.0)

    def _creases(
        self, curve: np.ndarray, normals: np.ndarray, inside: Inside, step_px: float, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """`creases` at so many steps to either side of a curve.

        They are looked for from one reach inside it to two outside it, as the landmarks may lie on the
        far border of the gums.
        """
        reach = int(self.reach * self.interocular_size_px / step_px)
        places = step_px * np.arange(-reach, 2 * reach + 1)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        lightness, flesh, lip = (
            _sampled(plane, points) for plane in (inside.lightness, inside.flesh, inside.lip)
        )
        found = creases(lightness, flesh > 0.5, lip > 0.5, step_px)
        crease, beyond = (values[:, reach - count : reach + count + 1] for values in found)
        return crease, beyond

    def _ridge(self, curve: np.ndarray, strength: np.ndarray, region: MouthRegion) -> np.ndarray:
        dense = np.concatenate([curve + t * (np.roll(curve, -1, 0) - curve) for t in (0.0, 0.5)])
        strength = np.concatenate([strength, strength])
        rows, columns = np.nonzero(region.mask)
        distance, nearest = cKDTree(dense).query(np.stack([columns, rows], axis=1) + 0.5)
        width = self.width * self.interocular_size_px
        values = np.zeros(region.mask.shape, dtype=np.float32)
        values[rows, columns] = (0.4 + 0.6 * strength[nearest]) * np.exp(
            -0.5 * (distance / width) ** 2
        )
        return values

    def save(self, path: str | Path) -> None:
        """Write `.npz` of plain arrays, whole or not at all."""
        from vermilion.contours.detector import FORMAT_VERSION, save_arrays

        names = ("interocular_size_px", "margin", "width", "reach", "edge_weight", "stiffness")
        arrays = {name: getattr(self, name) for name in names}
        save_arrays(path, {"format_version": FORMAT_VERSION, "kind": "landmarks", **arrays})

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> LandmarkRidgeDetector:
        names = ("interocular_size_px", "margin", "width", "reach", "edge_weight", "stiffness")
        return cls(**{name: float(arrays[name]) for name in names})


def lip_planes(
    colours: np.ndarray, curves: dict[str, np.ndarray], once: Pass
) -> dict[str, np.ndarray]:
    """(size, size) float32 planes in [0, 1]: two fall outwards across each contour, one is `flesh`.

    `outer`: probability of lip against skin, of two normal distributions with one covariance
    (linear discriminant) in the colour channels (3, size, size). `inner`: how far the colour is from
    the lips', which is high in the mouth's opening, on teeth and on the dark line of a closed mouth.
    What is lip, the `curves` (n, 2) of both contours and the band of the pass say.
    """
    size = colours.shape[1]
    inside, to_outer = _drawn(curves["outer"], size)
    opening, to_inner = _drawn(curves["inner"], size)
    ratio = to_outer / np.maximum(to_outer + to_inner, 1e-9)
    lip = inside & ~opening & (ratio > once.band[0]) & (ratio < once.band[1])
    scale = size / SIDE
    skin = ~inside & (to_outer > 0.05 * scale) & (to_outer < 0.12 * scale)
    if lip.sum() < 20 or skin.sum() < 20:
        return {name: np.zeros_like(colours[0]) for name in ("inner", "outer", "flesh")}
    lips, skins = colours[:, lip].T.astype(np.float64), colours[:, skin].T.astype(np.float64)
    own = _covariance(lips)
    shared = 0.5 * (own + _covariance(skins))
    spread = own + LEAST_SPREAD**2 * np.eye(3)
    direction = np.linalg.solve(shared, lips.mean(axis=0) - skins.mean(axis=0))
    middle = 0.5 * (lips.mean(axis=0) + skins.mean(axis=0))
    log_odds = np.tensordot(direction, colours - middle[:, None, None], axes=1)
    away = colours.reshape(3, -1).T - lips.mean(axis=0)
    squared = np.einsum("nk,kl,nl->n", away, np.linalg.inv(spread), away).reshape(size, size)
    return {
        "outer": (1.0 / (1.0 + np.exp(-np.clip(log_odds, -30, 30)))).astype(np.float32),
        "inner": (1.0 - np.exp(-squared / once.tolerance)).astype(np.float32),
        "flesh": flesh_plane(colours, lip),
    }


def loop_spline(loop_px: np.ndarray, n_points: int = 240) -> np.ndarray:
    """Closed curve through a loop of landmarks (n, 2), (n_points, 2); sharp at the mouth corners.

    The first point and the one farthest from it (the other corner, as the 66-point scheme has
    them) are where the upper and the lower half meet.
    """
    half = int(np.argmax(np.linalg.norm(loop_px - loop_px[0], axis=1)))
    halves = []
    for part in (loop_px[: half + 1], np.concatenate([loop_px[half:], loop_px[:1]])):
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(part, axis=0), axis=1))])
        along += np.arange(len(along)) * 1e-6  # landmarks may coincide
        places = np.linspace(0, along[-1], n_points // 2, endpoint=False)
        halves.append(CubicSpline(along, part)(places))
    return np.concatenate(halves)


def dark_lines(lightness: np.ndarray) -> np.ndarray:
    """How much darker a place (size, size) is than what lies beside it; zero where it is not."""
    blurred = ((scale, cv2.GaussianBlur(lightness, (0, 0), scale)) for scale in LINE_PX)
    found = [scale**2 * cv2.Laplacian(plane, cv2.CV_32F) for scale, plane in blurred]
    return np.maximum(np.maximum(*found), 0.0)


def _gap(curve: np.ndarray) -> np.ndarray:
    """Distance (n,) of each point of a closed curve to the half that it does not belong to."""
    half = len(curve) // 2
    parts = curve[: half + 1], np.concatenate([curve[half:], curve[:1]])
    away = [cKDTree(other).query(part)[0] for part, other in (parts, parts[::-1])]
    return np.concatenate([part[:-1] for part in away])


def _sampled(plane: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Bilinear values (n, m) of a plane (h, w) at points (n, m, 2)."""
    x, y = (np.ascontiguousarray(points[..., k] - 0.5, dtype=np.float32) for k in range(2))
    found = cv2.remap(plane, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found.astype(np.float64)


def _outward_normals(curve: np.ndarray) -> np.ndarray:
    tangent = np.roll(curve, -4, axis=0) - np.roll(curve, 4, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    following = np.roll(curve, -1, axis=0)
    area = np.sum(curve[:, 0] * following[:, 1] - curve[:, 1] * following[:, 0])
    return normal if area > 0 else -normal


def _drawn(curve: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Inside of a closed curve (size, size) bool, and the distance to it to a pixel."""
    away = np.ones((size, size), dtype=np.uint8)
    cv2.polylines(away, [np.rint(curve - 0.5).astype(np.int32)], True, 0)
    distance = cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return _filled(curve, size), distance


def _filled(curve: np.ndarray, size: int) -> np.ndarray:
    """Inside of a closed curve (size, size) bool."""
    inside = np.zeros((size, size), dtype=np.uint8)
    cv2.fillPoly(inside, [np.rint(curve - 0.5).astype(np.int32)], 1)
    return inside > 0


def _covariance(samples: np.ndarray) -> np.ndarray:
    return np.cov(samples.T) + 1e-5 * np.eye(samples.shape[1])
