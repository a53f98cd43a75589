"""A job uses what its run began with: the configuration, the sheet, the code."""

import json
import os
from dataclasses import replace

import pytest

from vermilion.provenance import begun_run
from vermilion.provenance.begun_run import BegunRun, digest_of, of_this_job, record_beginning
from vermilion.provenance.fingerprint import _read, fingerprint


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "scripts" / "stage" / "rule.py"
    path.parent.mkdir(parents=True)
    path.write_text("print(1)\n")
    return path


@pytest.fixture
def begun(tmp_path, script, monkeypatch):
    """A run that began with this script, as its jobs see it."""
    monkeypatch.setenv(begun_run.VARIABLE, "")
    monkeypatch.setattr(begun_run, "SOURCE", tmp_path / "library")
    monkeypatch.setattr(begun_run.stamp_of, "__defaults__", (tmp_path / "library",))
    sheet = tmp_path / "takes.tsv"
    sheet.write_text("before")
    beginning = BegunRun(
        configuration={"chunk_frames": 8, "takes": str(sheet)},
        takes=str(sheet),
        rules="",
        code={"stage/rule": fingerprint(script)},
        stamp=begun_run.stamp_of(script.parents[1]),
    )
    record_beginning(tmp_path / "runs", beginning)
    return beginning


def forget_what_was_read():
    """As in a job, which is a process of its own."""
    for cached in (fingerprint, _read):
        cached.cache_clear()


def test_a_job_has_the_configuration_and_the_sheet_of_the_beginning(begun, tmp_path):
    (tmp_path / "takes.tsv").write_text("after")
    keys = begun_run.with_beginning({"chunk_frames": 100}, of_this_job())
    assert keys["chunk_frames"] == 8
    with open(keys["takes"]) as sheet:
        assert sheet.read() == "before"


def test_without_a_beginning_the_configuration_is_what_was_read(monkeypatch):
    monkeypatch.delenv(begun_run.VARIABLE, raising=False)
    assert begun_run.with_beginning({"chunk_frames": 100}, of_this_job()) == {"chunk_frames": 100}


def test_a_touched_script_runs_and_an_edited_one_does_not(begun, script):
    code = begun.code["stage/rule"]
    os.utime(script, (1, 1))
    forget_what_was_read()
    begun_run.refuse_other_code(script, code)
    script.write_text("print(2)\n")
    forget_what_was_read()
    with pytest.raises(SystemExit, match=r"rule\.py: its code.* changed after the run had begun"):
        begun_run.refuse_other_code(script, code)


def test_the_same_beginning_is_written_once_and_old_ones_go(begun, tmp_path):
    folder = tmp_path / "runs"
    before = sorted(folder.iterdir())
    record_beginning(folder, begun)
    assert sorted(folder.iterdir()) == before
    for path in before:
        os.utime(path, (1, 1))
    record_beginning(folder, replace(begun, rules="other"))
    kept = [path for path in folder.iterdir() if path.suffix == ".json"]
    assert [json.loads(path.read_text())["rules"] for path in kept] == ["other"]


def test_a_digest_of_rule_files_changes_with_their_content(tmp_path):
    (tmp_path / "a.smk").write_text("one")
    before = digest_of(tmp_path.glob("*.smk"))
    (tmp_path / "a.smk").write_text("two")
    assert digest_of(tmp_path.glob("*.smk")) != before
