"""Measures of a person's held-out frames, against truth and against H."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stages.evaluation.conftest import CFG, SUBJECT
from tests.stages.lip_scene import BAD_FRAME, CHUNKS, TEST, TRAIN
from tests.stages.run_script import run_script
from vermilion.baselines.lip_shapes import LipShapes
from vermilion.evaluation.measures import COLUMNS
from vermilion.geometry.camera import look_at, pinhole, write_cameras
from vermilion.storage.sequences import read_sequence
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow


def values(root, name, region="mouth", measure="vertex_error_mean_mm"):
    rows = read_table(root / f"evaluation/{name}/measures.tsv", COLUMNS)
    rows = rows[(rows["region"] == region) & (rows["measure"] == measure)]
    return rows.set_index("regressor")["value"]


def test_corrections_are_between_the_base_and_the_oracle(scene):
    error = values(scene.root, "truth")
    assert set(error.index) == {
        "base", "oracle", "contour", "null", "PS-ana", "MS", "GR-ana", "MS/paper",
        "base/neutral", "contour/neutral", "null/neutral",
        "PS-ana/neutral", "MS/neutral", "GR-ana/neutral",
        *(f"MS/{variant}" for variant in ("rbf", "affine", "shape-only", "distances-only")),
    }  # fmt: skip
    assert error["oracle"] < 0.7 * error["base"]
    for regressor in ("PS-ana", "MS"):
        assert error["oracle"] < error[regressor] < error["base"]
    # Identity is the larger part of an unseen subject's error; one frame supplies it.
    assert error["GR-ana/neutral"] < 0.9 * error["GR-ana"]
    # Without an image, what learnt nothing adds nothing, but for what a neutral tells.
    assert error["null"] == pytest.approx(error["base"], abs=0.02)
    assert error["null/neutral"] == pytest.approx(error["base/neutral"], abs=0.02)
    assert error["null/neutral"] < 0.9 * error["base"]
    motion = values(scene.root, "truth", "vermilion", "lip_motion_error_mm")
    assert motion["MS"] < 0.8 * motion["null"]
    assert motion["MS"] < motion["null/neutral"]
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


def test_lip_shapes_come_from_the_training_alone(scene):
    shapes = LipShapes.load(scene.root / "evaluation/lip_shapes.npz")
    assert len(shapes.frame) == 8
    assert set(shapes.frame) <= set(TRAIN)
    assert set(shapes.take) == {"ana/rom", "bo/rom"}


def test_without_contours_the_contour_baseline_is_the_base_track(scene):
    error = values(scene.root, "truth")
    assert error["contour"] == pytest.approx(error["base"], abs=1e-6)


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
        "evaluation/evaluate_reconstruction",
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


def test_h_that_is_the_truth_has_no_error(scene):
    reconstruction(scene)
    assert values(scene.root, "h")["H"] < 1e-3
    for region in ("vermilion", "visible"):
        assert values(scene.root, "h", region, "drift_mm")["H"] < 1e-2
