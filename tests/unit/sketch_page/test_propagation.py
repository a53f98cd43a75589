"""Propagation from the page, and takes that it cannot show."""

from pathlib import Path

import pytest

from tests.sketch_take import CAMERA, CHUNK, N_FRAMES, TAKE
from tests.unit.sketch_page.visits import drawn
from vermilion.app.sketch.desk import Desk
from vermilion.app.sketch.propagation_run import PropagationRun, jobs_of
from vermilion.app.sketch.sketch_store import NOTHING
from vermilion.app.sketch.take_files import TakeFiles
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import write_sequence


def test_a_propagation_needs_a_sketch(page):
    for path in ("/api/jobs", "/api/propagate"):
        answer = page.post(path, json={})
        assert answer.status_code == 422
        assert "No frame is drawn yet" in answer.json()["error"]


def test_the_jobs_of_a_dry_run_are_counted():
    printed = (
        "Job stats:\njob    count\n-----  -----\nguided_refine    3\nguided_train   1\ntotal  4\n"
    )
    assert jobs_of(printed) == {"guided_refine": 3, "guided_train": 1}
    assert jobs_of("Nothing to be done") == {}


def test_progress_and_a_failed_job_are_read_from_what_the_workflow_prints(tmp_path):
    log = tmp_path / "job.log"
    log.write_text("line\n" * 100 + "InputError: found nothing\n")
    run = PropagationRun("c.yaml", [], [])
    for line in (
        "rule guided_train:", "3 of 5 steps (60%) done", "Error in rule guided_correct:",
        "    jobid: 1", f"    log: {log} (check log file(s) for error details)",
    ):  # fmt: skip
        run._take_in(line)
    report = run.report()
    assert (report["done"], report["total"], report["rule"]) == (3, 5, "guided_train")
    assert "guided_correct failed" in run._failure()
    assert run.log().startswith(str(log))
    assert run.log().endswith("found nothing")


def test_a_take_that_does_not_follow_the_strokes_says_what_to_change(page, take):
    page.put(f"/api/sketch/{CAMERA}/4", json={"revision": NOTHING, "sketch": drawn(take, 4)})
    chunk = take.results / "takes" / "s" / "t" / "guided" / "chunks" / f"{CHUNK}.npy"
    try:
        write_sequence(chunk, take.base_mm)
        status = page.get("/api/status").json()
        assert status["propagated"] == list(range(N_FRAMES))
        assert max(status["changed_mm"].values()) < 1e-4
        assert "guided.regions.inner_mm (now 12)" in status["followed"]
        write_sequence(chunk, take.true_mm)
        status = page.get("/api/status").json()
        assert status["followed"] == ""
        assert min(status["changed_mm"].values()) > 0.1
    finally:
        chunk.unlink()


def test_a_take_that_cannot_be_shown_is_refused_with_a_sentence(take, monkeypatch):
    monkeypatch.chdir(take.folder)
    with pytest.raises(InputError, match=r"`guided.takes` names s/t"):
        TakeFiles.of(take.configuration, "s/other")
    with pytest.raises(InputError, match="no readable configuration"):
        TakeFiles.of("nothing.yaml", TAKE)
    with pytest.raises(InputError, match="no workflow in this folder"):
        TakeFiles.of(take.configuration, TAKE, Path("nowhere/paths.smk"))
    files = TakeFiles.of(take.configuration, TAKE)
    chunk = files.sequence_chunks[0]
    chunk.rename(chunk.with_suffix(".away"))
    try:
        with pytest.raises(InputError, match=r"no sequence of take s/t yet.*snakemake guided"):
            Desk(files)
    finally:
        chunk.with_suffix(".away").rename(chunk)
