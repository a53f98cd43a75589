"""Cameras of other programs: the same points fall on the same pixels."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from vermilion.app.cameras import report
from vermilion.capture.camera_files.read import convergence, read_given_cameras
from vermilion.geometry.camera import Camera, look_at, write_cameras
from vermilion.imaging.images import write_srgb8
from vermilion.storage.errors import InputError

UP = np.array([0.0, 1.0, 0.0])
TARGET = np.array([10.0, -20.0, 30.0])
POINTS = TARGET + np.random.default_rng(0).uniform(-80, 80, (50, 3))
EXACT_PX = 1e-3


def rig(distortion=(), model="PINHOLE") -> dict[str, Camera]:
    """Three cameras about a metre from a face."""
    found = {}
    for k, name in enumerate(("c0", "c1", "c2")):
        pose = look_at(TARGET + np.array([600.0 * (k - 1), 50.0 * k, 950.0]), TARGET, UP)
        lens = (1500.0 + k, 1490.0, 330.0, 250.0, *distortion)
        found[name] = Camera(name, model, lens, 640, 480, pose)
    return found


def check(folder, cameras):
    """The cameras read from a folder project as those that were written."""
    sizes = dict.fromkeys(cameras, (640, 480))
    given = read_given_cameras(folder, sizes)
    assert sorted(given.cameras) == sorted(cameras)
    for name, camera in cameras.items():
        found = given.cameras[name]
        assert (found.width_px, found.height_px) == (640, 480)
        assert np.abs(found.project(POINTS) - camera.project(POINTS)).max() < EXACT_PX
        assert np.abs(found.centre_mm - camera.centre_mm).max() < 1e-3
    return "\n".join(given.understood)


def test_colmap_as_before(tmp_path):
    write_cameras(tmp_path / "cameras", rig())
    assert "COLMAP, 3 cameras" in check(tmp_path / "cameras", rig())


def metashape(path, cameras, scale=0.25):
    """Write what Metashape exports: poses in a chunk of its own frame and scale, metres."""
    turn = cv2.Rodrigues(np.array([0.3, -0.8, 0.2]))[0]
    place = np.array([0.5, -1.0, 2.0])
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<document version="1.2.0"><chunk><sensors>']
    for name, camera in cameras.items():
        fx, fy, cx, cy, *bends = camera.params
        k1, k2, p1, p2, k3 = (*bends, 0, 0, 0, 0, 0)[:5]
        lines.append(
            f'<sensor id="{name}"><resolution width="640" height="480"/>'
            f'<calibration type="frame" class="adjusted"><f>{fy}</f><b1>{fx - fy}</b1>'
            f"<cx>{cx - 320}</cx><cy>{cy - 240}</cy><k1>{k1}</k1><k2>{k2}</k2><k3>{k3}</k3>"
            f"<p1>{p2}</p1><p2>{p1}</p2></calibration></sensor>"
        )
    lines.append("</sensors><cameras>")
    for name, camera in cameras.items():
        pose = np.eye(4)
        pose[:3, :3] = turn.T @ camera.rotation.T
        pose[:3, 3] = turn.T @ (camera.centre_mm / 1000 - place) / scale
        numbers = " ".join(repr(float(v)) for v in pose.ravel())
        lines.append(
            f'<camera sensor_id="{name}" label="{name}.jpg"><transform>{numbers}</transform></camera>'
        )
    lines.append('<camera sensor_id="c0" label="lost.jpg"/></cameras><transform>')
    lines.append(f"<rotation>{' '.join(map(repr, map(float, turn.ravel())))}</rotation>")
    lines.append(f"<translation>{' '.join(map(str, place))}</translation><scale>{scale}</scale>")
    path.write_text("\n".join([*lines, "</transform></chunk></document>"]))


@pytest.mark.parametrize("bends", [(), (-0.1, 0.03, 0.002, -0.001, 0.01, 0, 0, 0)])
def test_metashape(tmp_path, bends):
    cameras = rig(bends, "FULL_OPENCV" if bends else "PINHOLE")
    metashape(tmp_path / "cameras.xml", cameras)
    said = check(tmp_path, cameras)
    assert "not aligned, left out: lost" in said
    assert "unit 1000 mm" in said


@pytest.mark.parametrize("unit_mm", [1.0, 10.0, 1000.0])
def test_opencv_a_file_a_camera_and_its_unit_is_guessed(tmp_path, unit_mm):
    cameras = rig((-0.1, 0.03, 0.002, -0.001), "OPENCV")
    for name, camera in cameras.items():
        store = cv2.FileStorage(str(tmp_path / f"{name}.yml"), cv2.FILE_STORAGE_WRITE)
        matrix = camera.calibration.copy()
        matrix[:2, 2] -= 0.5
        store.write("camera_matrix", matrix)
        store.write("distortion_coefficients", np.array(camera.params[4:]))
        store.write("R", cv2.Rodrigues(camera.rotation)[0] if name == "c1" else camera.rotation)
        store.write("T", camera.translation / unit_mm)
        store.release()
    names = {1.0: "millimetres", 10.0: "centimetres", 1000.0: "metres"}
    assert f"unit guessed: {names[unit_mm]}" in check(tmp_path, cameras)


def test_opencv_intri_and_extri(tmp_path):
    cameras = rig()
    intri, extri = (
        cv2.FileStorage(str(tmp_path / f"{part}.yml"), cv2.FILE_STORAGE_WRITE)
        for part in ("intri", "extri")
    )
    for store in (intri, extri):
        store.startWriteStruct("names", cv2.FileNode_SEQ)
        for name in cameras:
            store.write("", name)
        store.endWriteStruct()
    for name, camera in cameras.items():
        matrix = camera.calibration.copy()
        matrix[:2, 2] -= 0.5
        intri.write(f"K_{name}", matrix)
        intri.write(f"dist_{name}", np.zeros((1, 5)))
        extri.write(f"R_{name}", cv2.Rodrigues(camera.rotation)[0])
        extri.write(f"Rot_{name}", camera.rotation)
        extri.write(f"T_{name}", camera.translation.reshape(3, 1))
    intri.release()
    extri.release()
    check(tmp_path, cameras)


def test_nersemble(tmp_path):
    cameras = {name: Camera(name, "PINHOLE", (1500.0, 1490.0, 330.0, 250.0), 640, 480, c.cam_from_world)
               for name, c in rig().items()}  # fmt: skip
    poses = {}
    for name, camera in cameras.items():
        matrix = np.eye(4)
        matrix[:3] = camera.cam_from_world
        matrix[:3, 3] /= 1000
        poses[name] = matrix.tolist()
    k = [[1500.0, 0, 329.5], [0, 1490.0, 249.5], [0, 0, 1]]
    content = {"world_2_cam": poses, "intrinsics": k}
    (tmp_path / "camera_params.json").write_text(json.dumps(content))
    assert "NeRSemble" in check(tmp_path, cameras)


@pytest.mark.parametrize("form", ["KRT", "json"])
def test_multiface(tmp_path, form):
    cameras, lines, entries = rig(), [], {}
    for name, camera in cameras.items():
        matrix = camera.calibration.copy()
        matrix[:2, 2] -= 0.5
        rows = [name] + [" ".join(map(repr, map(float, row))) for row in matrix] + ["0 0 0 0 0"]
        rows += [" ".join(map(repr, map(float, row))) for row in camera.cam_from_world]
        lines += [*rows, ""]
        entries[name] = {"intrin": matrix.tolist(), "extrin": camera.cam_from_world.tolist()}
    if form == "KRT":
        (tmp_path / "KRT").write_text("\n".join(lines))
    else:
        (tmp_path / "KRT.json").write_text(json.dumps({"KRT": entries}))
    check(tmp_path, cameras)


def test_usd_cameras(tmp_path):
    from pxr import Gf, Usd, UsdGeom

    cameras = rig()
    stage = Usd.Stage.CreateNew(str(tmp_path / "rig.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    for name, camera in cameras.items():
        prim, k = UsdGeom.Camera.Define(stage, f"/rig/{name}"), camera.calibration
        per_px = 24.0 / 640
        prim.CreateHorizontalApertureAttr(24.0)
        prim.CreateVerticalApertureAttr(480 * per_px * k[0, 0] / k[1, 1])
        prim.CreateFocalLengthAttr(k[0, 0] * per_px)
        prim.CreateHorizontalApertureOffsetAttr(-(k[0, 2] - 320) * per_px)
        prim.CreateVerticalApertureOffsetAttr((k[1, 2] - 240) * per_px * k[0, 0] / k[1, 1])
        pose = np.eye(4)
        pose[:3, :3] = camera.rotation.T @ np.diag([1.0, -1, -1])
        pose[:3, 3] = camera.centre_mm / 10
        prim.AddTransformOp().Set(Gf.Matrix4d(pose.T.tolist()))
    stage.Save()
    assert "a unit is 10 mm" in check(tmp_path, cameras)


def test_what_is_no_rig_is_one_sentence_that_names_the_file(tmp_path):
    (tmp_path / "a.xml").write_text("<document><chunk/></document>")
    with pytest.raises(InputError, match=r"a\.xml: found .*none is aligned"):
        read_given_cameras(tmp_path, {})
    (tmp_path / "a.xml").unlink()
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError, match=r"found no file of cameras that is known \(notes.txt\)"):
        read_given_cameras(tmp_path, {})
    store = cv2.FileStorage(str(tmp_path / "c0.yml"), cv2.FILE_STORAGE_WRITE)
    store.write("K", np.eye(3))
    store.release()
    with pytest.raises(InputError, match=r"c0\.yml: .*camera c0 lacks R, T"):
        read_given_cameras(tmp_path, {})


def test_cameras_meet_where_they_look():
    assert np.abs(convergence(rig()) - TARGET).max() < 0.01


def test_the_command_says_and_draws_what_it_understood(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_cameras(tmp_path / "rom/cameras", rig())
    for name in rig():
        image = np.full((480, 640, 3), 90, np.uint8)
        write_srgb8(tmp_path / f"rom/frames/{name}/000000.png", image)
    (tmp_path / "takes.tsv").write_text(
        "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\ns1\trom\tplain\trom\t0\t0\t25\tnone\n"
    )
    (tmp_path / "c.yaml").write_text("results: out\ntakes: takes.tsv\n")
    assert report("c.yaml") == 0
    said = capsys.readouterr().out
    assert "COLMAP, 3 cameras" in said
    assert "c1: PINHOLE, 640x480, focal length 1501.0 px" in said
    drawn = cv2.imread(str(tmp_path / "out/cameras/s1-rom.png"))
    # The axes start where the camera's principal point sees the target.
    place = (int(330 * drawn.shape[0] / 480), int(250 * drawn.shape[0] / 480))
    near = drawn[place[1] - 4 : place[1] + 5, place[0] - 4 : place[0] + 5].astype(int)
    assert np.ptp(near, axis=2).max() > 100
