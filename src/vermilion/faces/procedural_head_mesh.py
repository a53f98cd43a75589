"""Skin, lips, fold and socket of a generated head as one mesh, with each vertex's mouth coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from vermilion.faces.procedural_head import chart_angles, chart_scale_mm, skin_point
from vermilion.faces.procedural_layout import (
    Layout,
    fan_triangles,
    skin_sheet,
    strip_triangles,
)
from vermilion.faces.procedural_mouth import (
    border_chart,
    lip_point,
    lip_surface,
    socket_point,
)

N_LOOP = 160  # samples of the lips' loop that carry expression curves
CARRY_REACH_MM = 60.0  # skin farther from the lips never follows them
_LID_RINGS = ((0.8, 0.0), (2.4, 0.07), (5.0, 0.26))  # depth (mm), share of the way to the middle


@dataclass(frozen=True)
class HeadMesh:
    """A meshed head and where each vertex lies with respect to the mouth.

    Attributes:
        point_mm: (V, 3).
        triangles: (T, 3) int32.
        chart: (V,) complex; of the border for vertices inside the mouth.
        theta: (V,) loop parameter, NaN on skin.
        s: (V,) depth: 0 on skin and border, in (0, 1] on the vermilion, above 1 inside.
        spread: (V, N_LOOP) rows that carry a curve along the lips to the vertex; each sums to 1 within
            `CARRY_REACH_MM` of the lips, and to 0 beyond.
        distance_mm: (V,) to the vermilion border; 0 inside the mouth.
        border: (n,) ids of the vermilion border by theta.
        meeting: (n,) ids of the line where the lips meet.
        eyes: ids of the lid margins, subject's left and right, by phase.
        anchors: landmark number -> vertex, for the landmarks off the eyes and lips.
        uv: (V, 2).
    """

    point_mm: np.ndarray
    triangles: np.ndarray
    chart: np.ndarray
    theta: np.ndarray
    s: np.ndarray
    spread: np.ndarray
    distance_mm: np.ndarray
    border: np.ndarray
    meeting: np.ndarray
    eyes: tuple[np.ndarray, np.ndarray]
    anchors: dict[int, int]
    uv: np.ndarray

    @property
    def polar(self) -> np.ndarray:
        """(V,) polar angle from the top of the head (radians)."""
        return chart_angles(self.chart)[0]


def loop_theta() -> np.ndarray:
    """(N_LOOP,) samples of theta that carry expression curves."""
    return np.arange(N_LOOP) * (2 * np.pi / N_LOOP)


def build_head_mesh(layout: Layout) -> HeadMesh:
    """Sample the continuous head with a layout."""
    sheet = skin_sheet(layout)
    theta_ring = layout.border_theta()
    n = len(theta_ring)
    points, triangles = [skin_point(sheet.chart)], [sheet.triangles]
    charts = [sheet.chart]
    thetas, depths = [np.full(len(sheet.chart), np.nan)], [np.zeros(len(sheet.chart))]
    thetas[0][:n] = theta_ring
    total = len(sheet.chart)

    rings = [np.arange(n)]
    steps = _mouth_depths(layout)
    for s, ring in zip(steps, _mouth_rings(theta_ring, steps, layout.fold_end), strict=True):
        depth = np.full(n, s)
        points.append(ring)
        charts.append(sheet.chart[:n])
        thetas.append(theta_ring)
        depths.append(depth)
        rings.append(np.arange(total, total + n))
        total += n
    triangles.append(strip_triangles(rings))
    if layout.socket_rings:
        centre = points[-1].mean(axis=0)
        points.append(centre[None])
        charts.append(np.zeros(1, dtype=complex))
        thetas.append(np.zeros(1))
        depths.append(np.full(1, 3.0))
        triangles.append(fan_triangles(rings[-1], total))
        total += 1

    for ids, sign in zip(sheet.eyes, (1.0, -1.0), strict=True):
        lid_points = _lid_rings(points[0][ids])
        lids = [ids]
        for k, ring in enumerate(lid_points):
            points.append(ring)
            margin = sheet.chart[ids]
            charts.append(margin + 0.12 * (k + 1) * (margin.mean() - margin))
            thetas.append(np.full(len(ids), np.nan))
            depths.append(np.zeros(len(ids)))
            lids.append(np.arange(total, total + len(ids)))
            total += len(ids)
        strip = strip_triangles(lids)
        triangles.append(strip if sign > 0 else strip[:, [0, 2, 1]])

    point = np.concatenate(points)
    chart, theta, depth = (np.concatenate(parts) for parts in (charts, thetas, depths))
    spread, distance = _spread(point, theta)
    meeting = rings[1 + steps.index(1.0)]
    return HeadMesh(
        point, np.concatenate(triangles), chart, theta, depth, spread, distance,
        rings[0], meeting, sheet.eyes, sheet.anchors, _uv(chart, theta, depth, spread, distance),
    )  # fmt: skip


def _mouth_depths(layout: Layout) -> list[float]:
    vermilion = np.linspace(0, 1, layout.vermilion_rings + 1)[1:]
    fold = np.linspace(1, layout.fold_end, layout.fold_rings + 1)[1:]
    depths = [*vermilion, *fold]
    if layout.socket_rings:
        # The last ring has no radius: its place is taken by the centre of a fan.
        depths += list(2.0 + np.linspace(0, 1, layout.socket_rings + 2)[1:-1])
    return [float(round(d, 9)) for d in depths]


def _mouth_rings(theta: np.ndarray, steps: list[float], fold_end: float) -> list[np.ndarray]:
    """The ring (n, 3) mm of each depth: lips and fold up to `fold_end`, then the socket."""
    lips = [s for s in steps if s <= fold_end]
    depths = np.array([*lips, 2.0])[:, None] + np.zeros(len(theta))
    *rings, end = lip_surface(theta, depths)
    sockets = [socket_point(theta, np.full(len(theta), s), end) for s in steps[len(lips) :]]
    return [*rings, *sockets]


def _lid_rings(margin: np.ndarray) -> list[np.ndarray]:
    """Rings from the lid margin (n, 3) backwards, closing on the eyeball."""
    centre = margin.mean(axis=0)
    rings = []
    for depth, share in _LID_RINGS:
        ring = margin + (centre - margin) * np.array([share, share, 0.0])
        ring[:, 2] -= depth
        rings.append(ring)
    return rings


def _spread(point: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the loop's samples at each vertex (V, N_LOOP), and distance to the border (V,)."""
    samples = loop_theta()
    border = lip_point(samples, np.zeros(N_LOOP))
    fine_theta = np.arange(8 * N_LOOP) * (2 * np.pi / (8 * N_LOOP))
    distance, nearest = cKDTree(lip_point(fine_theta, np.zeros(len(fine_theta)))).query(point)
    inside = ~np.isnan(theta)
    own = _interpolation_rows(np.where(inside, theta, fine_theta[nearest]))
    distance = np.where(inside, 0.0, distance)
    # Where two lips are near, a skin point listens to both; nothing is carried beyond the reach.
    near = distance < CARRY_REACH_MM
    squared = ((point[near, None, :] - border[None]) ** 2).sum(axis=-1)
    weights = np.zeros((len(point), N_LOOP))
    weights[near] = 1.0 / (squared + 4.0) ** 2
    weights[near] /= weights[near].sum(axis=1, keepdims=True)
    share = np.where(inside, 1.0, np.clip(1.0 - distance / 6.0, 0, 1) ** 2)[:, None]
    return own * share + weights * (1.0 - share), distance


def _interpolation_rows(theta: np.ndarray) -> np.ndarray:
    at = np.mod(theta, 2 * np.pi) / (2 * np.pi) * N_LOOP
    low = np.floor(at).astype(int) % N_LOOP
    share = at - np.floor(at)
    rows = np.zeros((len(theta), N_LOOP))
    index = np.arange(len(theta))
    rows[index, low] = 1.0 - share
    rows[index, (low + 1) % N_LOOP] += share
    return rows


def _uv(
    chart: np.ndarray, theta: np.ndarray, s: np.ndarray, spread: np.ndarray, distance: np.ndarray
) -> np.ndarray:
    """The chart as texture coordinates: the face widened, the mouth opened up to hold the lips."""
    border = border_chart(loop_theta())
    opened = border.real + 2.0j * border.imag
    scale = chart_scale_mm()
    fade = np.clip(1.0 - (distance / 55.0) ** 2, 0, 1) ** 2
    plane = chart + fade * (spread @ (opened - border))
    inside = ~np.isnan(theta)
    shrink = PchipInterpolator([0, 1, 2, 3], [1.0, 0.45, 0.18, 0.0])(np.clip(s, 0, 3))
    plane = np.where(inside, (spread @ opened) * shrink, plane)
    radius = np.abs(plane)
    widened = PchipInterpolator([0, 115.0 / scale, 1.05], [0.0, 0.80, 1.0])(radius)
    unit = plane / np.maximum(radius, 1e-12)
    disc = 0.48 * widened * unit
    return np.stack([0.5 + disc.real, 0.5 + disc.imag], axis=-1)
