"""The files of a corrected take: every format, on the tracker's mesh and on the full face."""

from __future__ import annotations

import cv2
import numpy as np
import pandas as pd
import pytest
from pxr import Usd, UsdGeom
from scipy.spatial.transform import Rotation

from tests.stages.run_script import run_script
from vermilion.appearance.estimate import Appearance
from vermilion.config.apply import ExportConfig
from vermilion.export.objs import write_obj
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.external.read import read_tracked
from vermilion.faces import procedural
from vermilion.geometry.camera import Camera, look_at
from vermilion.geometry.mesh_files import read_polygons
from vermilion.geometry.polygons import Polygons
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import write_video
from vermilion.scan.landmarks import ScanLandmarks, write_scan_landmarks
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.result import Identity, TrackedTake

pytestmark = pytest.mark.slow

FRAMES, CHUNKS = np.arange(20, 26), ("000020-000022", "000023-000025")
FIGURES = {"novelty": 0.1, "novelty_limit": 1.0, "largest_correction_mm": 1.5}
FILES = {
    "usd": "corrected.usdc", "usd_shapes": "corrected_shapes.usdc", "gltf": "corrected.glb",
    "obj": "obj", "ply": "ply",
}  # fmt: skip


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """A tracked and corrected take of the embedded model on disk; its corrected meshes (6, V, 3)."""
    root = tmp_path_factory.mktemp("take")
    studio, tracker = procedural.studio_model(n_identities=3), procedural.tracker_model(3000, 3)
    studio.save(root / "studio.npz")
    tracker.save(root / "tracker.npz")
    pose = look_at(np.array([0.0, 0, 700]), np.array([0.0, 0, 40]), np.array([0.0, 1, 0]))
    lens = (700.0, 690.0, 165.0, 118.0, -0.05, 0.01, 0.0, 0.0)
    camera = Camera("cam", "OPENCV", lens, 320, 240, pose)
    weights = np.zeros((6, tracker.n_expressions))
    weights[:, tracker.expression_names.index("jawOpen")] = np.linspace(0.1, 0.6, 6)
    turn = Rotation.from_euler("y", np.arange(6.0)[:, None], degrees=True).as_matrix()
    fit = TrackedTake(
        FRAMES, weights, np.array(tracker.expression_names), turn, np.zeros((6, 3)),
        np.ones(6, bool), np.zeros(6), np.array(camera.name), np.array(camera.model),
        np.array(camera.params), np.array([320, 240]), camera.cam_from_world,
    )  # fmt: skip
    fit.save(root / "fit.npz")
    identity = np.array([0.5, -0.5, 0.2])
    neutral = tracker.neutral_of(identity)
    person = Identity(
        identity, neutral, np.zeros((66, 3)), np.array(["t"]), np.ones(1), np.ones(1, bool)
    )
    person.save(root / "identity.npz")
    lips = tracker.regions["vermilion_lower"]
    local = tracker.vertices(identity, weights)
    local[:, lips, 2] += 1.5
    corrected = (local @ np.swapaxes(turn, 1, 2)).astype(np.float32)
    triangle = np.arange(len(tracker.triangles), dtype=np.int32)
    albedo = np.tile(np.array([0.5, 0.3, 0.2]), (1, len(triangle), 1))
    Appearance(
        FRAMES, triangle, np.full((len(triangle), 3), 1 / 3), np.zeros((9, 3)), albedo,
        np.zeros(len(triangle)), np.ones(len(triangle)),
    ).save(root / "appearance.npz")  # fmt: skip
    for chunk, rows in zip(CHUNKS, (slice(0, 3), slice(3, 6)), strict=True):
        write_sequence(root / f"{chunk}.npy", corrected[rows])
        write_video(root / f"{chunk}.mp4", [np.full((48, 64, 3), 90, np.uint8)] * 3, 25.0)
        rows_of_quality = [
            QualityRow(int(frame), True, "", dict(FIGURES)) for frame in FRAMES[rows]
        ]
        write_quality(root / f"{chunk}.tsv", "s1", "t", "apply", rows_of_quality)
    for frame in FRAMES[:-1]:  # the last image is missing
        write_srgb8(root / f"images/{frame:06d}.png", np.full((240, 320, 3), 100, np.uint8))
    for name, shape in (("neutral", 0.0), ("open", tracker.expressions_mm[0])):
        write_obj(root / f"rig/{name}.obj", tracker.neutral_mm + shape, tracker.triangles)
    return root, studio, tracker, corrected


def export(root, out, options, **more):
    names = {
        "corrected": "corrected.npy", "mesh": "mesh.ply", "weights": "weights.csv",
        "overlay": "overlay.mp4", "timeline": "timeline.png", "full": "full.npy",
        "plate": "plate", "albedo": "albedo.png", "live_link": "live_link.csv", "rig": "rig.csv",
        "person": "rig_person.obj", "corrective": "rig_corrective.obj", "on_head": "head.npy", "flame": "flame.npz", **FILES,
    }  # fmt: skip
    run_script(
        "apply/apply_export",
        wildcards={"subject": "s1", "take": "t"},
        params={
            "cfg": {"apply.export": options.model_dump()}, "fps": 25.0,
            "source": str(root / "images"), "neutral": None,
        },
        input={
            **{name: root / f"{name}.npz" for name in ("tracker", "studio", "fit", "identity")},
            "appearance": root / "appearance.npz",
            "rig": root / "rig",
            "corrected": [root / f"{chunk}.npy" for chunk in CHUNKS],
            "overlays": [root / f"{chunk}.mp4" for chunk in CHUNKS],
            "quality": [root / f"{chunk}.tsv" for chunk in CHUNKS],
            **more,
        },
        output={name: out / file for name, file in names.items()},
    )  # fmt: skip


def test_every_format_of_the_trackers_mesh_is_the_corrected_take(take, tmp_path):
    root, _, tracker, corrected = take
    options = ExportConfig(
        formats=list(FILES), plate=True, live_link=True, rig=str(root / "rig"), unit_mm=10.0
    )
    export(root, tmp_path, options)
    for name, file in FILES.items():
        limit = options.tolerance_mm + 1e-3 if name in ("usd_shapes", "gltf") else 2e-4
        back = read_tracked(tmp_path / file, FRAMES)
        assert np.linalg.norm(back.vertices_mm - corrected, axis=2).max() < limit, file
        assert np.array_equal(back.triangles, tracker.triangles), file
    assert len(list((tmp_path / "plate").glob("*.jpg"))) == 5
    table = pd.read_csv(tmp_path / "live_link.csv")
    assert table["Timecode"].iloc[0] == "00:00:00:20.000"
    assert np.all(np.diff(table["JawOpen"]) > 0)
    rig = pd.read_csv(tmp_path / "rig.csv")
    assert rig.columns.tolist() == ["frame", "time_s", "valid", "open", "person", "corrective"]
    assert read_polygons(tmp_path / "rig_corrective.obj")[0].shape == (tracker.n_vertices, 3)
    texture = cv2.imread(str(tmp_path / "albedo.png"))
    assert texture.shape == (1024, 1024, 3)
    assert np.ptp(texture.reshape(-1, 3), axis=0).max() <= 1  # one albedo everywhere


@pytest.mark.parametrize("turned", [False, True])
def test_another_trackers_sequence_goes_back_to_its_own_world_unit_and_polygons(
    take, tmp_path, turned
):
    root, _, tracker, corrected = take
    turn = Rotation.from_euler("xyz", [180, 20, 5], degrees=True).as_matrix()
    placement = Placement(turn, np.array([40.0, -30, 250]), 0.0, False)
    polygons = Polygons.with_quads(tracker.triangles)
    origin = Origin(1000.0, "z" if turned else "y", turned, polygons, 500)
    placement.save(tmp_path / "placement.npz")
    origin.save(tmp_path / "origin.npz")
    own = {name: tmp_path / f"{name}.npz" for name in ("placement", "origin")}
    export(root, tmp_path, ExportConfig(formats=list(FILES)), **own)
    wanted = origin.in_file(placement.undo(corrected))  # metres
    for name, file in FILES.items():
        limit = 2.1e-5 if name in ("usd_shapes", "gltf") else 1e-6
        back = read_tracked(tmp_path / file, FRAMES, 1000.0)
        off = np.linalg.norm(back.vertices_mm / 1000.0 - wanted, axis=2)
        assert off.max() < limit, file
        if name != "gltf":  # which has triangles alone
            assert np.array_equal(back.polygons.counts, polygons.counts), file
            assert np.array_equal(back.polygons.corners, polygons.corners), file
    stage = Usd.Stage.Open(str(tmp_path / FILES["usd"]))
    assert UsdGeom.GetStageUpAxis(stage) == ("Z" if turned else "Y")
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    # The world of the capture is that of corrected.npy, as for every base.
    assert np.array_equal(np.load(tmp_path / "corrected.npy"), corrected)


def flame_base(root, tracker, origin, placement):
    """The track of `take` as parameters of a model that has the tracker's expressions: files and arguments."""
    fit, person = TrackedTake.load(root / "fit.npz"), Identity.load(root / "identity.npz")
    rest, count = person.neutral_mm / 1000.0, tracker.n_vertices
    shapes = np.zeros((count, 3, 300 + tracker.n_expressions))
    shapes[..., 300:] = np.moveaxis(tracker.expressions_mm, 0, 2) / 1000.0
    joints, skinning = np.zeros((5, count)), np.zeros((count, 5))
    joints[:, 0], skinning[:, 1] = 1.0, 1.0
    np.savez(
        root / "flame_model.npz", v_template=rest, f=tracker.triangles, shapedirs=shapes,
        posedirs=np.zeros((count, 3, 36)), J_regressor=joints, weights=skinning,
        kintree_table=np.array([[0, 0, 1, 1, 1]]),
    )  # fmt: skip
    into = origin.axes @ placement.rotation.T
    turns = into @ fit.world_from_head_rotation
    moved = rest[0] + (shapes[0, :, 300:] @ fit.weights.T).T  # the root, in each frame
    places = np.einsum("fij,fj->fi", turns, moved) - moved - into @ placement.translation_mm / 1000
    np.savez(
        root / "parameters.npz", shape=np.zeros(10), expr=fit.weights, jaw_pose=np.zeros((6, 3)),
        rotation=Rotation.from_matrix(turns).as_rotvec(), translation=places, frames=FRAMES,
    )  # fmt: skip
    return {"parameters": root / "parameters.npz", "flame_model": root / "flame_model.npz"}


@pytest.mark.parametrize("turned", [False, True])
def test_parameters_of_flame_come_out_for_the_corrected_lips(take, tmp_path, capsys, turned):
    root, _, tracker, corrected = take
    turn = Rotation.from_euler("xyz", [180, 20, 5], degrees=True).as_matrix()
    placement = Placement(turn, np.array([40.0, -30, 250]), 0.0, False)
    polygons = Polygons.of_triangles(tracker.triangles)
    origin = Origin(1000.0, "z" if turned else "y", turned, polygons, 20)
    placement.save(tmp_path / "placement.npz")
    origin.save(tmp_path / "origin.npz")
    own = {name: tmp_path / f"{name}.npz" for name in ("placement", "origin")}
    own |= flame_base(root, tracker, origin, placement)
    wanted = origin.in_file(placement.undo(corrected))  # metres
    lips = tracker.regions["vermilion_upper"] | tracker.regions["vermilion_lower"]

    def off_mm(path):
        back = read_tracked(path, FRAMES, 1000.0, flame=own["flame_model"]).vertices_mm
        return np.linalg.norm(back - 1000 * wanted, axis=2)[:, lips].mean()

    assert off_mm(own["parameters"]) > 0.5  # the track, without the correction
    export(root, tmp_path, ExportConfig(formats=[], flame=True), **own)
    assert off_mm(tmp_path / "flame.npz") < 0.02
    assert "FLAME, 6 frames: off over the lips" in capsys.readouterr().out


@pytest.fixture(scope="module")
def own_head(take):
    """The person's head as a file of a unit of 10 mm: the studio's topology with quads and texture seams."""
    root, studio, _, _ = take
    polygons = Polygons.with_quads(studio.triangles)
    vertices = 0.1 * studio.neutral_of(np.array([0.5, -0.5, 0.2])) + [1.0, 150.0, 0.0]
    seams = np.where(studio.neutral_mm[polygons.corners, 0] < 0, studio.n_vertices, 0)
    uv = np.concatenate([0.5 * studio.uv, 0.5 * studio.uv + 0.5])
    write_obj(root / "own_head.obj", vertices, polygons, uv, polygons.corners + seams)
    write_scan_landmarks(
        root / "marks.tsv", ScanLandmarks(vertices[studio.landmarks], np.zeros(66))
    )
    run_script(
        "apply/export_head",
        wildcards={"subject": "s1"},
        params={
            "cfg": {
                "face_model.template_slight_open": 0.09, "landmarks.detector": "files",
                "landmarks.networks": {},
            }
        },
        input={
            "tracker": root / "tracker.npz", "head": root / "own_head.obj",
            "landmarks": root / "marks.tsv",
        },
        output={
            "binding": root / "binding.npz", "labels": root / "labels.npz",
            "landmarks": root / "landmarks.tsv", "overlay": root / "head.png",
        },
    )  # fmt: skip
    files = {"head": root / "own_head.obj"}
    return files | {name: root / f"{name}.npz" for name in ("binding", "labels")}, polygons


def test_every_format_carries_the_users_own_head(take, own_head, tmp_path, capsys):
    root, studio, tracker, corrected = take
    files, polygons = own_head
    rest, _ = read_polygons(files["head"])
    rig = tmp_path / "rig"
    write_obj(rig / "neutral.obj", rest, polygons)
    jaw = studio.expressions_mm[studio.expression_names.index("jawOpen")]
    write_obj(rig / "open.obj", rest + 0.1 * jaw, polygons)
    options = ExportConfig(
        formats=list(FILES), topology=str(files["head"]), unit_mm=10.0, rig=str(rig)
    )
    export(root, tmp_path, options, **files, rig=rig)
    whole = np.load(tmp_path / "head.npy")
    assert whole.shape == (6, studio.n_vertices, 3)
    for name, file in FILES.items():
        limit = options.tolerance_mm + 1e-3 if name in ("usd_shapes", "gltf") else 2e-4
        back = read_tracked(tmp_path / file, FRAMES)
        assert np.linalg.norm(back.vertices_mm - whole, axis=2).max() < limit, file
        if name != "gltf":  # which has triangles alone
            assert np.array_equal(back.polygons.corners, polygons.corners), file
    stage = Usd.Stage.Open(str(tmp_path / FILES["usd"]))
    st = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Face/corrected")).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    lips = [model.regions["vermilion_lower"] for model in (studio, tracker)]
    means = [
        mesh[:, mask].mean(axis=1) for mesh, mask in zip((whole, corrected), lips, strict=True)
    ]
    assert np.abs(means[0] - means[1]).max() < 1.0
    # The rig stands in the file's unit: its jaw opens as the head's does.
    weights = pd.read_csv(tmp_path / "rig.csv")["open"].to_numpy()
    assert np.abs(np.diff(weights) - 0.1).max() < 0.03
    assert "a unit of" in capsys.readouterr().out
    shown, _ = read_polygons(tmp_path / "rig_corrective.obj")
    assert np.linalg.norm(shown - rest, axis=1).max() < 1.0


def test_the_users_head_stands_in_another_trackers_world_and_unit(take, own_head, tmp_path):
    root = take[0]
    turn = Rotation.from_euler("xyz", [180, 20, 5], degrees=True).as_matrix()
    placement = Placement(turn, np.array([40.0, -30, 250]), 0.0, False)
    origin = Origin(1000.0, "y", False, Polygons.of_triangles(take[2].triangles), 500)
    placement.save(tmp_path / "placement.npz")
    origin.save(tmp_path / "origin.npz")
    files = own_head[0] | {name: tmp_path / f"{name}.npz" for name in ("placement", "origin")}
    export(root, tmp_path, ExportConfig(formats=["usd"], topology="own_head.obj"), **files)
    whole = np.load(tmp_path / "head.npy")
    back = read_tracked(tmp_path / FILES["usd"], FRAMES)
    wanted = origin.in_file(placement.undo(whole)) * 1000.0
    assert np.linalg.norm(back.vertices_mm - wanted, axis=2).max() < 1e-3
    assert np.array_equal(back.polygons.corners, own_head[1].corners)


def test_the_full_face_has_the_corrected_lips_and_its_own_topology(take, tmp_path):
    root, studio, tracker, corrected = take
    export(root, tmp_path, ExportConfig(formats=["usd", "usd_shapes", "gltf"], topology="full"))
    whole = np.load(tmp_path / "full.npy")
    assert whole.shape == (6, studio.n_vertices, 3)
    for name in ("usd", "usd_shapes", "gltf"):
        back = read_tracked(tmp_path / FILES[name], FRAMES)
        assert np.linalg.norm(back.vertices_mm - whole, axis=2).max() < 0.03
    lips = [model.regions["vermilion_lower"] for model in (studio, tracker)]
    means = [
        mesh[:, mask].mean(axis=1) for mesh, mask in zip((whole, corrected), lips, strict=True)
    ]
    assert np.abs(means[0] - means[1]).max() < 1.0
