"""A head turned by 45 degrees: hidden landmarks do not count, the far jaw slides on the silhouette."""

from functools import cache

import numpy as np

from tests import heads
from vermilion.geometry.rotations import rotation_matrix
from vermilion.tracking.landmark_fit.expression import HeadMotion, LandmarkFitSettings, fit_motion
from vermilion.tracking.landmark_fit.observation import Observations, project
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.landmark_fit.turned import as_seen_turned, model_meshes, turned_frames

FOCAL_PX, FPS = 1400.0, 25.0
YAW_DEG = np.array([0.0, 10.0, 35.0, 45.0, 45.0, 50.0, 45.0])
#: The frames are views, not a motion.
JUMPY = LandmarkFitSettings(rotation_acceleration_deg=1e6)
#: The far side of a head that turns to its left (positive yaw).
FAR_JAW, FAR_EYE_AND_BROW = np.arange(0, 8), np.array([17, 18, 36, 37, 41])


@cache
def shape() -> LandmarkShape:
    return LandmarkShape.of(heads.small_tracker())


def nobody() -> np.ndarray:
    return np.zeros(heads.small_tracker().n_identities)


def turned_head():
    n = len(YAW_DEG)
    vectors = np.radians(YAW_DEG)[:, None] * [0.0, 1.0, 0.0]
    rotation = rotation_matrix(vectors) @ np.diag([1.0, -1.0, -1.0])
    weights = np.zeros((n, shape().n_expressions))
    weights[:, heads.small_tracker().expression_names.index("jawOpen")] = 0.2
    return HeadMotion(rotation, np.tile([0.0, 0.0, 700.0], (n, 1)), weights, np.zeros(n))


def outline(mesh):
    """The image of a mesh's vertices, and its hull's."""
    import cv2

    points = project(mesh[heads.small_tracker().regions["face"]], FOCAL_PX)
    return points, cv2.convexHull(points.astype(np.float32))[:, 0]


def detected(truth):
    """As a detector marks it: the far jaw at the face's edge in the image, hidden points about there too."""
    meshes, rng = model_meshes(heads.small_tracker(), nobody(), truth), np.random.default_rng(0)
    image = np.zeros((len(YAW_DEG), 66, 2))
    for row, yaw in enumerate(YAW_DEG):
        points = project(meshes(row)[heads.small_tracker().landmarks], FOCAL_PX)
        if yaw > 20:
            _, hull = outline(meshes(row))
            edges = np.concatenate(
                [np.linspace(a, b, 40) for a, b in zip(hull, np.roll(hull, 1, 0), strict=True)]
            )
            for point in FAR_JAW:
                points[point] = edges[np.argmin(np.linalg.norm(edges - points[point], axis=1))]
            points[FAR_EYE_AND_BROW] += rng.normal(-6, 8, (len(FAR_EYE_AND_BROW), 2))
        image[row] = points + rng.normal(0, 1.0, points.shape)
    valid = np.ones(len(image), dtype=bool)
    return Observations(image, np.ones((len(image), 66)), valid)


def off_px(motion, truth):
    """Mean distance of the face's vertices in the image from where they are, of each frame."""
    found, right = (model_meshes(heads.small_tracker(), nobody(), m) for m in (motion, truth))
    return np.array(
        [
            np.linalg.norm(outline(found(row))[0] - outline(right(row))[0], axis=1).mean()
            for row in range(len(YAW_DEG))
        ]
    )


def test_the_mesh_covers_a_face_turned_by_45_degrees():
    truth = turned_head()
    seen = detected(truth)
    motion = before = fit_motion(shape(), seen, FOCAL_PX, FPS, JUMPY)
    for _ in range(3):
        turned = turned_frames(motion.rotation, motion.translation_mm)
        assert list(turned) == list(YAW_DEG > 20)
        meshes = model_meshes(heads.small_tracker(), nobody(), motion)
        visible = as_seen_turned(seen, heads.small_tracker(), meshes, turned, FOCAL_PX)
        motion = fit_motion(shape(), visible, FOCAL_PX, FPS, JUMPY)
    half = YAW_DEG > 40
    after = off_px(motion, truth)[half].mean()
    assert after < 0.75 * off_px(before, truth)[half].mean()
    assert after < 2.5  # px, eyes 180 px apart in a frontal view
    assert motion.reprojection_px[half].mean() < before.reprojection_px[half].mean()


def test_hidden_landmarks_have_no_trust_and_frontal_frames_stay():
    truth = turned_head()
    seen, meshes = detected(truth), model_meshes(heads.small_tracker(), nobody(), truth)
    visible = as_seen_turned(seen, heads.small_tracker(), meshes, YAW_DEG > 20, FOCAL_PX)
    assert (visible.trust[:2] == 1).all() and (visible.image[:2] == seen.image[:2]).all()
    assert visible.trust[4, 39] == 0.0  # the inner corner of the far eye, behind the nose
    near_eye_and_nose = np.array([30, 33, 42, 45, 54])
    assert (visible.trust[4, near_eye_and_nose] > 0.9).all()
    # An observed point of the far jaw that lies on the silhouette asks for no motion at all.
    model_jaw = project(meshes(4)[heads.small_tracker().landmarks], FOCAL_PX)[3]
    assert (
        np.linalg.norm(visible.image[4, 3] - model_jaw)
        < 6.0
        < np.linalg.norm(seen.image[4, 3] - model_jaw)
    )
