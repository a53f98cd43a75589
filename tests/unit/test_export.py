"""Files for other programs: what is written is what is read."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.evaluation_face import sheet_face
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.objs import write_obj
from vermilion.export.overlay import (
    SKIN,
    crop_round,
    join_videos,
    lip_colours,
    overlay_image,
    strips_following,
)
from vermilion.export.usd import CAMERA_PATH, MESH_PATH, write_usd
from vermilion.export.weights import write_weights
from vermilion.geometry.camera import pinhole
from vermilion.geometry.mesh_files import read_mesh
from vermilion.geometry.polygons import Polygons
from vermilion.imaging.video import VideoReader, write_video


def sequence(frames: int = 4) -> tuple[np.ndarray, np.ndarray]:
    model = sheet_face()
    steps = np.arange(frames, dtype=float)[:, None, None]
    return model.neutral_mm + steps * [0.0, 0.5, 0.0] + [0.0, 0.0, 600.0], model.triangles


def animation(frames, vertices, triangles, camera, unit_mm=1.0) -> Animation:
    still = HeadFrame(np.tile(np.eye(3), (len(frames), 1, 1)), np.zeros((len(frames), 3)))
    none = NamedShapes((), np.zeros((0, *vertices[0].shape)), np.zeros((len(frames), 0)))
    return Animation(
        np.asarray(frames), 25.0, vertices, Polygons.of_triangles(triangles), vertices[0], still,
        none, unit_mm, camera=camera,
    )  # fmt: skip


def test_usd_round_trip_in_millimetres_and_frames(tmp_path):
    from pxr import Usd, UsdGeom

    vertices, triangles = sequence()
    frames = np.array([10, 11, 12, 15])
    camera = pinhole("cam", 1500.0, 640, 480)
    path = tmp_path / "corrected.usdc"
    write_usd(path, animation(frames, vertices, triangles, camera))
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageMetersPerUnit(stage) == pytest.approx(0.001)
    assert stage.GetTimeCodesPerSecond() == 25.0
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (10.0, 15.0)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(MESH_PATH))
    assert mesh.GetPointsAttr().GetTimeSamples() == [10.0, 11.0, 12.0, 15.0]
    points = np.array(mesh.GetPointsAttr().Get(15.0))
    assert np.abs(points - vertices[3]).max() < 1e-4
    ids = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    assert (ids == triangles).all()


@pytest.mark.parametrize("unit_mm", [1.0, 10.0])
def test_usd_camera_sees_what_our_camera_sees(tmp_path, unit_mm):
    from pxr import Gf, Usd, UsdGeom

    vertices, triangles = sequence(1)
    camera = pinhole("cam", 1500.0, 640, 480)
    camera = type(camera)("cam", "PINHOLE", (1500.0, 1500.0, 300.0, 260.0), 640, 480, np.eye(3, 4))
    path = tmp_path / "a.usdc"
    write_usd(path, animation([0], vertices, triangles, camera, unit_mm))
    stage = Usd.Stage.Open(str(path))
    prim = UsdGeom.Camera(stage.GetPrimAtPath(CAMERA_PATH))
    tenth_mm = unit_mm / 10  # a tenth of a stage unit, in which apertures are
    assert prim.GetHorizontalApertureAttr().Get() * tenth_mm == pytest.approx(36.0)
    assert prim.GetFocalLengthAttr().Get() * tenth_mm == pytest.approx(1500 * 36 / 640)
    frustum = prim.GetCamera(0.0).frustum
    view = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    world = UsdGeom.Xformable(stage.GetPrimAtPath(MESH_PATH)).ComputeLocalToWorldTransform(0.0)
    for point in vertices[0][::97]:
        seen = view.Transform(world.Transform(Gf.Vec3d(*(point / unit_mm).tolist())))
        pixel = [(seen[0] + 1) / 2 * 640, (1 - seen[1]) / 2 * 480]
        assert np.abs(np.array(pixel) - camera.project(point)).max() < 0.05


def test_usd_is_upright_for_a_video_whose_world_is_its_camera(tmp_path):
    from pxr import Gf, Usd, UsdGeom

    vertices, triangles = sequence(1)
    camera = pinhole("c", 9, 8, 8)
    write_usd(tmp_path / "a.usdc", animation([0], vertices, triangles, camera))
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    root = UsdGeom.Xformable(stage.GetPrimAtPath("/Face")).ComputeLocalToWorldTransform(0.0)
    assert root.TransformDir(Gf.Vec3d(0, -1, 0))[1] == pytest.approx(1.0)  # the image's up


def test_obj_keeps_order_and_coordinates(tmp_path):
    vertices, triangles = sequence(1)
    write_obj(tmp_path / "a.obj", vertices[0], triangles)
    mesh = read_mesh(tmp_path / "a.obj")
    assert np.abs(mesh.vertices_mm - vertices[0]).max() < 1e-4
    assert (mesh.triangles == triangles).all()


def test_weights_have_time_in_seconds(tmp_path):
    weights = np.array([[0.0, 1.0], [0.25, 0.5]])
    valid = np.array([True, False])
    write_weights(
        tmp_path / "w.csv", np.array([7, 8]), 25.0, ["jawOpen", "mouthPucker"], weights, valid
    )
    lines = (tmp_path / "w.csv").read_text().splitlines()
    assert lines == ["frame,time_s,valid,jawOpen,mouthPucker", "7,0,1,0,1", "8,0.04,0,0.25,0.5"]


def test_joined_video_has_all_frames_in_order(tmp_path):
    images = [np.full((48, 64, 3), 20 * i, np.uint8) for i in range(11)]
    write_video(tmp_path / "a.mp4", images[:4], 25.0)
    write_video(tmp_path / "b.mp4", images[4:], 25.0)
    join_videos(tmp_path / "ab.mp4", [tmp_path / "a.mp4", tmp_path / "b.mp4"])
    reader = VideoReader(tmp_path / "ab.mp4")
    assert reader.n_frames == 11
    for index, image in enumerate(images):
        assert np.abs(reader.read(index).astype(int) - image).mean() < 4


def test_crop_shows_the_mesh_where_the_whole_image_has_it():
    """The cropped camera projects to the cropped image's pixels."""
    vertices, _ = sequence(1)
    camera = pinhole("cam", 1500.0, 640, 480)
    points = camera.project(vertices[0])
    for crop in (
        crop_round(points, (640, 480), 0.3, 200),
        strips_following(points[None], 0.3, (200, 120))[0],
    ):
        near = crop.of_camera(camera)
        assert (near.width_px, near.height_px) == crop.size
        expected = (points - [crop.left, crop.top]) * crop.scale
        assert np.abs(near.project(vertices[0]) - expected).max() < 1.0


def test_overlay_has_a_column_a_mesh_and_says_what_is_not_tracked():
    vertices, triangles = sequence(1)
    camera = pinhole("cam", 1500.0, 640, 480)
    crop = crop_round(camera.project(vertices[0]), (640, 480), 0.2, 160)
    image = np.full((480, 640, 3), 120, np.uint8)
    colours = np.full((vertices.shape[1], 3), 0.8)
    shown = overlay_image(
        image, camera, [crop], [("base", vertices[0]), ("corrected", None)], triangles, colours,
        1.0, "frame 0",
    )  # fmt: skip
    width, height = crop.size
    assert shown.shape == (height, 3 * width, 3)
    middle = shown[height // 4, [width // 2, width + width // 2, 2 * width + width // 2]]
    assert (middle[0] == 120).all()
    assert (middle[1] != 120).all()
    assert (middle[2] == 60).all()


def test_strips_follow_the_lips_and_pass_over_a_lost_frame():
    points = np.array([[0.0, 0.0], [40.0, 20.0]]) + 3.0 * np.arange(30)[:, None, None]
    points[12] = np.nan
    strips = strips_following(points, 0.0, (80, 40))
    assert {strip.size for strip in strips} == {(80, 40)}
    lefts = np.array([strip.left for strip in strips])
    assert np.abs(np.diff(lefts[8:22]) - 3).max() <= 1


def test_lips_fade_into_the_skin():
    model = sheet_face()
    lips = model.regions["vermilion_upper"]
    colours = lip_colours(model.triangles, lips)
    assert colours.shape == (model.n_vertices, 3)
    far = np.abs(model.neutral_mm[:, 1]) > 30
    assert np.allclose(colours[far], SKIN)
    middle = lips & (np.abs(model.neutral_mm[:, 0]) < 3) & (model.neutral_mm[:, 1] > 3)
    assert (colours[middle, 0] - colours[middle, 1] > 0.1).all()
