"""Who holds a folder of results, and what a killed run leaves behind."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from vermilion.provenance.cut_folders import cut_folders
from vermilion.provenance.run_lock import LOCK, FolderHeldError, hold
from vermilion.storage import lifetime
from vermilion.storage.files import atomic_path, remove_unfinished

HOLDING = """
import sys, time
from pathlib import Path
from vermilion.provenance.run_lock import hold
with hold(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the folder."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()


def test_the_second_run_says_who_holds_the_folder(tmp_path, holder):
    with pytest.raises(FolderHeldError) as refused, hold(tmp_path):
        pass
    told = str(refused.value)
    assert f"process {holder.pid}" in told and os.uname().nodename in told
    assert time.strftime("%Y-%m-%d") in told and f"kill {holder.pid}" in told
    # It still says so to a third one.
    assert json.loads((tmp_path / LOCK).read_text())["pid"] == holder.pid


def test_a_killed_run_is_known_and_frees_the_folder(tmp_path, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    with hold(tmp_path) as before:
        assert before.was_killed and before.holder.pid == holder.pid


def test_a_run_that_fails_or_ends_leaves_nothing_to_put_in_order(tmp_path):
    with pytest.raises(RuntimeError), hold(tmp_path):
        raise RuntimeError
    with hold(tmp_path) as before:
        assert before.holder is None
    with hold(tmp_path) as before:
        assert before.holder is None and not before.was_killed


def test_an_interrupted_run_counts_as_killed(tmp_path):
    with pytest.raises(KeyboardInterrupt), hold(tmp_path):
        raise KeyboardInterrupt
    with hold(tmp_path) as before:
        assert before.was_killed


def test_of_a_run_on_another_host_it_is_not_known_whether_it_is_over(tmp_path):
    with hold(tmp_path):
        other = json.loads((tmp_path / LOCK).read_text()) | {"host": "elsewhere"}
    (tmp_path / LOCK).write_text(json.dumps(other))
    with hold(tmp_path) as before:
        assert before.holder.host == "elsewhere" and not before.was_killed


def test_unfinished_files_are_removed_and_others_kept(tmp_path):
    writer = atomic_path(tmp_path / "deep" / "layers.npz")
    half = writer.__enter__()
    half.write_text("half")
    (tmp_path / "deep" / ".snakemake_timestamp").touch()
    (tmp_path / "deep" / "whole.part-1.npz").touch()
    assert remove_unfinished(tmp_path, older_than_s=60) == []
    assert remove_unfinished(tmp_path) == [half]
    assert sorted(p.name for p in (tmp_path / "deep").iterdir()) == [
        ".snakemake_timestamp",
        "whole.part-1.npz",
    ]


def test_a_folder_is_cut_when_something_was_removed_after_its_job(tmp_path, monkeypatch):
    import base64

    monkeypatch.chdir(tmp_path)
    (tmp_path / "records").mkdir()
    for name in ("whole", "cut", "unstamped"):
        folder = tmp_path / "results" / name
        folder.mkdir(parents=True)
        for n in range(3):
            (folder / f"{n}.png").touch()
        (folder / ".snakemake_timestamp").touch()
        record = base64.urlsafe_b64encode(f"results/{name}".encode()).decode()
        (tmp_path / "records" / record).write_text("{}")
    past = time.time() - 100
    for name in ("whole", "cut"):
        os.utime(tmp_path / "results" / name / ".snakemake_timestamp", (past, past))
        os.utime(tmp_path / "results" / name, (past, past))
    (tmp_path / "results" / "cut" / "1.png").unlink()
    (tmp_path / "results" / "unstamped" / ".snakemake_timestamp").unlink()
    found = cut_folders(tmp_path.__class__("results"), tmp_path / "records")
    assert [path.name for path in found] == ["cut", "unstamped"]


JOB = """
import os, time
from vermilion.storage.lifetime import end_with_run
end_with_run()
print(os.getpid(), flush=True)
time.sleep(60)
"""


def test_a_job_ends_with_the_run_that_started_it():
    run = subprocess.Popen(
        [
            sys.executable, "-c",
            f"import os, subprocess, sys; os.environ[{lifetime.RUN!r}] = str(os.getpid());"
            f"subprocess.run(['sh', '-c', 'true; \"$@\"; true', '-', sys.executable, '-c', {JOB!r}])",
        ],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    job = int(run.stdout.readline())
    watched = os.pidfd_open(job)
    run.kill()
    run.wait()
    import select

    assert select.select([watched], [], [], 10)[0], "the job goes on alone"
