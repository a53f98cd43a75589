"""The tracking stage from landmark files to meshes in the world."""

import json
import shutil

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.synthetic_face import synthetic_model
from tests.unit.test_tracking_motion import true_motion
from vermilion.config.tracking import MeshesConfig, TrackingConfig
from vermilion.geometry.camera import look_at, pinhole, write_cameras
from vermilion.geometry.mesh_files import read_mesh
from vermilion.imaging.images import read_image, write_image
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.result import Identity, TrackedTake

N_FRAMES = 12
MODEL = synthetic_model()
PERSON = np.array([0.8, -0.5, 0.4, 0.6])
#: Not the world's frame, so that a forgotten camera pose would show.
CAMERA = pinhole(
    "cam",
    1400.0,
    640,
    480,
    look_at(np.array([60.0, 30, 650]), np.array([0.0, 10, 60]), np.array([0.0, 1, 0])),
)


def true_meshes():
    """(F, V, 3) world; the first third of a second of a head's ordinary motion."""
    rotation, translation, weights = (part[:N_FRAMES].copy() for part in true_motion(40))
    weights[0] = 0.0
    local = MODEL.vertices(PERSON, weights) @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    return (local - CAMERA.translation) @ CAMERA.rotation


def run_stage(root, sizes, missing=()):
    """Run identity, tracking and meshes with chunks of these sizes; returns C, joined."""
    truth = true_meshes()
    tracker, landmarks, chunks = root / "tracker.npz", [], []
    MODEL.save(tracker)
    write_cameras(root / "cameras", {"cam": CAMERA})
    (root / "cameras.json").write_text(json.dumps({"calibrated": True}))
    images = [root / "frames" / "cam" / f"{frame:06d}.png" for frame in range(N_FRAMES)]
    write_image(images[0], np.full((480, 640, 3), 0.2))
    for other in images[1:]:
        shutil.copy(images[0], other)
    for first, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        frames = np.arange(first, first + size)
        valid = ~np.isin(frames, missing)
        points = np.where(valid[:, None, None], CAMERA.project(truth[frames]), np.nan)
        path = root / f"landmarks{first}.npz"
        LandmarkTrack(frames, points, np.full((size, 66), 0.9), valid).save(path)
        landmarks.append(path)
        chunks.append(frames)
    cfg = TrackingConfig(meshes=MeshesConfig(overlay_frames=1)).model_dump(mode="json")
    cfg = {f"tracking.{key}": value for key, value in cfg.items()}
    take = {"take": "t", "camera": "cam", "neutral": 0, "chunks": len(sizes)}
    names = {"subject": "s", "take": "t"}
    run_script(
        "tracking/identity",
        wildcards={"subject": "s"},
        params={"cfg": cfg, "takes": [take]},
        input={
            "tracker": tracker,
            "landmarks": landmarks,
            "cameras": [root / "cameras"],
            "calibration": [root / "cameras.json"],
        },
        output={"identity": root / "identity.npz"},
    )
    both = {"tracker": tracker, "identity": root / "identity.npz"}
    run_script(
        "tracking/tracking",
        wildcards=names,
        params={"cfg": cfg, "camera": "cam", "fps": 30.0},
        input=both | {"landmarks": landmarks, "cameras": root / "cameras"},
        output={"fit": root / "fit.npz"},
    )
    for frames, path in zip(chunks, landmarks, strict=True):
        name = f"{frames[0]:06d}"
        run_script(
            "tracking/tracking_meshes",
            wildcards=names,
            params={"cfg": cfg, "source": str(root), "frames": [int(f) for f in frames]},
            input=both | {"fit": root / "fit.npz", "landmarks": path},
            output={
                "meshes": root / "C" / f"{name}.npy",
                "quality": root / f"{name}.tsv",
                "overlay": root / f"{name}.png",
            },
        )
    return read_sequence(sorted((root / "C").glob("*.npy")))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    root = tmp_path_factory.mktemp("tracking")
    return root, run_stage(root, [12])


def test_meshes_lie_in_the_world_where_the_landmarks_came_from(results):
    _, meshes = results
    truth = true_meshes()
    missed = np.linalg.norm(CAMERA.project(meshes) - CAMERA.project(truth), axis=-1)
    assert np.median(missed) < 3.0  # px, of an inter-ocular distance of 180
    # Depth is open in one camera; what is left after a similarity is the shape's error.
    size = np.linalg.norm(meshes - meshes.mean(axis=1, keepdims=True), axis=(1, 2))
    true_size = np.linalg.norm(truth - truth.mean(axis=1, keepdims=True), axis=(1, 2))
    assert np.abs(size / true_size - 1).max() < 0.05


def test_files_agree_with_each_other(results):
    root, meshes = results
    fit, person = TrackedTake.load(root / "fit.npz"), Identity.load(root / "identity.npz")
    again = fit.vertices_mm(MODEL, person, fit.index_of(range(N_FRAMES)))
    assert np.abs(again - meshes).max() < 1e-3  # mm
    assert list(fit.expression_names) == list(MODEL.expression_names)
    assert fit.weights.min() >= 0 and fit.weights.max() <= 1
    assert person.neutral_mm.shape == MODEL.neutral_mm.shape
    assert person.focal_of("t") is None
    assert np.allclose(fit.camera.cam_from_world, CAMERA.cam_from_world)
    assert read_image(root / "000000.png").shape[1] > 400


def test_meshes_do_not_depend_on_chunks(results, tmp_path):
    _, whole = results
    assert np.abs(run_stage(tmp_path, [5, 4, 3]) - whole).max() < 0.01  # mm


def test_frames_without_landmarks_are_flagged_and_interpolated(results, tmp_path):
    _, whole = results
    meshes = run_stage(tmp_path, [12], missing=(6,))
    quality = read_table(tmp_path / "000000.tsv")
    assert list(quality["frame"][quality["valid"] == 0]) == [6]
    assert "interpolated" in quality["reason"][6]
    assert np.linalg.norm(meshes[6] - whole[6], axis=-1).mean() < 12.0  # mm, of a quick motion


CFG_EXTERNAL = {f"tracking.external.{key}": None for key in ("unit_mm", "up", "mesh", "flame")}


def test_topology_and_sequences_of_other_trackers(results, tmp_path):
    _, meshes = results
    run_script(
        "external/tracked_topology",
        wildcards={"subject": "s", "take": "t"},
        params={"cfg": CFG_EXTERNAL, "frames": [-1, 3, 4], "fps": 25.0},
        input={"source": _archive(tmp_path, meshes)},
        output={"topology": tmp_path / "topology.ply", "sequence": tmp_path / "sequence.npz"},
    )
    assert np.array_equal(read_mesh(tmp_path / "topology.ply").triangles, MODEL.triangles)
    read, quality = read_chunk(tmp_path, [3, 4, 500])
    assert np.array_equal(read[:2], meshes[3:5])
    assert np.isnan(read[2]).all()
    assert quality["valid"].tolist() == [1, 1, 0]
    assert "not in other.npz; export this frame again" in quality["reason"].iloc[2]


def test_a_chunk_without_a_mesh_loses_its_frames_alone(results, tmp_path):
    _, meshes = results
    run_script(
        "external/tracked_topology",
        wildcards={"subject": "s", "take": "t"},
        params={"cfg": CFG_EXTERNAL, "frames": [3], "fps": 25.0},
        input={"source": _archive(tmp_path, meshes)},
        output={"topology": tmp_path / "topology.ply", "sequence": tmp_path / "sequence.npz"},
    )
    read, quality = read_chunk(tmp_path, [500, 501])
    assert read.shape == (2, *meshes.shape[1:]) and np.isnan(read).all()
    assert quality["valid"].tolist() == [0, 0]


def read_chunk(folder, frames):
    """Meshes and quality rows of a chunk of the archive."""
    run_script(
        "external/tracked_meshes",
        wildcards={"subject": "s", "take": "t"},
        params={"cfg": CFG_EXTERNAL, "frames": frames, "fps": 25.0},
        input={"source": folder / "other.npz", "sequence": folder / "sequence.npz"},
        output={"meshes": folder / "C.npy", "quality": folder / "quality.tsv"},
    )
    return read_sequence(folder / "C.npy"), read_table(folder / "quality.tsv")


def _archive(folder, meshes):
    path = folder / "other.npz"
    np.savez(path, vertices_mm=meshes, triangles=MODEL.triangles)
    return path
