"""Corrective flow (Mono13 7): known warps are found, meshes move as the image asks."""

import cv2
import numpy as np
import pytest

from vermilion.detail.flow.crop import FaceCrop
from vermilion.detail.flow.deformation import DeformationSettings, deform_to_flow, one_per_cell
from vermilion.detail.flow.pose import rigid_motion
from vermilion.detail.flow.six_frame_flow import (
    FlowSettings,
    SixFrames,
    corrective_flow,
    pyramid_sizes,
)
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.rotations import rotation_matrix

HEIGHT, WIDTH = 96, 80
CAMERA = pinhole(
    "cam", 900.0, 320, 240, look_at(np.array([40.0, 20, 600]), np.zeros(3), np.array([0.0, 1, 0]))
)


def skin(shape=(HEIGHT + 60, WIDTH + 60)) -> np.ndarray:
    """A random image with structure at several scales, display values."""
    rng, total = np.random.default_rng(3), np.full((*shape, 3), 120, dtype=np.float32)
    for scale in (1.5, 4, 10):
        noise = cv2.GaussianBlur(rng.normal(size=(*shape, 3)).astype(np.float32), (0, 0), scale)
        total += 18 * noise / noise.std()
    return total


def scene(step_px, corrective):
    """Synthetic images that move by `step_px` a frame; true ones off by the flow (h, w, 2)."""
    base = skin()
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)

    def sample(values, u, v):
        return cv2.remap(values, u, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)

    back = np.zeros_like(corrective)
    for _ in range(30):
        back = -sample(corrective, x + back[..., 0], y + back[..., 1])
    images = []
    for k in (0, 1, -1):
        dx, dy = k * step_px[0], k * step_px[1]
        images.append(sample(base, x - dx + 30, y - dy + 30))
        u, v = sample(back[..., 0], x - dx, y - dy), sample(back[..., 1], x - dx, y - dy)
        images.append(sample(base, x + u - dx + 30, y + v - dy + 30))
    motion = np.stack(
        [np.broadcast_to(np.float32(s), corrective.shape) for s in (step_px, -step_px)]
    )
    return SixFrames(np.stack(images), np.ones((3, HEIGHT, WIDTH), dtype=bool), motion)


def known_flow():
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([2.5 + np.sin(y / 30), -1.5 + np.cos(x / 28)], axis=2).astype(np.float32)


def test_known_warp_is_found_within_a_tenth_of_a_pixel():
    flow = known_flow()
    found = corrective_flow(scene(np.array([1.2, 0.5], dtype=np.float32), flow), FlowSettings())
    error = np.linalg.norm(found - flow, axis=2)[12:-12, 12:-12]
    assert error.mean() < 0.1
    assert np.percentile(error, 95) < 0.2


def test_no_flow_where_the_synthetic_frames_are_right():
    frames = scene(
        np.array([0.8, -0.4], dtype=np.float32), np.zeros((HEIGHT, WIDTH, 2), np.float32)
    )
    found = corrective_flow(frames, FlowSettings())
    assert np.abs(found).max() < 0.01


def test_neighbouring_frames_carry_a_frame_that_shows_nothing_new():
    flow = known_flow()
    frames = scene(np.array([1.2, 0.5], dtype=np.float32), flow)
    noisy = frames.images.copy()
    noise = np.random.default_rng(0).normal(0, 25, noisy[1].shape).astype(np.float32)
    noisy[1] += noise
    frames = SixFrames(noisy, frames.masks, frames.motion)
    inner = (slice(12, -12), slice(12, -12))
    joined = np.linalg.norm(corrective_flow(frames, FlowSettings()) - flow, axis=2)[inner].mean()
    # Without its neighbours the frame has only its own noise to go by.
    alone = SixFrames(noisy[[0, 1, 0, 1, 0, 1]], frames.masks, 0 * frames.motion)
    single = np.linalg.norm(corrective_flow(alone, FlowSettings()) - flow, axis=2)[inner].mean()
    assert joined < 0.8 * single


def test_pyramid_ends_before_images_become_too_small():
    assert pyramid_sizes(480, 200) == [(480, 200), (240, 100), (120, 50), (60, 25)]
    assert pyramid_sizes(20, 20) == [(20, 20)]


def sheet():
    """A curved sheet of 21 x 21 vertices in the world, and its triangles."""
    x, y = np.meshgrid(np.linspace(-60, 60, 21), np.linspace(-50, 50, 21))
    vertices = np.stack([x, y, 20 - (x**2 + y**2) / 150], axis=2).reshape(-1, 3)
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).reshape(-1)
    lower = np.stack([corner, corner + 1, corner + 21], axis=1)
    upper = np.stack([corner + 1, corner + 22, corner + 21], axis=1)
    return vertices, np.concatenate([lower, upper]).astype(np.int32)


def follow(flow_px, **settings):
    """The sheet after a flow of (2,) px everywhere or (240, 320, 2), and the sheet before."""
    vertices, triangles = sheet()
    flow = np.broadcast_to(np.float32(flow_px), (240, 320, 2)).copy()
    everywhere = np.ones(len(vertices), dtype=bool)
    moved = deform_to_flow(
        vertices, triangles, CAMERA, flow, np.ones((240, 320), bool), everywhere, everywhere,
        DeformationSettings(**settings),
    )  # fmt: skip
    return vertices, moved


def test_mesh_moves_parallel_to_the_image_only():
    y, x = np.mgrid[0:240, 0:320]
    bend = np.stack([2 * np.sin(y / 40), 1.5 * np.cos(x / 50)], axis=2)
    vertices, moved = follow(bend, pose=False)
    shift = (moved - vertices) @ CAMERA.rotation.T
    assert np.abs(shift[:, 2]).max() < 1e-9
    assert np.abs(shift[:, :2]).max() > 0.5


@pytest.mark.parametrize("pose", [False, True])
def test_mesh_projects_where_an_even_flow_leads(pose):
    vertices, moved = follow([3.0, -2.0], pose=pose)
    error = CAMERA.project(moved) - CAMERA.project(vertices) - [3.0, -2.0]
    assert np.abs(error).max() < 0.05


def test_hidden_vertices_keep_their_shape_beside_those_that_follow():
    vertices, triangles = sheet()
    visible = vertices[:, 0] < 0
    flow = np.broadcast_to(np.float32([4.0, 0.0]), (240, 320, 2)).copy()
    moved = deform_to_flow(
        vertices, triangles, CAMERA, flow, np.ones((240, 320), bool), visible, visible,
        DeformationSettings(pose=False),
    )  # fmt: skip
    shift = np.linalg.norm(moved - vertices, axis=1)
    expected_mm = 4.0 * 590 / 900
    assert np.abs(shift - expected_mm).max() < 0.35  # the rest of the sheet goes along


def test_head_motion_is_recovered_from_places_in_the_image():
    local = CAMERA.to_camera(sheet()[0])
    rotation, translation = (
        rotation_matrix(np.radians([2.0, -3.0, 1.0])),
        np.array([3.0, -2.0, 1.0]),
    )
    turned = local @ rotation.T
    arm = local.mean(axis=0)
    moved = turned - arm @ rotation.T + arm + translation
    places = moved[:, :2] / moved[:, 2:]
    places[::25] += 0.05  # bad flow here and there
    found, shift = rigid_motion(local, places, depth_sigma_mm=50.0, focal_px=900.0)
    error_mm = np.linalg.norm(local @ found.T + shift - moved, axis=1)
    assert error_mm.max() < 0.5


def test_too_few_points_move_nothing():
    rotation, translation = rigid_motion(np.ones((3, 3)), np.zeros((3, 2)), 3.0)
    assert (rotation == np.eye(3)).all() and (translation == 0).all()


def test_one_vertex_of_each_square_is_chosen():
    pixels = np.random.default_rng(0).uniform(0, 40, (500, 2))
    chosen = one_per_cell(pixels, np.arange(500), 8.0)
    cells = np.floor(pixels[chosen] / 8)
    assert len(np.unique(cells, axis=0)) == len(chosen) == 25


def test_crop_sees_what_the_whole_image_sees():
    crop = FaceCrop.around(CAMERA, np.array([[100.0, 60], [220, 200]]), 0.1, 80)
    assert max(crop.camera.width_px, crop.camera.height_px) == 80
    point = np.array([[5.0, -8, 10]])
    scale = np.array([crop.camera.width_px, crop.camera.height_px]) / crop.size_px
    expected = (CAMERA.project(point) - crop.corner_px) * scale
    assert np.abs(crop.camera.project(point) - expected).max() < 1e-6


def test_face_outside_the_image_is_refused():
    with pytest.raises(ValueError, match="outside the image"):
        FaceCrop.around(CAMERA, np.array([[-300.0, 10], [-200, 90]]), 0.05, 100)
