"""The scaled orthographic pose."""

import numpy as np

from tests.unit.synthetic_face import landmark_layout
from vermilion.geometry.rotations import rotation_matrix, rotation_vector
from vermilion.tracking.landmark_fit.pose import scaled_orthographic_pose


def test_scaled_orthographic_pose_is_exact_on_scaled_orthographic_images():
    points = landmark_layout()
    wanted = rotation_matrix(np.array([0.1, 0.5, -0.2])) @ np.diag([1.0, -1.0, -1.0])
    image = 2.3 * points @ wanted[:2].T + [31.0, -12.0]
    rotation, scale, shift = scaled_orthographic_pose(points[None], image[None], np.ones((1, 66)))
    assert np.degrees(np.linalg.norm(rotation_vector(rotation[0] @ wanted.T))) < 0.01
    assert np.isclose(scale[0], 2.3, rtol=1e-4)
    assert np.allclose(shift[0], [31.0, -12.0], atol=0.01)
