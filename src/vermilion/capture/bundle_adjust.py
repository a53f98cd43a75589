"""Bundle adjustment of a rig over tracks of unknown points; alignment to the given poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pycolmap
from scipy.spatial.transform import Rotation

from vermilion.capture.tracks import Tracks
from vermilion.geometry.camera import Camera


def triangulate_tracks(cameras: Mapping[str, Camera], tracks: Tracks) -> np.ndarray:
    """Least-squares intersection (P, 3) mm of the rays of each track, world."""
    origins, directions = np.zeros((2, len(tracks.track), 3))
    for i, name in enumerate(tracks.cameras):
        mine = tracks.camera == i
        origins[mine], directions[mine] = cameras[name].rays(tracks.pixels[mine])
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    left, right = np.zeros((tracks.count, 3, 3)), np.zeros((tracks.count, 3))
    np.add.at(left, tracks.track, across)
    np.add.at(right, tracks.track, np.einsum("kij,kj->ki", across, origins))
    return np.linalg.solve(left + 1e-12 * np.eye(3), right[..., None])[..., 0]


def adjustment_options(
    loss_px: float, iterations: int, tolerance: float
) -> pycolmap.BundleAdjustmentOptions:
    """COLMAP's options of a robust adjustment in one thread: the sums' order decides last digits."""
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.SOFT_L1
    options.ceres.loss_function_scale = loss_px
    options.ceres.solver_options.num_threads = 1
    options.ceres.solver_options.max_num_iterations = iterations
    options.ceres.solver_options.function_tolerance = tolerance
    return options


def bundle_adjust(
    cameras: Mapping[str, Camera],
    tracks: Tracks,
    points_mm: np.ndarray,
    *,
    free_poses: bool,
    loss_px: float,
    free_focal: bool = False,
    centres_mm: Mapping[str, np.ndarray] | None = None,
    shift_mm: float = 1.0,
) -> tuple[dict[str, Camera], np.ndarray]:
    """Minimise the robust reprojection error over points, and over poses and focal lengths if free.

    One thread, so that sums have one order and results are reproducible. The world may drift: see
    `align_to_given`.

    Args:
        cameras: first guess.
        tracks: observations.
        points_mm: (P, 3) first guess, world.
        free_poses: whether poses change.
        free_focal: whether focal lengths change (only with `free_poses`).
        loss_px: residual at which the robust loss turns from squared to linear.
        centres_mm: camera -> (3,) prior of its centre, without which a rig around a small face can
            bend with hardly any change in the images.
        shift_mm: deviation of that prior: it costs as much as a residual of a pixel.

    Returns:
        the cameras, and points (P, 3) mm.
    """
    seen = np.flatnonzero(tracks.per_camera())
    model = _reconstruction(cameras, tracks, points_mm, seen)
    options = adjustment_options(loss_px, iterations=100, tolerance=1e-9)
    options.refine_focal_length = free_focal and free_poses
    options.refine_extra_params = options.refine_principal_point = False
    options.refine_rig_from_world = free_poses
    config = pycolmap.BundleAdjustmentConfig()
    for i in seen:
        config.add_image(int(i) + 1)
    _adjuster(options, config, model, centres_mm if free_poses else None, shift_mm).solve()
    moved = dict(cameras)
    for i in seen:
        pose = np.asarray(model.images[int(i) + 1].cam_from_world().matrix())
        params = tuple(float(p) for p in model.cameras[int(i) + 1].params)
        name = tracks.cameras[i]
        moved[name] = replace(cameras[name], cam_from_world=pose, params=params)
    return moved, np.stack([model.points3D[k].xyz for k in sorted(model.points3D)])


def _reconstruction(
    cameras: Mapping[str, Camera], tracks: Tracks, points_mm: np.ndarray, seen: np.ndarray
) -> pycolmap.Reconstruction:
    """COLMAP's model: camera and image i + 1 of each of the cameras `seen` (n,), points (P, 3)."""
    model = pycolmap.Reconstruction()
    index = np.zeros(len(tracks.track), int)
    for i in seen:
        name, mine = tracks.cameras[i], tracks.camera == i
        index[mine] = np.arange(mine.sum())
        camera = cameras[name].colmap()
        camera.camera_id = int(i) + 1
        model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(
            name=name, keypoints=tracks.pixels[mine], camera_id=int(i) + 1, image_id=int(i) + 1
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(cameras[name].cam_from_world))
    order = np.argsort(tracks.track, kind="stable")
    ends = np.cumsum(np.bincount(tracks.track))
    for point, rows in zip(points_mm, np.split(order, ends[:-1]), strict=True):
        elements = [pycolmap.TrackElement(int(tracks.camera[k]) + 1, int(index[k])) for k in rows]
        model.add_point3D(point, pycolmap.Track(elements))
    return model


def _adjuster(options, config, model, centres_mm, shift_mm: float):
    """COLMAP's bundle adjuster, with a prior on the centres where they are given."""
    if centres_mm is None:
        return pycolmap.create_default_bundle_adjuster(options, config, model)
    priors = []
    for image in model.images.values():
        prior = pycolmap.PosePrior()
        prior.pose_prior_id = image.image_id
        prior.corr_data_id = image.data_id
        prior.position = centres_mm[image.name]
        prior.position_covariance = np.eye(3) * shift_mm**2
        prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
        priors.append(prior)
    prior_options = pycolmap.PosePriorBundleAdjustmentOptions()
    prior_options.alignment_ransac.random_seed = 0
    return pycolmap.create_pose_prior_bundle_adjuster(options, prior_options, config, priors, model)


def residuals_px(
    cameras: Mapping[str, Camera], tracks: Tracks, points_mm: np.ndarray
) -> np.ndarray:
    """Distance (K,) px of each observation to its point's projection; infinite behind the camera.

    `points_mm` (P, 3) are the tracks' points, world.
    """
    distance = np.zeros(len(tracks.track))
    for i, name in enumerate(tracks.cameras):
        mine = tracks.camera == i
        expected = cameras[name].project(points_mm[tracks.track[mine]])
        distance[mine] = np.linalg.norm(expected - tracks.pixels[mine], axis=1)
    return np.nan_to_num(distance, nan=np.inf)


def align_to_given(
    given: Mapping[str, Camera],
    moved: Mapping[str, Camera],
    turn_deg: float,
    shift_mm: float,
) -> dict[str, Camera]:
    """`moved`, rotated, shifted and scaled as a whole to fit the given poses best.

    Orientations determine the rotation that positions leave open where the cameras stand on a line.

    Args:
        given: cameras to fit.
        moved: the same cameras, adjusted.
        turn_deg, shift_mm: expected deviations of a given orientation and position, which weight
            the two.
    """
    names = sorted(moved)
    old = np.stack([given[n].rotation for n in names])
    new = np.stack([moved[n].rotation for n in names])
    goal = np.stack([given[n].centre_mm for n in names])
    start = np.stack([moved[n].centre_mm for n in names])
    middle, target = start.mean(axis=0), goal.mean(axis=0)
    from scipy.optimize import least_squares

    turned = Rotation.from_matrix(old.transpose(0, 2, 1) @ new)  # rotation from moved to given
    first = turned.mean()

    def parts(x):
        return Rotation.from_rotvec(x[:3]) * first, np.exp(x[3]), x[4:] + target

    def misfit(x):
        rotation, scale, place = parts(x)
        centres = scale * rotation.apply(start - middle) + place
        angles = (rotation * turned.inv()).as_rotvec(degrees=True)
        return np.concatenate([((centres - goal) / shift_mm).ravel(), (angles / turn_deg).ravel()])

    x = least_squares(misfit, np.zeros(7), x_scale=[1e-3] * 4 + [1.0] * 3, xtol=1e-14).x
    rotation, scale, place = parts(x)
    laid = {}
    for name, centre in zip(names, start, strict=True):
        pose = moved[name].rotation @ rotation.as_matrix().T
        there = scale * rotation.apply(centre - middle) + place
        pose = np.concatenate([pose, (-pose @ there)[:, None]], axis=1)
        laid[name] = replace(moved[name], cam_from_world=pose)
    return laid
