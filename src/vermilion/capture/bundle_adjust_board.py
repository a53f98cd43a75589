"""Bundle adjustment of a rig over views of a board, with COLMAP's rigs and frames.

The world is the board's frame, so the rig moves: each moment is a COLMAP frame with a
`rig_from_world`, the cameras are sensors with a fixed `sensor_from_rig`, and the board's corners are
known points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap

from vermilion.capture.board import Corners
from vermilion.capture.bundle_adjust import adjustment_options


@dataclass(frozen=True)
class RigEstimate:
    """Cameras of a rig and the board's poses.

    Attributes:
        cameras: name -> pycolmap camera (model and intrinsics).
        camera_from_rig: name -> (3, 4); identity for the reference camera.
        rig_from_board: moment -> (3, 4), millimetres.
    """

    cameras: dict[str, pycolmap.Camera]
    camera_from_rig: dict[str, np.ndarray]
    rig_from_board: dict[str, np.ndarray]


BoardViews = dict[str, dict[str, Corners]]  # camera -> moment -> corners


def bundle_adjust_board(
    estimate: RigEstimate,
    reference: str,
    seen: BoardViews,
    corners_mm: np.ndarray,
    refine_principal_point: bool,
) -> RigEstimate:
    """Refine intrinsics, camera poses and board poses together.

    Args:
        estimate: first guess.
        reference: camera whose frame is the rig's.
        seen: corners in the views.
        corners_mm: (N, 3) of the board, board frame; fixed.
        refine_principal_point: whether the principal point is estimated.
    """
    model, ids = _reconstruction(estimate, reference, seen, corners_mm)
    options = adjustment_options(1.0, iterations=200, tolerance=1e-10)
    options.refine_points3D = False
    options.refine_principal_point = refine_principal_point
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in model.images:
        config.add_image(image_id)
    for point_id in model.points3D:
        config.add_constant_point(point_id)
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()
    rig = model.rigs[1]
    poses = {
        name: np.eye(3, 4)
        if name == reference
        else _matrix(rig.sensor_from_rig(model.cameras[camera_id].sensor_id))
        for name, camera_id in ids.items()
    }
    moments = sorted(estimate.rig_from_board)
    boards = {
        moment: _matrix(model.frames[i].rig_from_world) for i, moment in enumerate(moments, start=1)
    }
    return RigEstimate({name: model.cameras[i] for name, i in ids.items()}, poses, boards)


def reprojection(
    estimate: RigEstimate, camera: str, moment: str, corners_mm: np.ndarray
) -> np.ndarray:
    """Expected pixels (n, 2) of the board's corners `corners_mm` (n, 3) in a camera at a moment."""
    board = estimate.rig_from_board[moment]
    pose = estimate.camera_from_rig[camera]
    in_rig = corners_mm @ board[:, :3].T + board[:, 3]
    local = in_rig @ pose[:, :3].T + pose[:, 3]
    return np.asarray(estimate.cameras[camera].img_from_cam(local))


def _matrix(pose: pycolmap.Rigid3d | None) -> np.ndarray:
    """(3, 4) of a pose that the reconstruction was given."""
    assert pose is not None
    return np.asarray(pose.matrix())


def _reconstruction(
    estimate: RigEstimate, reference: str, seen: BoardViews, corners_mm: np.ndarray
) -> tuple[pycolmap.Reconstruction, dict[str, int]]:
    model = pycolmap.Reconstruction()
    names = [reference, *sorted(set(estimate.cameras) - {reference})]
    ids = {name: i for i, name in enumerate(names, start=1)}
    rig = pycolmap.Rig(rig_id=1)
    for name, camera_id in ids.items():
        camera = estimate.cameras[name]
        copy = pycolmap.Camera(
            model=camera.model_name,
            width=camera.width,
            height=camera.height,
            params=list(camera.params),
            camera_id=camera_id,
        )
        model.add_camera(copy)
        if name == reference:
            rig.add_ref_sensor(copy.sensor_id)
        else:
            rig.add_sensor(copy.sensor_id, pycolmap.Rigid3d(estimate.camera_from_rig[name]))
    model.add_rig(rig)
    for corner_id, xyz in enumerate(corners_mm, start=1):
        model.add_point3D_with_id(corner_id, pycolmap.Point3D(xyz=xyz))
    image_id = 0
    for frame_id, moment in enumerate(sorted(estimate.rig_from_board), start=1):
        frame = pycolmap.Frame(frame_id=frame_id, rig_id=1)
        frame.rig_from_world = pycolmap.Rigid3d(estimate.rig_from_board[moment])
        images = []
        for name in names:
            if moment not in seen[name]:
                continue
            image_id += 1
            keypoints = np.ascontiguousarray(seen[name][moment].points_px)
            image = pycolmap.Image(
                name=f"{name}/{moment}",
                keypoints=keypoints,
                camera_id=ids[name],
                image_id=image_id,
            )
            image.frame_id = frame_id
            frame.add_data_id(image.data_id)
            images.append((image, seen[name][moment].ids))
        model.add_frame(frame)
        for image, corner_ids in images:
            model.add_image(image)
            for index, corner in enumerate(corner_ids):
                element = pycolmap.TrackElement(image.image_id, index)
                model.add_observation(int(corner) + 1, element)
        model.register_frame(frame_id)
    return model, ids
