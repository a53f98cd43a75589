"""Two people up to trained regressors, and the measures of one of them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.stages.lip_scene import BAD_FRAME, CHUNKS, TEST, TRAIN, models, write_subject
from tests.stages.run_script import run_script
from tests.stages.test_correction import (
    SUBJECTS,
    run_correspondence,
    run_database,
    run_layers,
    run_neutral_pair,
    run_train,
)
from vermilion.config.apply import ExportConfig, OverlayConfig
from vermilion.config.correction import ImageAgreementConfig
from vermilion.config.evaluation import (
    ContourConfig,
    EvaluationConfig,
    MeasuresConfig,
    ReferenceConfig,
)
from vermilion.config.multiview import LostConfig
from vermilion.correspondence.correspondence import Correspondence
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.sequences import write_sequence
from vermilion.tracking.result import Identity

SUBJECT = "ana"
MODELS = (
    "PS-ana", "MS", "GR-ana", "MS-paper", "MS-rbf", "MS-affine", "MS-shape-only", "MS-distances-only",
)  # fmt: skip
CFG = {
    "evaluation.reference": ReferenceConfig().model_dump(),
    "evaluation.measures": MeasuresConfig(bootstrap_samples=200).model_dump(),
    "evaluation.measures.surface": MeasuresConfig().surface.model_dump(),
    "multiview.lost": LostConfig().model_dump(),
    "evaluation.contour": ContourConfig(shapes=8).model_dump(),
    "evaluation.figures": EvaluationConfig().figures.model_dump() | {"map_size_px": 120},
    "evaluation.figures.map_frames": 2,
    "correction.integration": {"seam_mm": 8.0, "detail_mm": 15.0},
    "correction.image": ImageAgreementConfig().model_dump(),
    "apply.overlay": OverlayConfig(panel_height_px=160).model_dump(),
    "apply.export": ExportConfig(
        formats=["usd", "usd_shapes", "gltf", "obj", "ply"], plate=True
    ).model_dump(),
}


@pytest.fixture(scope="package")
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
            add_contours(root / f"takes/{subject}/rom/features/{chunk}.npz")
        write_identity(root, subject)
        run_neutral_pair(root, subject)
    run_database(root)
    for regressor in MODELS:
        run_train(root, regressor)
    run_lip_shapes(root)
    evaluate(root, "truth", truth=True)
    evaluate(root, "held_out", truth=False)
    return SimpleNamespace(root=root, tracker=tracker)


def write_truth(folder, truth, triangles):
    write_sequence(folder / "vertices_mm.npy", truth)
    np.save(folder / "triangles.npy", triangles)


def add_contours(path):
    """Contours that were not found: the scene has no images."""
    arrays = read_arrays(path, "feature file")
    nothing = np.full((len(arrays["frames"]), 8, 2), np.nan)
    found = np.zeros(nothing.shape[:2], dtype=bool)
    none = {"outer_px": nothing, "inner_px": nothing, "outer_found": found, "inner_found": found}
    write_arrays(path, **arrays | none)


def write_identity(root, subject):
    neutral = Correspondence.load(root / f"subjects/{subject}/correspondence.npz").coarse_neutral_mm
    Identity(
        np.zeros(4), neutral, np.zeros((66, 3)), np.array(["rom"]), np.array([900.0]),
        np.array([True]),
    ).save(root / f"subjects/{subject}/identity.npz")  # fmt: skip


def run_lip_shapes(root):
    takes = [root / f"takes/{subject}/rom" for subject in SUBJECTS]
    run_script(
        "evaluation/lip_shapes",
        params={
            "cfg": CFG,
            "subjects": list(SUBJECTS),
            "takes": [
                {"take": f"{s}/rom", "train": list(TRAIN), "chunks": len(CHUNKS)} for s in SUBJECTS
            ],
        },
        input={
            "tracker": root / "face/tracker.npz",
            "correspondence": [root / f"subjects/{s}/correspondence.npz" for s in SUBJECTS],
            "accurate": [take / f"multiview/H/{c}.npy" for take in takes for c in CHUNKS],
            "accurate_quality": [
                take / f"multiview/quality/{c}.tsv" for take in takes for c in CHUNKS
            ],
            "drift": [take / f"multiview/drift/{c}.tsv" for take in takes for c in CHUNKS],
            "neutrals": [take / "multiview/neutral.npz" for take in takes],
        },
        output={"shapes": root / "evaluation/lip_shapes.npz"},
    )


def take_inputs(root):
    """Files of the subject's take that evaluation and application read."""
    take = root / f"takes/{SUBJECT}/rom"
    one = {
        "tracker": root / "face/tracker.npz",
        "correspondence": root / f"subjects/{SUBJECT}/correspondence.npz",
        "identity": root / f"subjects/{SUBJECT}/identity.npz",
        "neutral_pair": take / "correction/neutral_pair.npz",
        "fit": take / "tracking/fit.npz",
    }
    many = {
        "coarse": [take / f"tracking/C/{c}.npy" for c in CHUNKS],
        "features": [take / f"features/{c}.npz" for c in CHUNKS],
    }
    return {k: str(v) for k, v in one.items()} | {k: [*map(str, v)] for k, v in many.items()}


def evaluate(root, name, truth):
    take, out = root / f"takes/{SUBJECT}/rom", root / f"evaluation/{name}"
    known = [root / f"truth/{SUBJECT}/rom/{part}.npy" for part in ("vertices_mm", "triangles")]
    inputs = take_inputs(root) | {
        "template": root / "face/template.npz",
        "neutral_of_take": take / "correction/neutral_pair.npz",
        "shapes": root / "evaluation/lip_shapes.npz",
        "layers": [take / f"correction/layers/{c}.npz" for c in CHUNKS],
        "models": [root / f"models/{m}.h5" for m in MODELS],
        "accurate": [take / f"multiview/H/{c}.npy" for c in CHUNKS],
    }
    if truth:
        inputs |= {
            "truth": known,
            "neutral_truth": known,
            "neutral_accurate": take / f"multiview/H/{CHUNKS[0]}.npy",
        }
    run_script(
        "evaluation/evaluate",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG, "frames": [BAD_FRAME, *TEST], "first": 0, "fps": 25.0},
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
