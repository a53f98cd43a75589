"""The rigid part of the flow: motion of the head, estimated on the rigid region of the face.

Mono13 7.2 moves vertices only parallel to the image, which bends a head that is rotated. So the rigid
motion is applied first, and eq. 14 follows the rest of the flow.
"""

from __future__ import annotations

import numpy as np

from vermilion.geometry.rotations import cross_matrix, rotation_matrix
from vermilion.tracking.landmark_fit.observation import project, projection_jacobian

_LEAST_POINTS = 12


def rigid_motion(
    local_mm: np.ndarray,
    moved_to: np.ndarray,
    depth_sigma_mm: float,
    sigma_px: float = 0.5,
    focal_px: float = 1.0,
    iterations: int = 8,
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and translation (3,) mm that carry points to their new places in the image.

    Gauss-Newton with robust weights (Cauchy). Motion in depth is hardly visible, so it has a prior.

    Args:
        local_mm: (N, 3), camera frame.
        moved_to: (N, 2) new places, x / z and y / z.
        depth_sigma_mm: typical motion in depth.
        sigma_px: noise of a place, in pixels of a camera of `focal_px`.
        focal_px: focal length that `sigma_px` refers to.
        iterations: Gauss-Newton steps.

    Returns:
        p -> p @ rotation.T + translation in the camera frame; the identity if N < 12.
    """
    rotation, translation = np.eye(3), np.zeros(3)
    if len(local_mm) < _LEAST_POINTS:
        return rotation, translation
    centre = local_mm.mean(axis=0)
    arms = local_mm - centre
    sigma = sigma_px / focal_px
    # Errors of neighbouring flows are correlated: all points count as 50 independent ones.
    share = min(1.0, 50.0 / len(arms))
    for _ in range(iterations):
        turned = arms @ rotation.T
        points = turned + centre + translation
        error = (project(points, 1.0) - moved_to) / sigma
        weight = share / (1 + (error**2).sum(axis=1) / 9)
        slope = projection_jacobian(points, 1.0)
        jacobian = np.concatenate([-slope @ cross_matrix(turned), slope], axis=2) / sigma
        hessian = np.einsum("n,nij,nik->jk", weight, jacobian, jacobian)
        gradient = np.einsum("n,nij,ni->j", weight, jacobian, error)
        hessian[5, 5] += depth_sigma_mm**-2
        gradient[5] += translation[2] / depth_sigma_mm**2
        step = np.linalg.solve(hessian, -gradient)
        rotation = rotation_matrix(step[:3]) @ rotation
        translation = translation + step[3:]
    return rotation, centre + translation - rotation @ centre
