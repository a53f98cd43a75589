"""From regressors to tables, figures, the summary page, and corrected takes in other formats."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd
import pytest

from tests.stages.lip_scene import BAD_FRAME, CHUNKS, TEST, models, write_subject
from tests.stages.run_script import run_script
from tests.stages.test_correction import (
    SUBJECTS,
    run_correspondence,
    run_database,
    run_layers,
    run_train,
)
from vermilion.camera import look_at, pinhole, write_cameras
from vermilion.config.apply import OverlayConfig
from vermilion.config.evaluation import EvaluationConfig, MeasuresConfig, ReferenceConfig
from vermilion.draw import to_display
from vermilion.evaluation.files import load_arrays, save_arrays
from vermilion.evaluation.measures import COLUMNS
from vermilion.images import write_srgb8
from vermilion.sequences import read_mesh, read_sequence, write_sequence
from vermilion.tables import read_table
from vermilion.tracking.result import Identity
from vermilion.video import VideoReader

pytestmark = pytest.mark.slow
SUBJECT = "ana"
CFG = {
    "evaluation.reference": ReferenceConfig().model_dump(),
    "evaluation.measures": MeasuresConfig(bootstrap_samples=200).model_dump(),
    "evaluation.figures": EvaluationConfig().figures.model_dump() | {"map_size_px": 120},
    "evaluation.figures.map_frames": 2,
    "correction.integration": {"seam_mm": 8.0, "detail_mm": 15.0},
    "apply.overlay": OverlayConfig(panel_height_px=160).model_dump(),
    "apply.export": {"obj": True, "usd": True},
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two people up to trained regressors, the identity and the truth of each."""
    root = tmp_path_factory.mktemp("results")
    accurate, tracker = models()
    accurate.save(root / "face/template.npz")
    tracker.save(root / "face/tracker.npz")
    for seed, subject in enumerate(SUBJECTS, start=1):
        _, truth = write_subject(root, subject, accurate, tracker, seed)
        write_truth(root / f"truth/{subject}/rom", truth, accurate.triangles)
        run_correspondence(root, subject)
        for chunk in CHUNKS:
            run_layers(root, subject, chunk)
            add_contours(root / f"takes/{subject}/rom/correction/features/{chunk}.npz")
        write_identity(root, subject)
    run_database(root)
    for regressor in ("PS-ana", "MS", "GR-ana", "MS-affine"):
        run_train(root, regressor)
    evaluate(root, "truth", truth=True)
    evaluate(root, "held_out", truth=False)
    return SimpleNamespace(root=root, tracker=tracker)


def write_truth(folder, truth, triangles):
    write_sequence(folder / "vertices_mm.npy", truth)
    np.save(folder / "triangles.npy", triangles)


def add_contours(path):
    """Contours that were not found: the scene has no pictures."""
    arrays = load_arrays(path)
    nothing = np.full((len(arrays["frames"]), 8, 2), np.nan)
    save_arrays(path, arrays | {"outer_px": nothing, "inner_px": nothing})


def write_identity(root, subject):
    from vermilion.correspondence.correspondence import Correspondence

    neutral = Correspondence.load(root / f"subjects/{subject}/correspondence.npz").coarse_neutral_mm
    Identity(
        np.zeros(4), neutral, np.zeros((66, 3)), np.array(["rom"]), np.array([900.0]),
        np.array([True]),
    ).save(root / f"subjects/{subject}/identity.npz")  # fmt: skip


def evaluate(root, name, truth):
    take, out = root / f"takes/{SUBJECT}/rom", root / f"evaluation/{name}"
    known = [root / f"truth/{SUBJECT}/rom/{part}.npy" for part in ("vertices_mm", "triangles")]
    inputs = {
        "tracker": root / "face/tracker.npz",
        "template": root / "face/template.npz",
        "correspondence": root / f"subjects/{SUBJECT}/correspondence.npz",
        "identity": root / f"subjects/{SUBJECT}/identity.npz",
        "fit": take / "tracking/fit.npz",
        "coarse": [take / f"tracking/C/{c}.npy" for c in CHUNKS],
        "features": [take / f"correction/features/{c}.npz" for c in CHUNKS],
        "layers": [take / f"correction/layers/{c}.npz" for c in CHUNKS],
        "models": [root / f"models/{m}.h5" for m in ("PS-ana", "MS", "GR-ana", "MS-affine")],
        "accurate": [take / f"multiview/H/{c}.npy" for c in CHUNKS],
    }
    if truth:
        inputs |= {
            "truth": known,
            "neutral_truth": known,
            "neutral_accurate": take / f"multiview/H/{CHUNKS[0]}.npy",
        }
    run_script(
        "evaluate",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG, "frames": [BAD_FRAME, *TEST], "first": 0},
        input=inputs,
        output={
            "sums": out / "sums.npz",
            "seconds": out / "seconds.tsv",
            "measures": out / "measures.tsv",
            "frames": out / "frames.tsv",
            "maps": out / "maps.npz",
            "quality": out / "quality.tsv",
        },
    )


def values(root, name, region="mouth", measure="vertex_error_mean_mm"):
    rows = read_table(root / f"evaluation/{name}/measures.tsv", COLUMNS)
    rows = rows[(rows["region"] == region) & (rows["measure"] == measure)]
    return rows.set_index("regressor")["value"]


def test_corrections_are_between_the_base_and_the_oracle(scene):
    error = values(scene.root, "truth")
    assert set(error.index) == {"base", "oracle", "PS-ana", "MS", "GR-ana", "MS/affine"}
    assert error["oracle"] < 0.7 * error["base"]
    for regressor in ("PS-ana", "MS"):
        assert error["oracle"] < error[regressor] < error["base"]
    feature = values(scene.root, "truth", measure="feature_error")
    assert (feature > 0).all()


def test_held_out_reconstruction_stands_in_for_truth(scene):
    """H is the truth in this scene, so both ways must agree."""
    truth, held_out = values(scene.root, "truth"), values(scene.root, "held_out")
    tolerance_mm = 0.05
    assert (truth - held_out).abs().max() < tolerance_mm


def test_a_lost_frame_is_flagged_and_not_measured(scene):
    quality = read_table(scene.root / "evaluation/truth/quality.tsv")
    assert quality.loc[quality["valid"] == 0, "frame"].tolist() == [BAD_FRAME]
    rows = read_table(scene.root / "evaluation/truth/measures.tsv")
    assert set(rows["frames"]) == {len(TEST)}


def two_cameras(folder, take):
    """A rig before the face of the take's first frame."""
    centre = read_sequence([take / f"multiview/H/{CHUNKS[0]}.npy"])[0].mean(axis=0)
    places = {"left": [60.0, 0, 600], "right": [-60.0, 0, 600]}
    rig = {
        name: pinhole(name, 800.0, 400, 400, look_at(centre + at, centre, np.array([0.0, 1, 0])))
        for name, at in places.items()
    }
    write_cameras(folder, rig)
    return folder


def reconstruction(scene):
    out = scene.root / "evaluation/h"
    take = scene.root / f"takes/{SUBJECT}/rom"
    run_script(
        "evaluate_reconstruction",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG, "first": 0},
        input={
            "template": scene.root / "face/template.npz",
            "correspondence": scene.root / f"subjects/{SUBJECT}/correspondence.npz",
            "cameras": two_cameras(scene.root / "rig", take),
            "accurate": [take / f"multiview/H/{c}.npy" for c in CHUNKS],
            "truth": [
                scene.root / f"truth/{SUBJECT}/rom/{part}.npy"
                for part in ("vertices_mm", "triangles")
            ],
        },
        output={"sums": out / "sums.npz", "measures": out / "measures.tsv"},
    )
    return out


def test_tables_figures_and_page(scene):
    root, out = scene.root, reconstruction(scene)
    h = values(root, "h")
    assert h["H"] < 1e-3
    for region in ("vermilion", "visible"):
        assert values(root, "h", region, "drift_mm")["H"] < 1e-2
    ev = root / "evaluation"
    run_script(
        "measures",
        params={"cfg": CFG, "takes": [{"take": "ana/rom", "role": "tattoo"}]},
        input={
            "takes": [ev / "truth/sums.npz"],
            "seconds": [ev / "truth/seconds.tsv"],
            "reconstructions": [out / "sums.npz"],
            "tables": [ev / "truth/measures.tsv", out / "measures.tsv"],
        },
        output={
            "measures": ev / "measures.tsv",
            "table1": ev / "table1.tsv",
            "picture": ev / "table1.png",
        },
    )
    table = read_table(ev / "table1.tsv")
    together = table[table["subject"] == "all"].set_index("regressor")["mean_mm"]
    assert together["PS"] == pytest.approx(values(root, "truth")["PS-ana"], abs=1e-6)
    run_script(
        "evaluation_figures",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG},
        input={"maps": ev / "truth/maps.npz", "frames": ev / "truth/frames.tsv"},
        output={"maps": ev / "error_maps.png", "curves": ev / "curves.png"},
    )
    run_script(
        "quality",
        input={"tables": [ev / "truth/quality.tsv"]},
        output={"flagged": root / "quality.tsv"},
    )
    write_page(root, ev)
    page = (ev / "summary.html").read_text(encoding="utf-8")
    assert "not tracked, so not measured" in page
    assert "PS-ana" in page
    assert 'src="http' not in page
    assert page.count("data:image/") >= 4


def write_page(root, ev):
    overlay = root / "overlay.png"
    write_srgb8(overlay, to_display(np.full((20, 30, 3), 0.5)))
    run_script(
        "summary",
        params={
            "cfg": {"evaluation.figures.embed_video_mb": 1.0, "evaluation.measures": {"seed": 0}},
            "names": {
                "maps": ["ana/rom"],
                "training": ["MS"],
                "overlays": [["tracking", "ana/rom"]],
                "videos": [],
                "timelines": [],
            },
            "frames": [
                {
                    "take": "ana/rom",
                    "role": "tattoo",
                    "frames": 40,
                    "held_out": 11,
                    "against": "truth",
                }
            ],
        },
        input={
            "measures": ev / "measures.tsv",
            "table1": ev / "table1.tsv",
            "picture": ev / "table1.png",
            "quality": root / "quality.tsv",
            "maps": [ev / "error_maps.png"],
            "curves": [ev / "curves.png"],
            "training": [root / "models/MS.cv.png"],
            "overlays": [overlay],
            "videos": [],
            "timelines": [],
        },
        output={"page": ev / "summary.html"},
    )


def apply_chunk(scene, frames, pictures, out):
    """Correct some frames as one chunk."""
    take = scene.root / f"takes/{SUBJECT}/rom"
    first, last = frames[0], frames[-1]
    name = f"{first:06d}-{last:06d}"
    coarse, given = (out / f"in/{name}.npy"), (out / f"in/{name}.npz")
    meshes = read_sequence([take / f"tracking/C/{c}.npy" for c in CHUNKS])
    write_sequence(coarse, meshes[first : last + 1])
    arrays = [load_arrays(take / f"correction/features/{c}.npz") for c in CHUNKS]
    joined = {
        key: np.concatenate([part[key] for part in arrays])[first : last + 1]
        for key in ("features", "valid")
    }
    save_arrays(given, joined)
    run_script(
        "apply",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={
            "cfg": CFG, "frames": list(frames), "fps": 25.0, "source": str(pictures), "camera": "face2"
        },
        input={
            "tracker": scene.root / "face/tracker.npz",
            "identity": scene.root / f"subjects/{SUBJECT}/identity.npz",
            "fit": take / "tracking/fit.npz",
            "coarse": coarse,
            "features": given,
            "model": scene.root / "models/MS.h5",
        },
        output={
            "corrected": out / f"{name}.npy",
            "overlay": out / f"{name}.mp4",
            "quality": out / f"{name}.tsv",
        },
    )  # fmt: skip
    return name


def test_apply_does_not_depend_on_chunks_and_writes_all_formats(scene, tmp_path):
    pictures = tmp_path / "pictures"
    for frame in range(12):
        if frame != 7:  # a picture that is missing does not stop the take
            write_srgb8(pictures / f"{frame:06d}.png", np.full((400, 320, 3), 100, np.uint8))
    whole = apply_chunk(scene, range(12), pictures, tmp_path / "whole")
    parts = [
        apply_chunk(scene, part, pictures, tmp_path / "parts") for part in (range(5), range(5, 12))
    ]
    at_once = read_sequence(tmp_path / f"whole/{whole}.npy")
    in_parts = read_sequence([tmp_path / f"parts/{part}.npy" for part in parts])
    tolerance_mm = 0.01
    assert np.abs(at_once - in_parts).max() < tolerance_mm
    flagged = read_table(tmp_path / f"whole/{whole}.tsv").query("valid == 0")
    assert flagged["frame"].tolist() == [BAD_FRAME]

    take, out = scene.root / f"takes/{SUBJECT}/rom", tmp_path / "out"
    fit = load_arrays(take / "tracking/fit.npz")
    per_frame = {
        "frames", "weights", "world_from_head_rotation", "world_from_head_translation_mm", "valid",
        "reprojection_px",
    }  # fmt: skip
    save_arrays(out / "fit.npz", {k: v[:12] if k in per_frame else v for k, v in fit.items()})
    run_script(
        "apply_export",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG, "fps": 25.0},
        input={
            "tracker": scene.root / "face/tracker.npz",
            "fit": out / "fit.npz",
            "corrected": [tmp_path / f"parts/{part}.npy" for part in parts],
            "overlays": [tmp_path / f"parts/{part}.mp4" for part in parts],
            "quality": [tmp_path / f"parts/{part}.tsv" for part in parts],
        },
        output={
            name: out / file
            for name, file in {
                "corrected": "corrected.npy", "mesh": "mesh.ply", "weights": "weights.csv",
                "overlay": "overlay.mp4", "usd": "corrected.usdc", "obj": "obj",
                "timeline": "timeline.png",
            }.items()
        },
    )  # fmt: skip
    assert VideoReader(out / "overlay.mp4").n_frames == 12
    assert len(pd.read_csv(out / "weights.csv")) == 12
    assert cv2.imread(str(out / "timeline.png")).shape[1] > 500
    assert (out / "corrected.usdc").stat().st_size > 1000
    assert len(list((out / "obj").glob("*.obj"))) == 12
    mesh = read_mesh(out / "obj/000003.obj")
    assert np.abs(mesh.vertices_mm - at_once[3]).max() < 1e-3
