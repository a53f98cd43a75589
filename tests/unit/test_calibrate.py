"""Calibration of a synthetic rig with known truth."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest

from vermilion.capture.board import Board, BoardDetector
from vermilion.capture.calibrate import CalibrationSettings, calibrate_rig
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.camera import Camera, look_at
from vermilion.storage.errors import InputError

BOARD = Board("charuco", (9, 7), 20.0, 15.0, "DICT_4X4_50")
CHECKERS = Board("checkerboard", (9, 8), 20.0)
SIZE = (480, 400)


def make_rig() -> dict[str, Camera]:
    places = {
        "left": (-180.0, 20.0, -700.0),
        "mid": (0.0, 0.0, -720.0),
        "right": (190.0, -30.0, -690.0),
    }
    cameras = {}
    for i, (name, place) in enumerate(places.items()):
        pose = look_at(np.array(place), np.zeros(3), np.array([0.0, -1.0, 0.0]))
        focal = 1250.0 + 20 * i
        params = (focal, focal, 240.0 + 2 * i, 200.0 - 3 * i)
        cameras[name] = Camera(name, "PINHOLE", params, *SIZE, pose)
    return cameras


def board_poses(count: int, seed: int = 0) -> list[np.ndarray]:
    """`world_from_board` (3, 4), tilted up to 40 degrees, in front of the rig."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        tilt = rng.uniform(-0.7, 0.7, 3) * [1, 1, 0.5]
        rotation = cv2.Rodrigues(tilt)[0]
        middle = rng.uniform(-1, 1, 3) * [35, 30, 60]
        centre = np.array([BOARD.squares[0], BOARD.squares[1], 0]) * 10.0
        poses.append(np.concatenate([rotation, (middle - rotation @ centre)[:, None]], axis=1))
    return poses


@cache
def board_image(board: Board) -> np.ndarray:
    """The board at 8 pixels a millimetre, white all round it."""
    scale, (columns, rows) = 8, board.squares
    size = (int(columns * board.square_mm * scale), int(rows * board.square_mm * scale))
    if board.kind == "charuco":
        image = board.charuco().generateImage(size)
    else:
        y, x = np.mgrid[: size[1], : size[0]] // int(board.square_mm * scale)
        image = np.where((x + y) % 2 == 0, 0, 255).astype(np.uint8)
    return image


def render(board: Board, camera: Camera, world_from_board: np.ndarray, over: int = 3) -> np.ndarray:
    """The board in a grey image, box-filtered from `over` squared samples a pixel."""
    image = board_image(board)
    corners_mm = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    corners_mm *= [board.squares[0] * board.square_mm, board.squares[1] * board.square_mm, 0]
    world = corners_mm @ world_from_board[:, :3].T + world_from_board[:, 3]
    target = camera.project(world) * over - 0.5
    height, width = image.shape
    source = np.array([[0, 0], [width, 0], [width, height], [0, height]], float) - 0.5
    homography = cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32))
    large = cv2.warpPerspective(
        image, homography, (SIZE[0] * over, SIZE[1] * over),
        flags=cv2.INTER_AREA, borderValue=200,
    )  # fmt: skip
    small = cv2.resize(large, SIZE, interpolation=cv2.INTER_AREA).astype(float)
    noise = np.random.default_rng(1).normal(0, 1.0, small.shape)
    return np.clip(small * 0.8 + 20 + noise, 0, 255).astype(np.uint8)


def views_of(board: Board, cameras: dict[str, Camera], count: int):
    detector = BoardDetector(board)
    poses = board_poses(count)
    return {
        name: {
            f"{i:03d}": detector.detect(render(board, camera, pose)) for i, pose in enumerate(poses)
        }
        for name, camera in cameras.items()
    }


@pytest.fixture(scope="module")
def seen():
    return views_of(BOARD, make_rig(), 14)


def nearest_to_rays(rays) -> np.ndarray:
    """Points (n, 3) nearest to their rays in all cameras, least squares."""
    normal, right = np.zeros((3, 3)), 0.0
    for origins, directions in rays.values():
        across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
        normal = normal + across
        right = right + (across @ origins[:, :, None])[..., 0]
    return np.linalg.solve(normal, right[..., None])[..., 0]


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.rad2deg(np.linalg.norm(cv2.Rodrigues(a @ b.T)[0])))


def check_against_truth(calibration, truth, mm: float, deg: float, focal: float) -> None:
    inverse = np.linalg.inv(np.vstack([truth["mid"].cam_from_world, [0, 0, 0, 1]]))
    for name, camera in calibration.cameras.items():
        pose = truth[name].cam_from_world @ inverse
        centre = -pose[:, :3].T @ pose[:, 3]
        assert angle_deg(camera.rotation, pose[:, :3]) < deg
        assert np.linalg.norm(camera.centre_mm - centre) < mm
        assert camera.params[0] == pytest.approx(truth[name].params[0], rel=focal)


def test_corners_are_found_to_a_tenth_of_a_pixel():
    camera, pose = make_rig()["mid"], board_poses(1)[0]
    found = BoardDetector(BOARD).detect(render(BOARD, camera, pose))
    world = BOARD.corners_mm[found.ids] @ pose[:, :3].T + pose[:, 3]
    error = np.linalg.norm(camera.project(world) - found.points_px, axis=1)
    assert len(found.ids) > 30
    assert np.median(error) < 0.1
    assert np.abs((camera.project(world) - found.points_px).mean(axis=0)).max() < 0.05


def test_a_charuco_rig_is_recovered(seen):
    truth = make_rig()
    sizes = dict.fromkeys(truth, SIZE)
    result = calibrate_rig(BOARD, seen, sizes, "mid", CalibrationSettings("PINHOLE"))
    assert result.reprojection_px < 0.2
    check_against_truth(result, truth, mm=0.5, deg=0.05, focal=0.003)


def test_a_rig_with_free_distortion_measures_space(seen):
    """Decentring terms trade against principal points and turns; triangulated points do not care."""
    truth = make_rig()
    result = calibrate_rig(
        BOARD, seen, dict.fromkeys(truth, SIZE), "mid", CalibrationSettings("OPENCV")
    )
    points = np.random.default_rng(3).uniform(-60, 60, (200, 3))
    rays = {n: result.cameras[n].rays(camera.project(points)) for n, camera in truth.items()}
    found = nearest_to_rays(rays)
    placed = similarity_alignment(found, points, scale=1.0)
    error_mm = np.linalg.norm(placed.apply(found) - points, axis=1)
    assert np.median(error_mm) < 0.1
    assert error_mm.max() < 0.5


def test_a_checkerboard_rig_is_recovered():
    truth = {name: camera for name, camera in make_rig().items() if name != "right"}
    seen = views_of(CHECKERS, truth, 8)
    sizes = dict.fromkeys(truth, SIZE)
    result = calibrate_rig(CHECKERS, seen, sizes, "mid", CalibrationSettings("PINHOLE"))
    assert result.reprojection_px < 0.2
    check_against_truth(result, truth, mm=1.0, deg=0.1, focal=0.005)


def test_a_camera_without_shared_moments_is_named(seen):
    lonely = {
        name: {f"{name}-{m}" if name == "left" else m: v for m, v in views.items()}
        for name, views in seen.items()
    }
    with pytest.raises(InputError, match=r"left.*both see"):
        calibrate_rig(BOARD, lonely, dict.fromkeys(lonely, SIZE), "mid")


def test_cameras_with_too_few_views_are_all_named(seen):
    few = {
        name: dict(list(views.items())[: 2 if name != "mid" else None])
        for name, views in seen.items()
    }
    with pytest.raises(InputError, match=r"left 2, right 2"):
        calibrate_rig(BOARD, few, dict.fromkeys(few, SIZE), "mid")
