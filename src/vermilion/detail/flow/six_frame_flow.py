"""Temporally coherent corrective flow of one frame, from six images (Mono13 7.1, eq. 9)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from vermilion.detail.flow import kernels
from vermilion.detail.flow.channels import channels, structure_direction

_LEAST_SIDE_PX = 24


@dataclass(frozen=True)
class FlowSettings:
    """Weights of Mono13 eq. 9 for display values 0 to 255, and how the energy is minimised.

    Attributes:
        smoothness: alpha_1 to alpha_5.
        similarity: gamma, of w_3 and of w_5.
        gradient_weight: weight of gradient constancy against colour constancy.
        structure_px: lambda_s, slope of the flow above which the smoothness weight falls.
        data_floor: epsilon of the data penaliser, display values.
        warps: linearisations a level.
        sweeps: of relaxation, a linearisation.
        omega: over-relaxation factor.
    """

    smoothness: tuple[float, float, float, float, float] = (250.0, 300.0, 150.0, 300.0, 150.0)
    similarity: float = 50.0
    gradient_weight: float = 1.0
    structure_px: float = 0.1
    data_floor: float = 0.001
    warps: int = 3
    sweeps: int = 8
    omega: float = 1.6


@dataclass(frozen=True)
class SixFrames:
    """Synthetic and true images of t, t + 1 and t - 1.

    Attributes:
        images: (6, h, w, 3) float32 display values: synthetic and true at t, t + 1, t - 1.
        masks: (3, h, w) bool, textured face of the synthetic images.
        motion: (2, h, w, 2) px, motion of the mesh's points to t + 1 and t - 1: the first guess.
    """

    images: np.ndarray
    masks: np.ndarray
    motion: np.ndarray


def corrective_flow(frames: SixFrames, settings: FlowSettings) -> np.ndarray:
    """w_1, the flow from the synthetic to the true frame t, (h, w, 2) px float32.

    All five flows are solved together, coarse to fine. w_2 and w_4 start from the mesh's motion, the
    others from zero.
    """
    height, width = frames.images.shape[1:3]
    flows = np.zeros((height, width, 5, 2), dtype=np.float32)
    flows[:, :, 1], flows[:, :, 3] = frames.motion
    masks = np.ones((6, height, width), dtype=np.float32)
    masks[0::2] = frames.masks
    sizes = pyramid_sizes(height, width)
    flows = _resized_flow(flows, sizes[-1])
    for size in reversed(sizes):
        flows = _resized_flow(flows, size)
        images, inner = _at_size(frames.images, masks, size)
        _solve_level(images, inner, flows, settings)
    return np.ascontiguousarray(flows[:, :, 0])


def pyramid_sizes(height: int, width: int) -> list[tuple[int, int]]:
    """(height, width) of every level, halved until the smaller side would fall below 24 px."""
    sizes = [(height, width)]
    while min(sizes[-1]) >= 2 * _LEAST_SIDE_PX:
        sizes.append((sizes[-1][0] // 2, sizes[-1][1] // 2))
    return sizes


def _at_size(images, masks, size):
    if images.shape[1:3] != size:
        shape = (size[1], size[0])
        images = np.stack([cv2.resize(p, shape, interpolation=cv2.INTER_AREA) for p in images])
        masks = np.stack([cv2.resize(m, shape, interpolation=cv2.INTER_AREA) for m in masks])
    # Derivatives at the border of the texture contain the background.
    inner = [cv2.erode((m > 0.9).astype(np.float32), np.ones((3, 3)), borderValue=1) for m in masks]
    return images, np.stack(inner)[..., None]


def _solve_level(images, masks, flows, settings):
    """Improve (h, w, 5, 2) flows in place."""
    height, width = flows.shape[:2]
    maps = np.stack([channels(image) for image in images])
    direction = structure_direction(images[0])
    alpha = np.asarray(settings.smoothness, dtype=np.float32)
    similarity = np.array([0, 0, settings.similarity, 0, settings.similarity], dtype=np.float32)
    system = np.empty((height, width, 10, 10), dtype=np.float32)
    right = np.empty((height, width, 10), dtype=np.float32)
    edges = np.stack([_plain_edges(height, width, a) for a in alpha])
    for _ in range(settings.warps):
        kernels.assemble(
            maps, masks, flows, kernels.PLACES, kernels.TERMS, np.float32(settings.gradient_weight),
            np.float32(settings.data_floor), system, right,
        )  # fmt: skip
        for index in (0, 1, 3):
            kernels.edge_weights(
                np.ascontiguousarray(flows[:, :, index]), direction, alpha[index],
                np.float32(settings.structure_px), edges[index],
            )  # fmt: skip
        step = np.zeros_like(flows)
        for _ in range(settings.sweeps):
            kernels.relax(system, right, flows, step, edges, similarity, np.float32(settings.omega))
        flows += step


def _plain_edges(height: int, width: int, alpha: float) -> np.ndarray:
    """Edge weights of quadratic smoothness (Mono13 eq. 12), (h, w, 4)."""
    edges = np.zeros((height, width, 4), dtype=np.float32)
    edges[:, :-1, 0] = alpha
    edges[:-1, :, 1] = alpha
    return edges


def _resized_flow(flows: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(h, w, 5, 2) at another size, in that size's pixels."""
    height, width = flows.shape[:2]
    if (height, width) == size:
        return flows
    kind = cv2.INTER_AREA if size[0] < height else cv2.INTER_LINEAR
    parts = [cv2.resize(flows[:, :, k], (size[1], size[0]), interpolation=kind) for k in range(5)]
    scale = np.array([size[1] / width, size[0] / height], dtype=np.float32)
    return np.stack(parts, axis=2) * scale
