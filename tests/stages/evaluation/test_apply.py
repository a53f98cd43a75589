"""Corrected takes: chunks, overlay, and the formats that other programs open."""

from __future__ import annotations

import cv2
import numpy as np
import pandas as pd
import pytest

from tests.stages.evaluation.conftest import CFG, SUBJECT
from tests.stages.lip_scene import BAD_FRAME, CHUNKS
from tests.stages.run_script import run_script
from vermilion.config.apply import ExportConfig
from vermilion.external.read import read_tracked
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import VideoReader
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow


def apply_chunk(scene, frames, images, out, model=None):
    """Correct some frames as one chunk, by MS or by another model; [] is none."""
    take = scene.root / f"takes/{SUBJECT}/rom"
    first, last = frames[0], frames[-1]
    name = f"{first:06d}-{last:06d}"
    run_script(
        "apply/apply",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={
            "cfg": {**CFG, "correspondence": {}}, "frames": list(frames), "fps": 25.0, "source": str(images), "camera": "face2"
        },
        input={
            "tracker": scene.root / "face/tracker.npz",
            "identity": scene.root / f"subjects/{SUBJECT}/identity.npz",
            "fit": take / "tracking/fit.npz",
            "coarse": [take / f"tracking/C/{c}.npy" for c in CHUNKS],
            "features": [take / f"features/{c}.npz" for c in CHUNKS],
            "model": scene.root / "models/MS.h5" if model is None else model,
        },
        output={
            "corrected": out / f"{name}.npy",
            "overlay": out / f"{name}.mp4",
            "quality": out / f"{name}.tsv",
        },
    )  # fmt: skip
    return name


def test_apply_does_not_depend_on_chunks_and_writes_all_formats(scene, tmp_path):
    images = tmp_path / "images"
    for frame in range(12):
        if frame != 7:  # an image that is missing does not stop the take
            write_srgb8(images / f"{frame:06d}.png", np.full((400, 320, 3), 100, np.uint8))
    whole = apply_chunk(scene, range(12), images, tmp_path / "whole")
    parts = [
        apply_chunk(scene, part, images, tmp_path / "parts") for part in (range(5), range(5, 12))
    ]
    at_once = read_sequence(tmp_path / f"whole/{whole}.npy")
    in_parts = read_sequence([tmp_path / f"parts/{part}.npy" for part in parts])
    tolerance_mm = 0.01
    assert np.abs(at_once - in_parts).max() < tolerance_mm
    flagged = read_table(tmp_path / f"whole/{whole}.tsv").query("valid == 0")
    assert flagged["frame"].tolist() == [BAD_FRAME]

    take, out = scene.root / f"takes/{SUBJECT}/rom", tmp_path / "out"
    fit = read_arrays(take / "tracking/fit.npz", "fit")
    per_frame = {
        "frames", "weights", "world_from_head_rotation", "world_from_head_translation_mm", "valid",
        "reprojection_px",
    }  # fmt: skip
    write_arrays(out / "fit.npz", **{k: v[:12] if k in per_frame else v for k, v in fit.items()})
    run_script(
        "apply/apply_export",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG, "fps": 25.0, "source": str(images)},
        input={
            "tracker": scene.root / "face/tracker.npz",
            "fit": out / "fit.npz",
            "identity": scene.root / f"subjects/{SUBJECT}/identity.npz",
            "corrected": [tmp_path / f"parts/{part}.npy" for part in parts],
            "overlays": [tmp_path / f"parts/{part}.mp4" for part in parts],
            "quality": [tmp_path / f"parts/{part}.tsv" for part in parts],
        },
        output={
            name: out / file
            for name, file in {
                "corrected": "corrected.npy", "mesh": "mesh.ply", "weights": "weights.csv",
                "overlay": "overlay.mp4", "usd": "corrected.usdc", "obj": "obj",
                "timeline": "timeline.png", "usd_shapes": "corrected_shapes.usdc",
                "gltf": "corrected.glb", "ply": "ply", "plate": "plate",
            }.items()
        },
    )  # fmt: skip
    assert VideoReader(out / "overlay.mp4").n_frames == 12
    assert len(pd.read_csv(out / "weights.csv")) == 12
    assert cv2.imread(str(out / "timeline.png")).shape[1] > 500
    assert len(list((out / "plate").glob("*.jpg"))) == 11  # all images that there are
    exact_mm, shapes_mm = 1e-4, ExportConfig().tolerance_mm + 1e-3
    for file, limit in {
        "corrected.usdc": exact_mm, "obj": exact_mm, "ply": exact_mm, "corrected_shapes.usdc": shapes_mm,
        "corrected.glb": shapes_mm,
    }.items():  # fmt: skip
        back = read_tracked(out / file, range(12))
        assert np.linalg.norm(back.vertices_mm - at_once, axis=2).max() < limit, file
    assert len(list((out / "obj").glob("*.obj"))) == 12


def test_without_a_regressor_and_without_found_contours_the_base_track_comes_out(scene, tmp_path):
    for frame in range(12):
        write_srgb8(tmp_path / f"{frame:06d}.png", np.full((400, 320, 3), 100, np.uint8))
    name = apply_chunk(scene, range(12), tmp_path, tmp_path / "out", model=[])
    moved = read_sequence(tmp_path / f"out/{name}.npy")
    coarse = read_sequence([scene.root / f"takes/{SUBJECT}/rom/tracking/C/{c}.npy" for c in CHUNKS])
    assert np.abs(moved - coarse[:12]).max() < 1e-3
    rows = read_table(tmp_path / f"out/{name}.tsv")
    # Nothing was learnt, so that no frame is outside of it.
    assert rows["novelty"].isna().all()
    assert not rows["reason"].fillna("").str.contains("span").any()
