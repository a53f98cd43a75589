"""From meshes to corrected lips: correspondence, layers, database, training, on two people."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.stages.lip_scene import (
    BAD_FRAME,
    CHUNKS,
    LOST,
    N_FRAMES,
    TEST,
    TRAIN,
    models,
    write_subject,
)
from tests.stages.run_script import run_script
from vermilion.config.correction import LayersConfig
from vermilion.config.correspondence import CorrespondenceConfig
from vermilion.config.database import DatabaseConfig
from vermilion.config.multiview import LostConfig
from vermilion.config.training import TrainingConfig
from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.correct import CorrectionSettings, correct, correct_with_layers
from vermilion.correspondence.correspondence import Correspondence
from vermilion.database.read import LipDatabase
from vermilion.geometry.alignment import similarity_alignment
from vermilion.geometry.mesh import vertex_areas
from vermilion.regression.model import load_model
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.result import Identity, TrackedTake

pytestmark = pytest.mark.slow
SUBJECTS = ("ana", "bo")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Everything up to trained regressors, under one results folder."""
    root = tmp_path_factory.mktemp("results")
    accurate, tracker = models()
    accurate.save(root / "face/template.npz")
    tracker.save(root / "face/tracker.npz")
    features, truth = {}, {}
    for seed, subject in enumerate(SUBJECTS, start=1):
        features[subject], truth[subject] = write_subject(root, subject, accurate, tracker, seed)
        run_correspondence(root, subject)
        for chunk in CHUNKS:
            run_layers(root, subject, chunk)
        run_neutral_pair(root, subject)
    run_database(root)
    for regressor in ("PS-ana", "MS", "GR-ana", "MS-affine", "MS-shape-only"):
        run_train(root, regressor)
    return SimpleNamespace(root=root, features=features, truth=truth, tracker=tracker)


def run_correspondence(root, subject):
    take = root / f"takes/{subject}/rom"
    run_script(
        "correspondence/correspondence",
        wildcards={"subject": subject},
        params={"cfg": {"correspondence": CorrespondenceConfig().model_dump()}, "take": "rom"},
        input={
            "template": root / "face/template.npz",
            "tracker": root / "face/tracker.npz",
            "accurate": take / "multiview/neutral.npz",
            "coarse": take / f"tracking/C/{CHUNKS[0]}.npy",
            "fit": take / "tracking/fit.npz",
            "landmarks": take / f"landmarks/{CHUNKS[0]}.npz",
            "image": take / f"inpaint/{CHUNKS[0]}",
        },
        output={
            "correspondence": root / f"subjects/{subject}/correspondence.npz",
            "quality": root / f"subjects/{subject}/correspondence/quality/neutral.tsv",
            "overlay": root / f"subjects/{subject}/correspondence/overlay/neutral.png",
        },
    )


def run_layers(root, subject, chunk):
    take = root / f"takes/{subject}/rom"
    first, last = (int(n) for n in chunk.split("-"))
    run_script(
        "correction/layers",
        wildcards={"subject": subject, "take": "rom", "chunk": chunk},
        params={
            "cfg": {
                "correction.layers": LayersConfig().model_dump(),
                "multiview.lost": LostConfig().model_dump(),
            },
            "frames": list(range(first, last + 1)),
        },
        input={
            "accurate": take / f"multiview/H/{chunk}.npy",
            "accurate_quality": take / f"multiview/quality/{chunk}.tsv",
            "drift": [take / f"multiview/drift/{c}.tsv" for c in CHUNKS],
            "accurate_neutral": take / "multiview/neutral.npz",
            "coarse": take / f"tracking/C/{chunk}.npy",
            "fit": take / "tracking/fit.npz",
            "correspondence": root / f"subjects/{subject}/correspondence.npz",
            "tracker": root / "face/tracker.npz",
        },
        output={
            "layers": take / f"correction/layers/{chunk}.npz",
            "quality": take / f"correction/quality/{chunk}.tsv",
            "overlay": take / f"correction/overlay/{chunk}.png",
        },
    )


def run_neutral_pair(root, subject):
    person, take = root / f"subjects/{subject}", root / f"takes/{subject}/rom"
    run_script(
        "correction/neutral_pair",
        wildcards={"subject": subject, "take": "rom"},
        params={"cfg": {"correction.layers": LayersConfig().model_dump()}, "frame": 0},
        input={
            "template": root / "face/template.npz",
            "tracker": root / "face/tracker.npz",
            "accurate": take / "multiview/neutral.npz",
            "coarse": [take / f"tracking/C/{CHUNKS[0]}.npy"],
            "fit": take / "tracking/fit.npz",
            "features": [take / f"features/{CHUNKS[0]}.npz"],
            "correspondence": person / "correspondence.npz",
            "identity": person / "identity.npz",
        },
        output={
            "pair": take / "correction/neutral_pair.npz",
            "overlay": take / "correction/overlay/neutral_pair.png",
        },
    )  # fmt: skip


def run_database(root):
    chunk_files = [root / f"takes/{s}/rom/correction" for s in SUBJECTS]
    run_script(
        "database/database",
        params={
            "cfg": {"database": DatabaseConfig().model_dump()},
            "subjects": list(SUBJECTS),
            "takes": [
                {
                    "subject": subject,
                    "take": "rom",
                    "fps": 30.0,
                    "split": f"test:{TEST[0]}-{TEST[-1]}",
                    "train": list(TRAIN),
                    "chunks": len(CHUNKS),
                }
                for subject in SUBJECTS
            ],
        },
        input={
            "layers": [f / f"layers/{c}.npz" for f in chunk_files for c in CHUNKS],
            "features": [
                root / f"takes/{s}/rom/features/{c}.npz" for s in SUBJECTS for c in CHUNKS
            ],
            "correspondence": [root / f"subjects/{s}/correspondence.npz" for s in SUBJECTS],
            "identity": [root / f"subjects/{s}/identity.npz" for s in SUBJECTS],
            "neutral_pair": [f / "neutral_pair.npz" for f in chunk_files],
        },
        output={"database": root / "database/lips.h5"},
    )


def run_train(root, regressor):
    run_script(
        "training/train",
        wildcards={"regressor": regressor},
        params={"cfg": {"training": TrainingConfig().model_dump()}},
        input={"database": root / "database/lips.h5"},
        output={
            "model": root / f"models/{regressor}.h5",
            "curve": root / f"models/{regressor}.cv.tsv",
            "image": root / f"models/{regressor}.cv.png",
        },
    )


def errors(scene, subject, corrected, frames):
    """Mean vertex error (mm) over the mask after one rigid alignment on the rest of the face."""
    correspondence = Correspondence.load(scene.root / f"subjects/{subject}/correspondence.npz")
    coarse = coarse_of(scene, subject)
    target = correspondence.on_coarse(scene.truth[subject])
    triangles = correspondence.coarse_triangles
    in_mask = np.zeros(len(target[0]), dtype=bool)
    in_mask[triangles[correspondence.mask]] = True
    area = vertex_areas(correspondence.coarse_neutral_mm, triangles)
    rest = correspondence.vertices.bound & ~in_mask & scene.tracker.regions["face"]
    result = []
    for frame in frames:
        placed = similarity_alignment(
            coarse[frame][rest], target[frame][rest], area[rest], scale=1.0
        )
        offset = placed.apply(corrected[frame]) - target[frame]
        distance = np.linalg.norm(offset[in_mask], axis=1)
        result.append(np.average(distance, weights=area[in_mask]))
    return float(np.mean(result))


def coarse_of(scene, subject):
    folder = scene.root / f"takes/{subject}/rom/tracking/C"
    return read_sequence([folder / f"{c}.npy" for c in CHUNKS]).astype(np.float64)


def take_of(scene, subject):
    """All frames of a subject's take, without images."""
    fit = TrackedTake.load(scene.root / f"takes/{subject}/rom/tracking/fit.npz")
    neutral = Correspondence.load(scene.root / f"subjects/{subject}/correspondence.npz")
    identity = scene.root / f"subjects/{subject}/identity.npz"
    return CoarseTake(
        fit.frames, coarse_of(scene, subject), neutral.coarse_triangles,
        Identity.load(identity).neutral_mm, fit.world_from_head_rotation,
        fit.world_from_head_translation_mm, scene.features[subject], fit.valid,
    )  # fmt: skip


def corrected_by(scene, subject, regressor):
    model = load_model(scene.root / f"models/{regressor}.h5")
    take = take_of(scene, subject)
    return correct(model, take, CorrectionSettings(16.0, 0.0, 0, 0.0, None))


def corrected_by_truth(scene, subject):
    mask = Correspondence.load(scene.root / f"subjects/{subject}/correspondence.npz").mask
    folder = scene.root / f"takes/{subject}/rom/correction/layers"
    layers = np.concatenate([np.load(folder / f"{c}.npz")["layers"] for c in CHUNKS])
    take = take_of(scene, subject)
    return correct_with_layers(
        mask, layers, None, take, CorrectionSettings(16.0, 0.0, 0, 0.0, None)
    )


def test_correspondence_covers_the_mouth_and_is_near(scene):
    for subject in SUBJECTS:
        row = read_table(scene.root / f"subjects/{subject}/correspondence/quality/neutral.tsv")
        assert row["valid"][0] == 1
        assert row["distance_p95_mm"][0] < 1.0
        assert row["mask_triangles"][0] > 600


def test_no_lip_is_bound_to_the_other(scene):
    accurate, tracker = models()
    correspondence = Correspondence.load(scene.root / "subjects/ana/correspondence.npz")
    # The corners of the mouth belong to both lips.
    lower = accurate.regions["vermilion_lower"] & ~accurate.regions["vermilion_upper"]
    bound_to = lower[accurate.triangles].all(axis=1)[correspondence.vertices.triangle]
    upper = tracker.regions["vermilion_upper"] & ~tracker.regions["vermilion_lower"]
    upper &= correspondence.vertices.bound
    assert not bound_to[upper].any()
    assert upper.sum() > 20


def test_true_layers_bring_the_mesh_nearer_to_the_truth(scene):
    """The oracle: what is left is the border of the mask, which stays where the tracker put it."""
    for subject in SUBJECTS:
        base = errors(scene, subject, coarse_of(scene, subject), TEST)
        assert errors(scene, subject, corrected_by_truth(scene, subject), TEST) < 0.75 * base


@pytest.mark.parametrize(
    ("subject", "regressor"), [("ana", "PS-ana"), ("ana", "MS"), ("bo", "MS"), ("ana", "MS-affine")]
)
def test_regressors_correct_held_out_frames(scene, subject, regressor):
    """At least two fifths of what the true layers gain."""
    base = errors(scene, subject, coarse_of(scene, subject), TEST)
    oracle = errors(scene, subject, corrected_by_truth(scene, subject), TEST)
    corrected = errors(scene, subject, corrected_by(scene, subject, regressor), TEST)
    assert base - corrected > 0.4 * (base - oracle)


def test_a_lost_frame_is_flagged_and_trains_nothing(scene):
    quality = read_table(scene.root / f"takes/ana/rom/correction/quality/{CHUNKS[0]}.tsv")
    flagged = quality[quality["valid"] == 0]
    before, after = sorted(LOST)  # one chunk's last and the next one's first
    assert flagged["frame"].tolist() == [BAD_FRAME, before]
    tracked, followed = flagged["reason"]
    assert tracked == "the coarse track failed"
    assert followed.startswith("the lips' pattern differs from the neutral's by 0.50")
    trained = load_model(scene.root / "models/MS.h5").training_frames["ana/rom"]
    assert not {BAD_FRAME, before, after} & set(trained)


def test_training_sees_neither_held_out_frames_nor_other_people(scene):
    expected = {"PS-ana": {"ana"}, "MS": {"ana", "bo"}, "GR-ana": {"bo"}}
    for regressor, people in expected.items():
        model = load_model(scene.root / f"models/{regressor}.h5")
        assert {name.split("/")[0] for name in model.training_frames} == people
        for frames in model.training_frames.values():
            assert not set(frames) & set(TEST)
            assert len(frames) == len(TRAIN) - 1 - len(LOST)


def test_variants_read_their_own_features(scene):
    model = load_model(scene.root / "models/MS-shape-only.h5")
    names = [model.feature_names[k] for k in model.feature_columns]
    assert names == [n for n in model.feature_names if n.startswith("shape")]
    assert len(load_model(scene.root / "models/MS.h5").feature_columns) == len(model.feature_names)


def test_chunks_change_no_layer(scene):
    """One chunk of all frames gives the layers of two."""
    root, take = scene.root, scene.root / "takes/ana/rom"
    whole = f"000000-{N_FRAMES - 1:06d}"
    for name in ("tracking/C", "multiview/H"):
        joined = read_sequence([take / f"{name}/{c}.npy" for c in CHUNKS])
        np.save(take / f"{name}/{whole}.npy", joined)
    quality = take / f"multiview/quality/{whole}.tsv"
    parts = [(take / f"multiview/quality/{c}.tsv").read_text() for c in CHUNKS]
    quality.write_text(parts[0] + parts[1].split("\n", 1)[1])
    run_layers(root, "ana", whole)
    layers = [np.load(take / f"correction/layers/{c}.npz")["layers"] for c in (*CHUNKS, whole)]
    np.testing.assert_array_equal(np.concatenate(layers[:2]), layers[2])


def test_database_tells_split_and_validity(scene):
    with LipDatabase(scene.root / "database/lips.h5") as database:
        assert database.subjects == SUBJECTS
        entry = database.read_take("ana", "rom")
        assert entry.fps == 30.0
        np.testing.assert_array_equal(entry.frames[entry.train], list(TRAIN))
        assert entry.frames[~entry.valid].tolist() == [BAD_FRAME, *LOST]
        assert entry.layers.shape == (N_FRAMES, len(database.mask), 9)
        data = database.training_set(["bo"])
        assert data.takes == ("bo/rom",)
        assert data.layers.shape == (len(TRAIN) - 1 - len(LOST), 9 * len(database.mask))


def test_the_same_inputs_write_the_same_bytes(scene):
    before = {p: (scene.root / p).read_bytes() for p in ("database/lips.h5", "models/MS.h5")}
    run_database(scene.root)
    run_train(scene.root, "MS")
    for path, content in before.items():
        assert (scene.root / path).read_bytes() == content, path
