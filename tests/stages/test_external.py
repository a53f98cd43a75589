"""A foreign sequence from its files to C in the capture's world, and back, script by script."""

import json

import numpy as np
import pandas as pd
import pytest

from benchmarks.foreign_tracker import ForeignTracker, write_objs
from tests.heads import SLIGHTLY_OPEN, small_studio, small_tracker
from tests.stages.run_script import run_script
from vermilion.config.tracking import ExternalBaseConfig
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import look_at, pinhole, write_cameras
from vermilion.imaging.images import read_image, write_image
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.result import Identity, TrackedTake

N_FRAMES, LOST = 10, 6
CHUNKS = ("000000-000005", "000006-000009")
CAMERA = pinhole(
    "cam", 1200.0, 320, 400,
    look_at(np.array([80.0, 20, 750]), np.array([0.0, -20, 60]), np.array([0.0, 1, 0])),
)  # fmt: skip
READING = {"tracking.external.unit_mm": None, "tracking.external.up": None}
READING |= {"tracking.external.mesh": None, "tracking.external.flame": None}
PLACE = {"subject": "s", "take": "shot_ft"}


def truth_of(studio, person):
    """A mouth that opens and smiles under a head that turns, world (F, V, 3); its neutral."""
    weights = np.zeros((N_FRAMES, studio.n_expressions))
    time = np.arange(N_FRAMES)
    weights[:, studio.expression_names.index("jawOpen")] = SLIGHTLY_OPEN + 0.3 * (time % 5) / 4
    weights[:, studio.expression_names.index("mouthSmile_L")] = 0.1 * (time % 4)
    return studio.vertices(person, weights)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A sequence of OBJ files with a missing frame, landmarks, images and a camera."""
    root, studio = tmp_path_factory.mktemp("external"), small_studio()
    person = np.array([0.5, -0.6, 0.8, 0.3])
    truth = truth_of(studio, person)
    tracker = ForeignTracker.of(studio, 7000)
    meshes, weights, names = tracker.track(truth, studio.neutral_of(person), CAMERA, 1, 2)
    write_objs(root / "meshes", meshes, tracker.triangles, 0)
    (root / f"meshes/head.{LOST:04d}.obj").unlink()
    table = pd.DataFrame(weights, columns=names)
    table.insert(0, "frame", np.arange(N_FRAMES))
    table.to_csv(root / "weights.csv", index=False)
    small_tracker().save(root / "tracker.npz")
    points = CAMERA.project(truth[:, studio.landmarks])
    for chunk in CHUNKS:
        first, last = map(int, chunk.split("-"))
        frames = np.arange(first, last + 1)
        LandmarkTrack(
            frames, points[frames], np.ones((len(frames), 66)), np.ones(len(frames), bool)
        ).save(root / f"landmarks/{chunk}.npz")
        for frame in frames:
            write_image(root / f"frames/cam/{frame:06d}.png", np.full((400, 320, 3), 0.2))
    rows = [
        f"{k}\t{x:.6f}\t{y:.6f}\t{z:.6f}"
        for k, (x, y, z) in enumerate(landmarks_of_file(tracker, meshes[0], studio))
    ]
    (root / "points.tsv").write_text("landmark\tx\ty\tz\n" + "\n".join(rows) + "\n")
    write_cameras(root / "cameras", {"cam": CAMERA})
    (root / "cameras.json").write_text(json.dumps({"calibrated": True}))
    return root, tracker, meshes


def landmarks_of_file(tracker, mesh, studio):
    """The nearest vertices to the studio's landmarks, in the sequence's own frame, mm."""
    near = np.linalg.norm(
        tracker.sample(studio.neutral_mm)[:, None] - studio.neutral_mm[studio.landmarks], axis=2
    )
    return 1000.0 * mesh[near.argmin(axis=0)]


def base(**options):
    return {"tracking.external.base": ExternalBaseConfig(**options).model_dump()}


@pytest.fixture(scope="module", params=[False, True], ids=["modes", "weights"])
def finished(scene, request):
    """All scripts, with and without the tracker's own weights; the folder of their results."""
    root, _, _ = scene
    out = root / ("weights" if request.param else "modes")
    out.mkdir()
    weights = str(root / "weights.csv") if request.param else None
    run_script(
        "external/tracked_topology", wildcards=PLACE,
        params={"cfg": READING, "frames": range(N_FRAMES), "fps": 30.0},
        input={"source": root / "meshes"},
        output={"topology": out / "topology.ply", "sequence": out / "sequence.npz"},
    )  # fmt: skip
    for chunk in CHUNKS:
        first, last = map(int, chunk.split("-"))
        run_script(
            "external/tracked_meshes", wildcards={**PLACE, "chunk": chunk},
            params={"cfg": READING, "frames": range(first, last + 1), "fps": 30.0},
            input={"source": root / "meshes", "sequence": out / "sequence.npz"},
            output={"meshes": out / f"own/{chunk}.npy", "quality": out / f"own/{chunk}.tsv"},
        )  # fmt: skip
    own = [out / f"own/{chunk}.npy" for chunk in CHUNKS]
    run_script(
        "external/external_topology",
        params={
            "cfg": {"face_model.template_slight_open": SLIGHTLY_OPEN},
            "take": PLACE, "frame": 0,
        },
        input={
            "tracker": root / "tracker.npz", "coarse": own[0], "topology": out / "topology.ply",
            "landmarks": root / "points.tsv",
        },
        output={
            "topology": out / "labels.npz", "landmarks": out / "found.tsv",
            "overlay": out / "labels.png",
        },
    )  # fmt: skip
    take = {
        **PLACE, "frames": list(range(N_FRAMES)), "neutral": 0, "chunks": 2, "weights": weights,
        "first": 0, "fps": 30.0,
    }  # fmt: skip
    run_script(
        "external/external_model", params={"cfg": base(weights=weights), "takes": [take]},
        input={"topology": out / "labels.npz", "coarse": own, "neutrals": [own[0]]},
        output={"model": out / "external.npz"},
    )  # fmt: skip
    run_script(
        "external/external_identity", wildcards={"subject": "s"},
        params={"take": "shot_ft", "frame": 0},
        input={"model": out / "external.npz", "coarse": own[0]},
        output={"identity": out / "identity.npz"},
    )  # fmt: skip
    run_script(
        "external/external_fit", wildcards={"subject": "s", "take": "shot"},
        params={
            "cfg": base(weights=weights) | {"tracking.motion.max_reprojection": 0.12},
            "camera": "cam", "fps": 30.0,
        },
        input={
            "tracker": out / "external.npz", "identity": out / "identity.npz", "coarse": own,
            "landmarks": [root / f"landmarks/{chunk}.npz" for chunk in CHUNKS],
            "cameras": root / "cameras", "calibration": root / "cameras.json",
            **({"weights": weights} if weights else {}),
        },
        output={"fit": out / "fit.npz", "placement": out / "placement.npz"},
    )  # fmt: skip
    for chunk in CHUNKS:
        first, last = map(int, chunk.split("-"))
        run_script(
            "external/external_meshes",
            wildcards={"subject": "s", "take": "shot", "chunk": chunk},
            params={
                "cfg": {"tracking.meshes": {"overlay_frames": 2}}, "source": str(root),
                "frames": range(first, last + 1),
            },
            input={
                "tracker": out / "external.npz", "identity": out / "identity.npz",
                "fit": out / "fit.npz", "placement": out / "placement.npz",
                "coarse": out / f"own/{chunk}.npy", "quality": out / f"own/{chunk}.tsv",
                "landmarks": root / f"landmarks/{chunk}.npz",
            },
            output={
                "meshes": out / f"C/{chunk}.npy", "quality": out / f"C/{chunk}.tsv",
                "overlay": out / f"C/{chunk}.png",
            },
        )  # fmt: skip
    return out


@pytest.mark.slow
def test_c_lies_on_the_face_and_goes_back_to_the_files(scene, finished):
    root, tracker, meshes = scene
    coarse = read_sequence([finished / f"C/{chunk}.npy" for chunk in CHUNKS])
    model, fit = FaceModel.load(finished / "external.npz"), TrackedTake.load(finished / "fit.npz")
    assert np.array_equal(model.triangles, tracker.triangles)
    pixels = CAMERA.project(coarse[:, model.landmarks].astype(float))
    track = LandmarkTrack.load([root / f"landmarks/{chunk}.npz" for chunk in CHUNKS])
    away = np.linalg.norm(pixels - track.points_px, axis=2)[:, 17:48]
    assert np.median(away) < 3.0  # px, of an inter-ocular distance of 150
    placement = Placement.load(finished / "placement.npz")
    origin = Origin.load(finished / "sequence.npz")
    assert not placement.as_given and origin.unit_mm == 1000.0
    back = origin.in_file(placement.undo(coarse))
    kept = np.arange(N_FRAMES) != LOST
    assert np.abs(back[kept] - meshes[kept]).max() < 1e-6  # metres
    neutral = Identity.load(finished / "identity.npz").neutral_mm
    assert np.abs(neutral - model.neutral_mm).max() < 1e-6
    assert fit.weights.min() >= 0.0 and fit.weights.max() <= 1.0
    local = fit.vertices_mm(model, Identity.load(finished / "identity.npz"), np.arange(N_FRAMES))
    assert np.linalg.norm(local - coarse, axis=2)[kept].mean() < 1.0  # mm: what the space leaves


@pytest.mark.slow
def test_the_missing_frame_is_lost_alone(finished):
    fit = TrackedTake.load(finished / "fit.npz")
    assert np.flatnonzero(~fit.valid).tolist() == [LOST]
    table = read_table(finished / f"C/{CHUNKS[1]}.tsv")
    assert table["valid"].tolist() == [0, 1, 1, 1]
    assert "no mesh: not in meshes; export this frame again" in table["reason"][0]
    assert np.isfinite(read_sequence(finished / f"C/{CHUNKS[1]}.npy")).all()


@pytest.mark.slow
def test_overlays_show_something(finished):
    for path in (finished / "labels.png", finished / f"C/{CHUNKS[0]}.png"):
        assert read_image(path).std() > 0.02


@pytest.mark.slow
def test_another_topology_in_one_run_is_refused(scene, finished, tmp_path):
    meshes = read_sequence(finished / f"own/{CHUNKS[0]}.npy")[:, :-5]
    np.save(tmp_path / f"{CHUNKS[0]}.npy", meshes)
    with pytest.raises(InputError, match=r"take other, frame 0: found a mesh of \d+ vertices"):
        run_script(
            "external/external_identity", wildcards={"subject": "s2"},
            params={"take": "other", "frame": 0},
            input={"model": finished / "external.npz", "coarse": tmp_path / f"{CHUNKS[0]}.npy"},
            output={"identity": tmp_path / "identity.npz"},
        )  # fmt: skip
