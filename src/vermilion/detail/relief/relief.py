"""Relief of one frame: displacements along the normals, from the detail of the image's shading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from scipy import sparse

from vermilion.detail.relief.high_pass import HighPassFilter
from vermilion.detail.relief.light import ClipLight
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.mesh import triangle_areas, triangle_cross, vertex_areas, vertex_normals
from vermilion.geometry.sparse import CholeskyFactor

_PATCH_MM2 = 4.0  # patches of this area bend independently of one another
_SAMPLE_MM2 = 1.0  # smaller triangles are not independent measurements
_BORDER_WEIGHT = 1e4
_ROBUST_SIGMAS = 2.5


@dataclass(frozen=True)
class ReliefSettings:
    """Priors of the relief and noise of the image.

    Attributes:
        detail_mm: shading that changes over longer ranges is attributed to light, albedo and the
            coarse mesh.
        curvature_sigma: typical mean curvature of the displacement, 1 / mm.
        displacement_sigma_mm: typical displacement.
        standing_share: curvature and displacement of the relief that is always there, as a share; 0: none.
        noise_floor: least deviation of a value (display values, 0 to 255).
        misplaced_mm: typical error of a place on the skin: edges of the albedo are trusted less.
        iterations: Gauss-Newton steps.
    """

    detail_mm: float = 8.0
    curvature_sigma: float = 0.06
    displacement_sigma_mm: float = 0.3
    standing_share: float = 0.25
    noise_floor: float = 1.0
    misplaced_mm: float = 0.5
    iterations: int = 2

    @classmethod
    def of(cls, cfg: Mapping[str, Any]) -> ReliefSettings:
        """From a dictionary with the keys `detail.relief.<field>` of the configuration."""
        return cls(**{item.name: cfg[f"detail.relief.{item.name}"] for item in fields(cls)})


def solve_relief(
    skin_mm: np.ndarray,
    world_to_camera: np.ndarray,
    observed: SkinObservation,
    light: ClipLight,
    topology: FineTopology,
    settings: ReliefSettings,
) -> np.ndarray:
    """Displacements (S,) mm of the skin along its normals.

    Gauss-Newton on three terms: the high-pass part of the triangles' values, with Cauchy weights and
    a deviation for each value; mean curvature and size of what the displacements differ from the relief
    that is always there. Comparing high-pass values makes shading gradients agree (Mono13 8) without
    amplifying noise as differences of neighbours do. The skin's border does not move.

    Args:
        skin_mm: (S, 3) smooth skin, world.
        world_to_camera: (3, 3) rotation.
        observed: image at the skin's triangles.
        light: of the take.
        topology: of the skin.
        settings: priors and noise.
    """
    light = light.reaching(observed)
    normals = vertex_normals(skin_mm, topology.skin)
    trust = observed.trust * (light.seen > 0)
    if not trust.any():
        return light.standing_mm.copy()
    centres = skin_mm[topology.skin].mean(axis=1)
    detail = HighPassFilter(topology.pairs, centres, trust, settings.detail_mm)
    sigma = value_deviation(light, observed, topology, centres, settings)
    stiff = _regulariser(skin_mm, topology, settings)
    areas = triangle_areas(skin_mm, topology.skin)
    worth = trust * np.minimum(areas / _SAMPLE_MM2, 1.0)
    along, scale = light.standing_mm, None
    for _ in range(settings.iterations):
        points = skin_mm + along[:, None] * normals
        cross = triangle_cross(points, topology.skin)
        inner = (cross / _lengths(cross)) @ world_to_camera.T
        error = detail((observed.colours - light.values(inner)).mean(axis=1))
        if scale is None:
            # Relief is sparse: errors that are large everywhere come from a misaligned mesh.
            scale = max(1.0, 1.48 * float(np.median(np.abs(error / sigma)[trust > 0])))
            sigma = sigma * scale
        slope = light.slopes(inner) @ world_to_camera
        jacobian = _jacobian(points, cross, normals, slope, topology.skin)
        weight = worth / (sigma**2 + (error / _ROBUST_SIGMAS) ** 2)
        weighted = jacobian.T @ sparse.diags(weight)
        right = weighted @ error - stiff @ (along - light.standing_mm)
        along = along + CholeskyFactor((weighted @ jacobian + stiff).tocsc()).solve(right)
    return along


def _lengths(cross: np.ndarray) -> np.ndarray:
    """Twice the areas (Q, 1) of triangles with cross products (Q, 3)."""
    return np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-9)


def _jacobian(
    points: np.ndarray, cross: np.ndarray, normals: np.ndarray, slope: np.ndarray, skin: np.ndarray
) -> sparse.csr_matrix:
    """Derivative (Q, S) of the triangles' values by the displacements along the normals.

    `points` and `normals` are (S, 3), `cross` and `slope` (derivative by the normal) are (Q, 3).
    """
    length = _lengths(cross)
    facing = cross / length
    # The hat function of corner k has the gradient facing x (opposite edge) / (2 area).
    corners = points[skin]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    hats = np.cross(facing[:, None], opposite) / length[:, None]
    lift = np.einsum("qk,qck->qc", facing, normals[skin])
    change = -np.einsum("qk,qck->qc", slope, hats) * lift
    rows = np.repeat(np.arange(len(skin)), 3)
    shape = (len(skin), len(points))
    return sparse.csr_matrix((change.ravel(), (rows, skin.ravel())), shape=shape)


def value_deviation(
    light: ClipLight,
    observed: SkinObservation,
    topology: FineTopology,
    centres_mm: np.ndarray,
    settings: ReliefSettings,
) -> np.ndarray:
    """Typical error (Q,) of the triangles' values: image noise, and misplaced edges of the albedo.

    Args:
        light: that reaches the triangles.
        observed: image at the skin's triangles.
        topology: of the skin.
        centres_mm: (Q, 3) of the triangles.
        settings: noise.
    """
    shown = light.values(observed.normals).mean(axis=1)
    i, j = topology.pairs.T
    apart = np.maximum(np.linalg.norm(centres_mm[i] - centres_mm[j], axis=1), 0.2)
    steep = ((shown[i] - shown[j]) / apart) ** 2
    count = np.bincount(topology.pairs.ravel(), minlength=len(shown))
    total = np.bincount(topology.pairs.ravel(), np.repeat(steep, 2), minlength=len(shown))
    noise = np.maximum(light.noise, settings.noise_floor)
    return np.sqrt(noise**2 + settings.misplaced_mm**2 * total / np.maximum(count, 1))


def _regulariser(skin_mm, topology, settings) -> sparse.csc_matrix:
    """(S, S): smoothness and size of the displacements, independent of the size of triangles."""
    n, edges = len(skin_mm), topology.edges
    squared = ((skin_mm[edges[:, 0]] - skin_mm[edges[:, 1]]) ** 2).sum(axis=1)
    graph = sparse.csr_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    graph = graph + graph.T
    degree = np.maximum(np.asarray(graph.sum(axis=1)).ravel(), 1)
    total = np.bincount(edges.ravel(), np.repeat(squared, 2), minlength=n)
    mean_squared = np.maximum(total / degree, 1e-6)
    # Of a function of constant curvature the mean over a ring differs by curvature x length^2 / 4.
    bend = sparse.diags(4 / mean_squared) @ (sparse.diags(1 / degree) @ graph - sparse.identity(n))
    patches = vertex_areas(skin_mm, topology.skin) / _PATCH_MM2
    bending = bend.T @ sparse.diags(patches / settings.curvature_sigma**2) @ bend
    stay = (
        np.where(topology.border, _BORDER_WEIGHT, patches + 1e-6)
        / settings.displacement_sigma_mm**2
    )
    return (bending + sparse.diags(stay)).tocsc()
