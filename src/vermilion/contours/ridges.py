"""Ridges about borders of the lips that are found in an image from curves near them.

A curve is moved to the border of the lips' colour as one smooth ring near where it began, and a ridge
is drawn about it. What is lip-coloured is learnt in each frame by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.contours.channels import colour_channels
from vermilion.contours.curves import (
    distance_across,
    inside_of,
    of_halves,
    outward_normals,
    sampled,
    smoothed_ring,
)
from vermilion.contours.detector import ContourDetector
from vermilion.contours.gums import creases
from vermilion.contours.holes import hole_edges
from vermilion.contours.lip_heights import held_back
from vermilion.contours.lip_planes import dark_lines, lip_planes
from vermilion.contours.lower_gaps import lower_gaps
from vermilion.contours.paths import cheapest_ring, step_cost
from vermilion.contours.region import MouthRegion

BLUR_PX = 1.0  # of the colours
CONTACT = 0.03  # a mouth open by less may be closed: per inter-ocular distance
#: An opening is a hole: so dark between the lips, per their lightness, is one; above, shade of a contact.
HOLE = (0.2, 0.4)
#: A hole's edge is looked for so far inside and outside the start, per inter-ocular distance.
HOLE_REACH = (0.15, 0.03)
HOLE_PX = 2.0  # deviation of its place
HOLE_STIFFNESS = 1.0  # as `stiffness`: a rounded mouth has another shape than the network's
TEETH = 1.1  # lightness of teeth per the lips'
TEETH_PX = 6  # so near to them the dark line of a lip's shade is its border
LINE_SHARE = 0.7  # what the dark line counts there, against the fall


@dataclass(frozen=True)
class Search:
    """One search for the borders.

    Attributes:
        band: where lips are sure to be, from the outer (0) to the inner (1) border.
        tolerance: squared deviations from the lips' colour at which a colour is 63 % strange.
        outer_reach: of the search for the outer border about the last one found, per the detector's.
        inner_reach: of the search for the inner border. A whole reach starts where the detector
            does, a part at the border found before.
        step_px: between the places along a normal, region pixels.
        beside: whether what lies just beside the outer border tells it, which must nearly be known.
    """

    band: tuple[float, float]
    tolerance: float
    outer_reach: float
    inner_reach: float
    step_px: float
    beside: bool = False


#: First the middle of the lips, as landmarks may miss: those of the outer border by a whole lip, where
#: gums are taken for one. Then all up to the dark of the opening, but
#: strictly, as gums and tongue are nearly lip-coloured. Last leniently, so that the lips' own shade
#: beside the opening does not count as opening, close to the borders that are known by then.
SEARCHES = (
    Search((0.3, 0.7), 18.0, 1.5, 1.0, 0.5),
    Search((0.5, 0.95), 18.0, 1.0, 1.0, 0.5),
    Search((0.5, 0.95), 50.0, 0.3, 0.3, 0.25, beside=True),
)


@dataclass(frozen=True)
class InnerCues:
    """What else tells the inner border: (size, size) planes.

    Attributes:
        lightness: of the image.
        contact: dark lines, as where lips touch.
        flesh: where the image is lips, gums or tongue, 0 or 1.
        lip: 1 inside the outer border.
        teeth: 1 on teeth: light places without the lips' colour.
        unusual: (2, size, size), what an unusual height of the upper and the lower lip costs; None: not known.
    """

    lightness: np.ndarray
    contact: np.ndarray
    flesh: np.ndarray
    lip: np.ndarray
    teeth: np.ndarray
    unusual: np.ndarray | None = None


@dataclass(frozen=True)
class RidgeDetector(ContourDetector):
    """What detectors share that draw ridges about borders.

    Attributes:
        interocular_size_px: inter-ocular distance of the region that is looked at.
        margin: of the region round the mouth, per inter-ocular distance.
        width: deviation of the ridge, per inter-ocular distance.
        reach: a border farther from the curve it is looked for from is not found, per inter-ocular
            distance.
        edge_weight: what the strongest edge is worth against the start; 0: the start alone.
        stiffness: cost of a slope of 1 of the moved ring against the start, squared.
        lips_shade: what the dark line beside teeth counts, as an edge: a real lip ends in its own shade there.
    """

    takes_rings = True

    interocular_size_px: float = 200.0
    margin: float = 0.16
    width: float = 0.008
    reach: float = 0.08
    edge_weight: float = 4.0
    stiffness: float = 6.0
    lips_shade: float = 1.0

    @classmethod
    def of(cls, section, reach: float, **others: float) -> Self:
        """From the section `contours.detector` of the configuration, with its `reach` and `others`."""
        return cls(
            interocular_size_px=section.interocular_size_px,
            margin=section.margin,
            width=section.ridge_width,
            reach=reach,
            edge_weight=section.edge_weight,
            stiffness=section.stiffness,
            **others,
        )

    def fit_border(
        self,
        curve: np.ndarray,
        plane: np.ndarray,
        reach_px: float,
        step_px: float,
        inside: InnerCues | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The curve moved to the strongest fall of a plane near it.

        Args:
            curve: (n, 2) closed, region pixels.
            plane: (size, size), falls outwards across the border.
            reach_px: of the search to either side, region pixels.
            step_px: between the places of the search.
            inside: for the inner border: it also lies where lips touch or gums begin.

        Returns:
            (n, 2) curve, and how clear its border is, (n,) in [0, 1].
        """
        normals, count = outward_normals(curve), max(int(reach_px / step_px), 1)
        places = step_px * np.arange(-count, count + 1)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        fall = np.maximum(-np.gradient(sampled(plane, points), step_px, axis=1), 0.0)
        fall = np.minimum(fall / max(np.percentile(fall.max(axis=1), 75), 1e-6), 1.0)
        cost = np.tile((places / reach_px) ** 2, (len(curve), 1))
        if inside is not None:
            near = self._contact(curve, points, inside)[:, None]
            line = sampled(inside.contact, points)
            line = np.minimum(line / max(np.percentile(line.max(axis=1), 50), 1e-6), 1.0)
            fall += LINE_SHARE * near * (line - fall)
            if self.lips_shade:
                before = self._before_teeth(curve, normals, inside, step_px, count)
                planes = inside.lightness, inside.lip
                gap, dark = lower_gaps(planes, curve, normals, step_px, count)
                fall += self.lips_shade * (1 - near) * line * before * (1 - gap)
                cost += self.lips_shade * (1 - near) * dark
            crease, beyond = self._creases(curve, normals, inside, step_px, count)
            fall += (1.0 - near) * (crease - beyond * fall)
        cost -= self.edge_weight * fall
        if inside is not None and inside.unusual is not None:
            cost += of_halves(inside.unusual, points)
        chosen = cheapest_ring(cost, step_cost(curve, step_px, self.stiffness))
        rows = np.arange(len(curve))
        found = smoothed_ring(curve + places[chosen][:, None] * normals, 2)
        return found, np.minimum(fall[rows, chosen], 1.0)

    def _before_teeth(
        self, curve: np.ndarray, normals: np.ndarray, inside: InnerCues, step_px: float, count: int
    ) -> np.ndarray:
        """Whether teeth lie within `TEETH_PX` inside and none outside of each place at a curve, (n, T) 0 or 1."""
        reach = round(TEETH_PX / step_px)
        places = step_px * np.arange(-count - reach, count + reach + 1)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        seen: np.ndarray = np.cumsum(sampled(inside.teeth, points) > 0.5, axis=1)
        here = seen[:, reach : reach + 2 * count + 1]
        within, beyond = here > seen[:, : 2 * count + 1], seen[:, 2 * reach :] > here
        return np.where(within & ~beyond, 1.0, 0.0)

    def to_holes(self, curve: np.ndarray, inside: InnerCues, step_px: float) -> np.ndarray:
        """The inner border's `curve` (n, 2) moved to the edge of the dark beside the lips, where there is one."""
        size, normals = self.interocular_size_px, outward_normals(curve)
        inwards, outwards = (int(share * size / step_px) for share in HOLE_REACH)
        places = step_px * np.arange(-inwards, outwards + 1)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        lightness, flesh, lip = (
            sampled(plane, points) for plane in (inside.lightness, inside.flesh, inside.lip)
        )
        at, sure = hole_edges(lightness, flesh > 0.5, lip > 0.5, places)
        line = sure[:, None] * np.exp(-0.5 * ((places[None] - places[at][:, None]) / HOLE_PX) ** 2)
        far = (places / (HOLE_REACH[0] * size)) ** 2
        cost = (
            far
            + (1 - sure[:, None]) * (places / (self.reach * size)) ** 2
            - self.edge_weight * line
        )
        if inside.unusual is not None:
            cost += held_back(inside.unusual, points, places)
        across = np.maximum(distance_across(curve), self.reach * size)
        cost[-places[None] > across[:, None]] = 1e3
        chosen = cheapest_ring(cost, step_cost(curve, step_px, HOLE_STIFFNESS))
        return smoothed_ring(curve + places[chosen][:, None] * normals, 2)

    def _contact(self, curve: np.ndarray, points: np.ndarray, inside: InnerCues) -> np.ndarray:
        """How far (n,) lips may touch at a curve (n, 2), whose normals' places are (n, T, 2)."""
        near = np.exp(-((distance_across(curve) / (CONTACT * self.interocular_size_px)) ** 2))
        lightness, lip = sampled(inside.lightness, points), sampled(inside.lip, points) > 0.5
        usual = np.median(lightness[lip]) if lip.any() else 1.0
        darkest = np.where(lip, lightness, np.inf).min(axis=1) / max(usual, 1e-6)
        return near * np.clip((darkest - HOLE[0]) / (HOLE[1] - HOLE[0]), 0.0, 1.0)

    def _creases(
        self, curve: np.ndarray, normals: np.ndarray, inside: InnerCues, step_px: float, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """`creases` at so many steps to either side of a curve.

        They are looked for from one reach inside it to two outside it, as the landmarks may lie on the
        far border of the gums.
        """
        reach = max(int(self.reach * self.interocular_size_px / step_px), count)
        places = step_px * np.arange(-reach, 2 * reach + 1)
        points = curve[:, None] + places[None, :, None] * normals[:, None]
        lightness, flesh, lip = (
            sampled(plane, points) for plane in (inside.lightness, inside.flesh, inside.lip)
        )
        found = creases(lightness, flesh > 0.5, lip > 0.5, step_px)
        crease, beyond = (values[:, reach - count : reach + count + 1] for values in found)
        return crease, beyond

    def ridge(self, curve: np.ndarray, strength: np.ndarray, region: MouthRegion) -> np.ndarray:
        """Likelihood (size, size) about a `curve` (n, 2) px of clearness `strength` (n,) in [0, 1]."""
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

    def arrays(self) -> dict[str, np.ndarray | float]:
        """All that the detector is, by name: numbers, and what was learnt of n samples, (n,) and (n, 3)."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> Self:
        """Of what `arrays` gave, (n,), (n, 3) or (). Raises KeyError where something is missing."""
        values: dict[str, Any] = {field.name: arrays[field.name] for field in fields(cls)}
        return cls(**{k: float(v) if np.ndim(v) == 0 else v for k, v in values.items()})


def blurred_colours(image: np.ndarray) -> np.ndarray:
    """Colour channels (3, h, w) of an image (h, w, 3), a little blurred."""
    colours = colour_channels(image)
    return np.stack([cv2.GaussianBlur(plane, (0, 0), BLUR_PX) for plane in colours])


def inner_cues(
    colours: np.ndarray, outer: np.ndarray, inner: np.ndarray, search: Search
) -> tuple[InnerCues, np.ndarray]:
    """What tells the inner border in `colours` (3, size, size), and the plane (size, size) of what is not lip.

    The borders are thought to be `outer` and `inner` (n, 2) px.
    """
    curves = {"outer": outer, "inner": inner}
    planes = lip_planes(colours, curves, search.band, search.tolerance, outer=False)
    lip = inside_of(outer, colours.shape[1]).astype(np.float32)
    return cues_of(colours, planes["flesh"], lip), planes["inner"]


def cues_of(colours: np.ndarray, flesh: np.ndarray, lip: np.ndarray) -> InnerCues:
    """`InnerCues` of `colours` (3, size, size), with the planes `flesh` and `lip` (size, size)."""
    seen = (lip > 0.5) & (flesh > 0.5)
    usual = np.median(colours[0][seen]) if seen.any() else 1.0
    teeth = ((flesh < 0.5) & (lip > 0.5) & (colours[0] > TEETH * usual)).astype(np.uint8)
    teeth = cv2.morphologyEx(teeth, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)).astype(np.float32)
    return InnerCues(colours[0], dark_lines(colours[0]), flesh, lip, teeth)
