"""Killed jobs, killed runs and damaged files: the next run repairs them, bit for bit."""

import hashlib
import os
import signal
import subprocess
import time

import numpy as np
import psutil
import pytest

from vermilion.workflow import checksums

from .conftest import Project

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
            with_name = [part for part in child.cmdline() if part.endswith(f".{script}.py")]
            if with_name and "python" in child.name():
                return child
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


def test_killed_job(finished, whole):
    chunk = sorted(finished.results.glob("takes/s1/rom/tracking/C/*.npy"))[0]
    chunk.unlink()
    run = start(finished)
    wait_for_job(run, "tracking_meshes").send_signal(signal.SIGKILL)
    assert run.wait(timeout=300) != 0
    assert not chunk.exists() and not list(chunk.parent.glob(".*"))
    finished.snakemake()


def test_killed_run(finished, whole):
    chunk = sorted(finished.results.glob("takes/s1/rom/tracking/C/*.npy"))[0]
    chunk.unlink()
    run = start(finished)
    wait_for_job(run, "tracking_meshes")
    os.killpg(run.pid, signal.SIGKILL)
    run.wait(timeout=60)
    finished.snakemake("--unlock")
    finished.snakemake()


def test_truncated_output(finished, whole, capsys):
    layers = sorted(finished.results.glob("takes/s1/rom/correction/layers/*.npz"))[0]
    os.truncate(layers, layers.stat().st_size // 2)
    assert checksums.main([str(finished.results)]) == 0
    printed = capsys.readouterr().out
    assert f"damaged: {layers}" in printed and "1 damaged file(s)" in printed
    assert not layers.exists()
    assert finished.would_run()["layers"] == 1
    finished.snakemake()
    checksums.main([str(finished.results)])
    assert "0 damaged file(s)" in capsys.readouterr().out


def test_chunk_size_and_cores_change_no_result(finished):
    other = Project(finished.folder, "config/chunks.yaml")
    (finished.folder / other.configuration).write_text(
        (finished.folder / finished.configuration).read_text()
    )
    other.edit_configuration(lambda c: c.update(results="results/chunks", chunk_frames=5))
    pattern = "takes/s1/rom/{}/*.{}"
    parts = [("multiview/H", "npy"), ("tracking/C", "npy"), ("correction/layers", "npz")]
    targets = [
        f"results/chunks/takes/s1/rom/{folder}/{chunk}.{suffix}"
        for folder, suffix in parts
        for chunk in ("000000-000004", "000005-000009", "000010-000011")
    ]
    other.snakemake("--cores", "1", *targets)

    def joined(project, folder, suffix):
        files = sorted(project.results.glob(pattern.format(folder, suffix)))
        loaded = [np.load(f) if suffix == "npy" else np.load(f)["layers"] for f in files]
        return np.concatenate(loaded)

    for folder, suffix in parts:
        ours, theirs = joined(other, folder, suffix), joined(finished, folder, suffix)
        assert ours.shape == theirs.shape
        off = np.nanmax(np.abs(ours - theirs))
        assert off <= (0.01 if suffix == "npy" else 0.001), f"{folder}: {off}"
