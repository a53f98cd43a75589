"""A take that fails costs itself: everything else is made, and the take is named with its reason."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from vermilion.app.run import clear_failures, failures, run_all
from vermilion.config.takes import read_takes
from vermilion.imaging.images import write_image
from vermilion.storage.logfile import FAILED_SUFFIX

from .conftest import ROOT, Project


def test_failures_of_chunk_take_and_subject_are_told_apart(tmp_path):
    takes, problems = read_takes(str(ROOT / "config" / "takes.tiny.tsv"))
    assert not problems
    names = {"layers/s2-rom-000000-000007.log": "s2/rom", "tracking/s1-phone.log": "s1/phone"}
    for name in [*names, "database.log"]:
        path = tmp_path / "logs" / f"{name}{FAILED_SUFFIX}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("found nothing")
    found = failures(tmp_path, takes)
    assert set(found) == set(names.values())  # what belongs to no take cannot be left out
    assert found["s1/phone"] == "tracking: found nothing"
    of_subject = tmp_path / "logs" / "identity" / f"s1.log{FAILED_SUFFIX}"
    of_subject.parent.mkdir()
    of_subject.write_text("too few frames")
    assert {name for name in failures(tmp_path, takes) if name.startswith("s1/")} == {
        take.name for take in takes if take.subject == "s1"
    }
    clear_failures(tmp_path)
    assert failures(tmp_path, takes) == {}


def test_takes_left_out_by_hand_stay_out_when_others_fail(tmp_path, monkeypatch):
    takes, _ = read_takes(str(ROOT / "config" / "takes.tiny.tsv"))
    commands = []

    def snakemake(words, log, expected_s):
        commands.append(words)
        if len(commands) == 1:
            failed = tmp_path / "logs" / "tracking" / f"s1-phone.log{FAILED_SUFFIX}"
            failed.parent.mkdir(parents=True)
            failed.write_text("no face")
        return int(len(commands) == 1)

    monkeypatch.setattr("vermilion.app.run.run_workflow", snakemake)
    code, skipped = run_all("c.yaml", tmp_path, takes, [], {"s2/rom": "by hand"})
    assert code == 1
    assert skipped == {"s2/rom": "by hand", "s1/phone": "tracking: no face"}
    assert commands[-1][-1] == f"skip_takes={json.dumps(skipped)}"


def test_a_take_that_is_alone_ends_the_run(tmp_path, monkeypatch):
    takes, _ = read_takes(str(ROOT / "config" / "takes.tiny.tsv"))

    def snakemake(words, log, expected_s):
        failed = tmp_path / "logs" / "landmarks" / f"s1-phone-000000-000007.log{FAILED_SUFFIX}"
        failed.parent.mkdir(parents=True)  # a second start would fail here
        failed.write_text("no face")
        return 1

    monkeypatch.setattr("vermilion.app.run.run_workflow", snakemake)
    code, skipped = run_all("c.yaml", tmp_path, takes, [], {}, alone=True)
    assert code == 1 and skipped == {"s1/phone": "landmarks: no face"}


@pytest.mark.slow
def test_a_video_without_a_face_costs_itself(finished, tmp_path):
    """A video of a person of its own shows no face: the run ends without it, and says why."""
    folder = tmp_path / "copy"
    shutil.copytree(finished.folder, folder, symlinks=True)
    project = Project(folder, finished.configuration)
    blank = folder / "captures" / "s9" / "blank"
    blank.mkdir(parents=True)
    for frame in range(3):
        write_image(blank / f"{frame:06d}.png", np.full((240, 320, 3), 0.2, np.float32))
    sheet = folder / "config" / "takes.external.tsv"
    row = "\t".join(["s9", "blank", "video", "captures/s9/blank", "0", "2", "30", "none"])
    sheet.write_text(sheet.read_text() + row + "\n")
    project.edit_configuration(lambda content: content["apply"]["takes"].append("s9/blank"))
    run = subprocess.run(
        [sys.executable, "-m", "vermilion.app.run", project.configuration, "--cores", "2"],
        cwd=folder, env=project.environment(), text=True, capture_output=True, check=False,
    )  # fmt: skip
    assert run.returncode != 0
    assert "Left out; all else was made" in run.stderr and "s9/blank" in run.stderr, run.stderr
    quality = pd.read_csv(project.results / "quality.tsv", sep="\t")
    left_out = quality[(quality["take"] == "blank") & (quality["stage"] == "run")]
    assert len(left_out) == 1 and "the whole take was left out" in left_out["reason"].iloc[0]
    assert (project.results / "report.html").stat().st_size > 0
