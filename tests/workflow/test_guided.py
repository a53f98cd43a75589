"""Guided correction in the workflow: which jobs a person's corrections ask for, and no others."""

import contextlib
import json
import shutil

import numpy as np
import pytest

from vermilion.faces.model import FaceModel
from vermilion.guided.sketch import Sketch, SketchCurve, sketch_path, write_sketch
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import TrackedTake

from .test_reruns import changed, configured

pytestmark = pytest.mark.slow

TAKE, FRAMES = "s1/phone", (2, 5)
REFINE, AFTER = "guided_refine", {"guided_train": 1, "guided_correct": 1, "guided_export": 1}
REPORT = {"quality": 1, "lips_page": 1, "summary": 1}


def correct_the_video(content):
    content["guided"] = {"takes": {TAKE: "base"}}


def drawn(project, frame, gap_px=3.0):
    """Two strokes across the mouth of a frame, `gap_px` apart."""
    take = project.results / "takes" / TAKE
    face = FaceModel.load(project.results / "face_model" / "tracker.npz")
    fit = TrackedTake.load(take / "tracking" / "fit.npz")
    chunks = sorted((take / "tracking" / "C").glob("*.npy"))
    mesh = read_sequence(chunks)[fit.index_of([frame])[0]]
    loop = fit.camera.project(mesh[face.inner_contour].astype(float))
    x = np.linspace(loop[:, 0].min() + 3, loop[:, 0].max() - 3, 12)
    middle = np.full(12, loop[:, 1].mean())
    curves = {
        "upper_inner": SketchCurve(np.stack([x, middle - gap_px / 2], axis=1)),
        "lower_inner": SketchCurve(np.stack([x, middle + gap_px / 2], axis=1)),
    }
    camera = fit.camera
    return Sketch(camera.name, frame, (camera.width_px, camera.height_px), curves)


@contextlib.contextmanager
def sketched(project):
    """The take to be corrected, with strokes on some frames; all is as it was afterwards."""
    labels = project.folder / "captures" / TAKE / "labels"
    with configured(project, correct_the_video):
        paths = []
        for frame in FRAMES:
            sketch = drawn(project, frame)
            paths.append(sketch_path(labels, sketch.camera, frame))
            write_sketch(paths[-1], sketch)
        try:
            yield paths
        finally:
            shutil.rmtree(labels / "sketches")
            shutil.rmtree(project.results / "takes" / TAKE / "guided", ignore_errors=True)


def jobs_of_the_target(project):
    """Rule -> number of jobs that the target `guided` would start."""
    jobs = project.would_run("guided")
    return {rule: count for rule, count in jobs.items() if rule != "guided"}


def test_takes_that_cannot_be_corrected_or_studied_are_refused(fresh_project):
    takes = {"s1/plain": "base", "s1/phone": "H"}
    guided = json.dumps({"takes": takes, "study": {"takes": ["s1/nobody"]}})
    run = fresh_project.snakemake("--dry-run", "--config", f"guided={guided}", check=False)
    printed = run.stdout + run.stderr
    assert run.returncode != 0
    assert "key guided.takes: found 's1/plain' with the sequence base" in printed
    assert "found 's1/phone' with the sequence H; expected a take of the sheet of role tattoo" in (
        printed
    )
    assert "key guided.study.takes: found 's1/nobody'" in printed


def test_the_study_of_a_studio_take_needs_its_truth_alone(fresh_project):
    guided = json.dumps({"study": {"takes": ["s1/rom"]}})
    jobs = fresh_project.would_run("guided_evaluation", "--config", f"guided={guided}")
    assert jobs == {
        "face_model": 1, "studio_rig_s1_rom": 1, "guided_evaluate": 1, "guided_evaluation": 1,
    }  # fmt: skip


def test_without_a_corrected_frame_only_suggestions_are_made(finished):
    with configured(finished, correct_the_video):
        assert finished.would_run() == {"guided_suggest": 1}


def test_each_corrected_frame_is_a_job_and_the_take_follows(finished):
    with sketched(finished):
        expected = {"guided_suggest": 1, REFINE: len(FRAMES), **AFTER, **REPORT}
        assert finished.would_run() == expected


def test_a_changed_sketch_reruns_its_frame_the_training_and_its_take(finished):
    with sketched(finished) as paths:
        finished.snakemake("guided")
        assert jobs_of_the_target(finished) == {}
        comment = finished.folder / "src" / "vermilion" / "guided" / "refinement.py"
        with changed(comment, comment.read_bytes() + b"\n# a comment\n"):
            assert jobs_of_the_target(finished) == {}
        before = paths[0].read_bytes()
        write_sketch(paths[0], drawn(finished, FRAMES[0], gap_px=5.0))
        assert jobs_of_the_target(finished) == {REFINE: 1, **AFTER}
        paths[0].write_bytes(before)
        paths[1].unlink()
        # Another set of frames is learnt from, and another one is worth correcting.
        jobs = jobs_of_the_target(finished)
        assert {"guided_suggest", "guided_train", "guided_correct", "guided_export"} <= set(jobs)
