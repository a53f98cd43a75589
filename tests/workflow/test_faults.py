"""Killed jobs, killed runs and damaged files: the next run repairs them, bit for bit."""

import hashlib
import os
import signal
import subprocess
import time

import psutil
import pytest

from vermilion.provenance import checksums

pytestmark = pytest.mark.slow

NO_RESULT = ("logs", "benchmarks")


def digests(project) -> dict[str, str]:
    """SHA-256 of every result."""
    return {
        path.relative_to(project.results).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(project.results.rglob("*"))
        if path.is_file()
        and path.relative_to(project.results).parts[0] not in (*NO_RESULT, checksums.LEDGER)
        and not path.name.startswith(".snakemake")
        and path.name != "seconds.tsv"  # measured time is no result
    }


def start(project, *arguments) -> subprocess.Popen:
    """Start a run in a process group of its own."""
    return subprocess.Popen(
        project.command(*arguments),
        cwd=project.folder,
        env=project.environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def wait_for_job(run, script, seconds=120):
    """The process of the first job that runs `script`."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and run.poll() is None:
        for child in psutil.Process(run.pid).children(recursive=True):
            try:
                with_name = [part for part in child.cmdline() if part.endswith(f".{script}.py")]
                if with_name and "python" in child.name():
                    return child
            except psutil.NoSuchProcess:
                continue  # it ended, or is about to, while it was looked at
        time.sleep(0.02)
    raise AssertionError(f"no job of {script} started")


@pytest.fixture
def whole(finished):
    """Digests before a fault; the test ends with the same ones."""
    before = digests(finished)
    yield before
    after = digests(finished)
    assert {name for name in before if after.get(name) != before[name]} == set()
    assert set(after) == set(before)
    assert finished.would_run() == {}


# Jobs near the end are killed: all that comes after them is made again, and looked at.


def test_killed_job(finished, whole):
    chunk = sorted(finished.results.glob("apply/s1/phone/chunks/*.npy"))[0]
    chunk.unlink()
    run = start(finished)
    wait_for_job(run, "apply").send_signal(signal.SIGKILL)
    assert run.wait(timeout=300) != 0
    assert not chunk.exists() and not list(chunk.parent.glob(".*"))
    finished.snakemake()


def test_killed_run(finished, whole):
    chunk = sorted(finished.results.glob("apply/s1/phone/chunks/*.npy"))[0]
    chunk.unlink()
    run = start(finished)
    wait_for_job(run, "apply")
    os.killpg(run.pid, signal.SIGKILL)
    run.wait(timeout=60)
    finished.snakemake()


def test_truncated_output(finished, whole, capsys):
    sums = finished.results / "evaluation/takes/s1/phone/sums.npz"
    os.truncate(sums, sums.stat().st_size // 2)
    assert checksums.main([str(finished.results)]) == 1
    printed = capsys.readouterr().out
    assert f"damaged: {sums}" in printed and "1 damaged file(s)" in printed
    assert not sums.exists()
    assert finished.would_run()["evaluate"] == 1
    finished.snakemake()
    checksums.main([str(finished.results)])
    assert "0 damaged file(s)" in capsys.readouterr().out
