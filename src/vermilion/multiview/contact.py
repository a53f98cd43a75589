"""Upper and lower lip never pass through each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from vermilion.faces.lips import lip_sides_by_distance
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh, adjacency, vertex_normals

#: Deeper than this is no contact of two lips; depth that is let be; rounds of pushing.
_REACH_MM, _SLACK_MM, _ROUNDS = 4.0, 0.02, 8


@dataclass(frozen=True)
class Lips:
    """The two sides that can touch.

    Attributes:
        upper, lower: (n,), (m,) vertex ids of the vermilion and the inside of each lip, without
            the corners of the mouth, where the two are one surface.
    """

    upper: np.ndarray
    lower: np.ndarray


def lips_of(model: FaceModel, corner_mm: float = 4.0) -> Lips:
    """The two lips of a face model, without what lies within `corner_mm` of their corners."""
    sides = lip_sides_by_distance(Mesh(model.neutral_mm, model.triangles), model.regions, corner_mm)
    return Lips(np.flatnonzero(sides > 0), np.flatnonzero(sides < 0))


@dataclass(frozen=True)
class Contact:
    """A mesh without penetration, and what was found.

    Attributes:
        vertices_mm: (V, 3).
        penetrating: how many vertices lay inside the other lip.
        deepest_mm: how deep.
        left_mm: how deep after resolution.
    """

    vertices_mm: np.ndarray
    penetrating: int
    deepest_mm: float
    left_mm: float


def resolve_contact(
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    lips: Lips,
    mobility: np.ndarray,
) -> Contact:
    """Push apart what lies inside the other lip, each side by its share of mobility.

    Args:
        vertices_mm: (V, 3) world, mm.
        triangles: (T, 3).
        lips: of the topology.
        mobility: (V,) in (0, 1]; vertices that cameras see move less.
    """
    current = np.array(vertices_mm, dtype=np.float64)
    first = 0.0
    count = 0
    mix = adjacency(triangles, len(current))
    mix = mix.multiply(1.0 / np.maximum(np.asarray(mix.sum(axis=1)), 1)).tocsr()
    free = np.zeros(len(current), dtype=bool)
    free[lips.upper] = free[lips.lower] = True
    for index in range(_ROUNDS + 1):
        normals = vertex_normals(current, triangles)
        push = np.zeros_like(current)
        deepest, inside = 0.0, 0
        for mine, other in ((lips.upper, lips.lower), (lips.lower, lips.upper)):
            ids, near, depth = _penetration(current, normals, mine, other)
            deep = depth > _SLACK_MM
            ids, near, depth = ids[deep], near[deep], depth[deep]
            inside += len(ids)
            deepest = max(deepest, float(depth.max(initial=0.0)))
            share = mobility[ids] / (mobility[ids] + mobility[near])
            _keep_longer(push, ids, (share * depth)[:, None] * normals[near])
            _keep_longer(push, near, -((1 - share) * depth)[:, None] * normals[near])
        if index == 0:
            first, count = deepest, inside
        if inside == 0 or index == _ROUNDS:
            return Contact(current, count, first, deepest)
        # neighbours on the lips come along by half, so that no single vertex stands out
        along = mix @ push
        moved = np.linalg.norm(push, axis=1) > 0
        push = np.where(moved[:, None], push, np.where(free[:, None], 0.5 * along, 0.0))
        current = current + push
    raise AssertionError("unreachable")


def _penetration(vertices, normals, mine, other):
    """(vertices inside the other lip, their nearest vertices there, depth in mm)."""
    distance, nearest = cKDTree(vertices[other]).query(
        vertices[mine], distance_upper_bound=_REACH_MM
    )
    found = np.isfinite(distance)
    ids, near, distance = mine[found], other[nearest[found]], distance[found]
    offset = vertices[ids] - vertices[near]
    depth = -(offset * normals[near]).sum(axis=1)
    facing = (normals[ids] * normals[near]).sum(axis=1) < -0.2
    beside = np.sqrt(np.maximum(distance**2 - depth**2, 0))
    touches = facing & (depth > 0) & (beside < np.maximum(1.0, depth))
    return ids[touches], near[touches], depth[touches]


def _keep_longer(push, ids, candidate):
    """Write candidate moves where they are longer than those that stand."""
    order = np.argsort(np.linalg.norm(candidate, axis=1), kind="stable")
    ids, candidate = ids[order], candidate[order]
    longer = np.linalg.norm(candidate, axis=1) > np.linalg.norm(push[ids], axis=1)
    push[ids[longer]] = candidate[longer]
