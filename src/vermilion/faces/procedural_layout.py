"""Where the vertices of a generated head lie: rings round the mouth and the eyes, at any spacing.

The skin is a Delaunay triangulation of chart points; lips, inner fold, socket and lids are strips
of rings. Two layouts of different spacing share no vertex and no triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from vermilion.faces.procedural_anchors import snap
from vermilion.faces.procedural_head import EYE_CENTRE_MM, chart_at, chart_scale_mm
from vermilion.faces.procedural_mouth import LIP_LOOP, border_chart


@dataclass(frozen=True)
class Layout:
    """How finely a head is meshed.

    Attributes:
        spacing_mm: distance of vertices on the vermilion border.
        coarsening: factor on the spacing away from the lips.
        vermilion_rings, fold_rings, socket_rings: rings of each strip (socket 0: no socket).
        offset: turn of every ring, as a share of the vertex spacing.
        fold_end: depth s at which the inner fold ends, in (1, 2].
    """

    spacing_mm: float
    coarsening: float = 1.0
    vermilion_rings: int = 14
    fold_rings: int = 8
    socket_rings: int = 0
    offset: float = 0.0
    fold_end: float = 2.0

    @property
    def n_strips(self) -> int:
        """Rings of quads next to the border, before the free triangulation begins."""
        return int(np.clip(round(4.0 / self.spacing_mm), 1, 4))

    @property
    def n_border(self) -> int:
        """Vertices round the mouth: a multiple of 4, for the corners and the middle of each lip."""
        return 4 * round(LIP_LOOP.length_mm / self.spacing_mm / 4)

    def border_theta(self) -> np.ndarray:
        """Loop parameters of the border's vertices, (n_border,)."""
        return np.arange(self.n_border) * (2 * np.pi / self.n_border)

    def spacing_at(self, distance_mm: float) -> float:
        """Wanted spacing (mm) at a distance from the border: fine on the face, coarse behind."""
        distances = [0.0, 4.0, 10.0, 25.0, 60.0, 105.0, 180.0, 400.0]
        factors = [1.0, 1.15, 1.7, 2.3, 3.0, 4.8, 13.0, 30.0]
        factor = float(np.interp(distance_mm, distances, factors))
        return self.spacing_mm * (1.0 + (factor - 1.0) * self.coarsening)


def ring_chart(theta: np.ndarray, border: np.ndarray, radius: float) -> np.ndarray:
    """Chart ring (N,) complex round the mouth: the border at radius 0, the chart's rim at radius 1.

    `theta` (N,) loop parameters; `border` (N,) complex chart points of the border there.
    """
    reach = 0.10
    fade = (1.0 - np.exp(-radius / reach)) / (1.0 - np.exp(-1.0 / reach))
    # Near the pointed corners of the mouth the way out is across the border, not along it.
    squeeze = 1.0 - 0.88 * np.exp(-radius / 0.045)
    outward = squeeze * np.cos(theta) + 1j * np.sin(theta)
    return border * (1.0 - fade) + radius * outward / np.abs(outward)


@cache
def _border_places(count: int, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Loop parameters (count,) and chart points (count,) complex of as many places on the border.

    Layouts have many such rings in common, and each place is found by iteration.
    """
    theta = (np.arange(count) + turn) * (2 * np.pi / count)
    border = border_chart(theta)
    theta.flags.writeable = border.flags.writeable = False
    return theta, border


@cache
def _dense_border() -> tuple[np.ndarray, np.ndarray]:
    """As `_border_places`, closed: the last of 1441 places is the first."""
    dense = np.linspace(0, 2 * np.pi, 1441)
    border = border_chart(dense[:-1])
    return dense, np.append(border, border[0])


def skin_rings(layout: Layout) -> list[np.ndarray]:
    """Chart rings of the skin from the border outwards, each (n,) complex.

    The first `n_strips` + 1 have the same number of points, aligned by theta.
    """
    scale = chart_scale_mm()
    dense, dense_border = _dense_border()
    rings = [border_chart(layout.border_theta())]
    distance = radius = 0.0
    while radius < 1.0:
        distance += 0.87 * layout.spacing_at(distance)
        spacing = layout.spacing_at(distance)
        radius = distance / scale
        if 1.0 - radius < 0.5 * spacing / scale:
            radius = 1.0
        count, turn = layout.n_border, 0.0
        if len(rings) > layout.n_strips:
            perimeter = np.abs(np.diff(ring_chart(dense, dense_border, radius))).sum() * scale
            count = 2 * max(8, round(perimeter / spacing / 2))
            turn = 0.5 * (len(rings) % 2) + layout.offset
        if len(rings) == layout.n_strips + 1:
            count, turn = layout.n_border, 0.5
        rings.append(ring_chart(*_border_places(count, turn), radius))
    return rings


def lid_margin_xy(phase: np.ndarray) -> np.ndarray:
    """The opening of the subject's left eye, frontal (N, 2) mm.

    `phase` (N,) in radians, 0 at the outer corner.
    """
    t = np.cos(phase)
    centre_x, half = EYE_CENTRE_MM[0] + 0.3, 13.6
    lift = 1.0 - np.abs(t) ** 2.2
    upper = 5.6 * lift * (1 - 0.12 * t) + 0.9 * t
    lower = -4.6 * lift * (1 + 0.16 * t) + 0.9 * t
    y = np.where(np.sin(phase) >= 0, upper, lower)
    return np.stack([centre_x + half * t, EYE_CENTRE_MM[1] + y], axis=-1)


def eye_rings(layout: Layout) -> tuple[np.ndarray, list[np.ndarray]]:
    """Phase (n,) of the lid margin's vertices, and chart rings (n,) complex round the left eye."""
    spacing = 1.35 * layout.spacing_mm * (1.0 + 0.35 * (layout.coarsening - 1.0))
    count = 2 * round(68.0 / spacing / 2)
    phase = np.arange(count) * (2 * np.pi / count)
    centre = EYE_CENTRE_MM[:2] + np.array([0.3, 0.6])
    rings, distance = [chart_at(lid_margin_xy(phase))], 0.0
    while distance < 15.5:
        distance += 0.9 * spacing * (1.0 + 0.07 * distance)
        circle = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
        share = 1.0 - np.exp(-distance / 22.0)
        xy = lid_margin_xy(phase) * (1 - share) + centre * share + distance * circle
        rings.append(chart_at(xy))
    return phase, rings


@dataclass(frozen=True)
class SkinSheet:
    """The triangulated skin of a layout in the chart.

    Attributes:
        chart: (N,) complex; the mouth's border first, in the order of `Layout.border_theta`.
        triangles: (T, 3) int32, counter-clockwise seen from outside.
        eyes: ids of the two lid margins, subject's left and right, by phase (mirrored on the right).
        phase: (n,) of the margins' vertices.
        anchors: landmark number -> vertex, for the landmarks off the eyes and lips.
    """

    chart: np.ndarray
    triangles: np.ndarray
    eyes: tuple[np.ndarray, np.ndarray]
    phase: np.ndarray
    anchors: dict[int, int]


def skin_sheet(layout: Layout) -> SkinSheet:
    """Points and triangles of the skin, holes at mouth and eyes."""
    rings = skin_rings(layout)
    n = layout.n_border
    strips, outer = (
        np.concatenate(rings[: layout.n_strips + 1]),
        np.concatenate(rings[layout.n_strips + 1 :]),
    )
    phase, left = eye_rings(layout)
    right = [-np.conj(ring) for ring in left]
    outer = outer[~_near_eyes(outer, left)]
    charts, eyes, at = [strips], [], len(strips)
    for eye in (left, right):
        eyes.append(np.arange(at, at + len(eye[0])))
        charts.extend(eye)
        at += sum(len(ring) for ring in eye)
    chart = np.concatenate([*charts, outer])
    chart, anchors = snap(chart, *_loose_points(chart, len(strips), n, at, eyes, left))
    aligned = np.arange(len(strips)).reshape(-1, n)
    around = _triangulate(chart, layout.n_strips * n, [aligned[-1], *eyes])
    triangles = np.concatenate([strip_triangles(list(aligned[::-1])), around])
    return SkinSheet(chart, triangles.astype(np.int32), (eyes[0], eyes[1]), phase, anchors)


def _loose_points(
    chart: np.ndarray, n_strip: int, n_ring: int, n_inner: int, eyes: list, left: list
) -> tuple[np.ndarray, np.ndarray]:
    """Which points may become anchors, and which may give way: none that edges holes."""
    free = np.ones(len(chart), dtype=bool)
    free[:n_strip] = False
    free[np.concatenate(eyes)] = False
    free[n_inner : n_inner + n_ring] = False  # the ring that meets the strips
    yielding = free.copy()
    per_eye = sum(len(ring) for ring in left)
    kept = 4 * len(left[0])  # the four rings next to a lid
    for k in range(2):
        yielding[n_strip + k * per_eye : n_strip + k * per_eye + kept] = False
    last_strip = chart[n_strip - n_ring : n_strip]
    spacing = np.abs(np.diff(last_strip)).max()
    gap, _ = cKDTree(_plane(last_strip)).query(_plane(chart))
    return free, yielding & (gap > 3.0 * spacing)


def _plane(chart: np.ndarray) -> np.ndarray:
    return np.stack([chart.real, chart.imag], axis=-1)


def _near_eyes(chart: np.ndarray, left: list[np.ndarray]) -> np.ndarray:
    """Which chart points lie within the eye rings, or so close to the last that they crowd it."""
    last = left[-1]
    margin = 0.6 * np.abs(np.diff(last)).mean()
    centre = last.mean()
    angle = np.angle(last - centre)
    order = np.argsort(angle)
    mirrored = np.where(chart.real < 0, -np.conj(chart), chart) - centre
    reach = np.interp(
        np.angle(mirrored), angle[order], np.abs(last - centre)[order], period=2 * np.pi
    )
    return np.abs(mirrored) < reach + margin


def _triangulate(chart: np.ndarray, first: int, holes: list[np.ndarray]) -> np.ndarray:
    """Delaunay triangles of the chart points from id `first` on, without those inside the holes."""
    points = _plane(chart)
    triangles = Delaunay(points[first:]).simplices + first
    for loop in holes:
        triangles = triangles[~_within(points, triangles, loop)]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    flat = np.abs(area) < 1e-12  # slivers between neighbours of the circular rim
    triangles = np.where((area < 0)[:, None], triangles[:, [0, 2, 1]], triangles)[~flat]
    return triangles.astype(np.int32)


def _within(points: np.ndarray, triangles: np.ndarray, loop: np.ndarray) -> np.ndarray:
    """Which triangles lie inside the polygon of vertex ids `loop`, all corners on it."""
    on_loop = np.isin(triangles, loop).all(axis=1)
    centre = points[triangles[on_loop]].mean(axis=1)
    start, end = points[loop], points[np.roll(loop, -1)]
    above = (start[None, :, 1] > centre[:, None, 1]) != (end[None, :, 1] > centre[:, None, 1])
    rise = end[:, 1] - start[:, 1]
    share = (centre[:, None, 1] - start[None, :, 1]) / np.where(rise == 0, 1.0, rise)[None]
    crossing = start[None, :, 0] + share * (end - start)[None, :, 0]
    result = np.zeros(len(triangles), dtype=bool)
    result[on_loop] = (above & (centre[:, None, 0] < crossing)).sum(axis=1) % 2 == 1
    return result


def strip_triangles(rings: list[np.ndarray]) -> np.ndarray:
    """Quads between closed rings of equal length, split into triangles (T, 3).

    `rings` are vertex ids, (n,) each. They run counter-clockwise seen from outside, and each lies
    within the one before; triangles face outwards when rings go into a hole.
    """
    parts = []
    for k, (outer, inner) in enumerate(pairwise(rings)):
        o1, i1 = np.roll(outer, -1), np.roll(inner, -1)
        if k % 2:
            parts += [np.stack([outer, o1, i1], -1), np.stack([outer, i1, inner], -1)]
        else:
            parts += [np.stack([outer, o1, inner], -1), np.stack([o1, i1, inner], -1)]
    return np.concatenate(parts).astype(np.int32)


def fan_triangles(ring: np.ndarray, centre: int) -> np.ndarray:
    """Triangles (n, 3) from a ring of ids `ring` (n,) to a centre, as `strip_triangles`."""
    return np.stack([ring, np.roll(ring, -1), np.full(len(ring), centre)], -1).astype(np.int32)
