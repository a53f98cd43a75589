"""Disks that are full, read-only, forbidden or late, clocks set back, two runs: a sentence, and the same command goes on."""

import os
import random
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.workflow.conftest import Project
from tests.workflow.disturbed_run import Results
from vermilion.provenance import checksums
from vermilion.provenance.run_lock import hold
from vermilion.storage.files import remove_result
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow

#: In each of two ways; `make test-kills` asks for ten.
PLACES = int(os.environ.get("VERMILION_FULL_DISKS", "1"))
SEED = int(os.environ.get("VERMILION_KILLS_SEED", "1"))
SENTENCE = re.compile(r"file (\S+): found that the disk is full")
NOBODY = 65534


@dataclass
class SmallDisk:
    """A file system in memory, of a size that can be changed."""

    folder: Path

    def __enter__(self):
        self.folder.mkdir(parents=True, exist_ok=True)
        words = ["mount", "-t", "tmpfs", "-o", "size=4g,mode=755", "none", str(self.folder)]
        made = subprocess.run(words, capture_output=True, text=True, check=False)
        if made.returncode:
            pytest.skip(f"no small disk may be mounted here: {made.stderr.strip()}")
        return self

    def __exit__(self, *_):
        subprocess.run(["umount", "--lazy", str(self.folder)], check=True)

    @property
    def used(self) -> int:
        disk = os.statvfs(self.folder)
        return (disk.f_blocks - disk.f_bfree) * disk.f_frsize

    def remount(self, options: str) -> None:
        subprocess.run(["mount", "-o", f"remount,{options}", str(self.folder)], check=True)


def run(project, *options, user=None):
    """`vermilion run` up to its end, without the report: (exit code, what it prints)."""
    words = [sys.executable, "-m", "vermilion.app", "run", project.configuration, "--cores", "1"]
    if user is not None:
        drop = ["setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups"]
        words = [*drop, *words]
    done = subprocess.run(
        [*words, *options],
        cwd=project.folder,
        env={
            **project.environment(),
            "PYTHONDONTWRITEBYTECODE": "1",  # Python itself keeps what a full disk cut off
            **({} if user is None else {"HOME": str(project.folder)}),
        },
        capture_output=True,
        text=True,
        timeout=1800,
    )
    return done.returncode, done.stdout + done.stderr


def remove_one_job(
    results: Path, chance: random.Random, only_files: bool = False
) -> tuple[str, int]:
    """Remove what one job made, below `results`; returns its first output, and how many bytes that were.

    With `only_files`, of a job without folders: what reads a folder that is made again runs again.
    """
    ledger = read_table(results / checksums.LEDGER)
    left_out = set(ledger["job"][ledger["output"] != ledger["path"]]) if only_files else set()
    job = chance.choice(sorted(set(ledger["job"]) - left_out))
    freed = 0
    for name in set(ledger["output"][ledger["job"] == job]):
        path = results / name
        files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
        freed += sum(file.stat().st_size for file in files)
        remove_result(path)
    return job, freed


@pytest.fixture
def on_small_disk(finished, tmp_path, request):
    """The finished run with its results on a small disk, or with all of the project there."""
    with SmallDisk(tmp_path / "disk") as disk:
        project = Project(disk.folder / "project", finished.configuration)
        shutil.copytree(finished.folder, project.folder, symlinks=True)
        if not request.param:
            project = Project(tmp_path / "project", finished.configuration)
            shutil.move(disk.folder / "project", project.folder)
            shutil.move(project.folder / "results", disk.folder / "results")
            (project.folder / "results").symlink_to(disk.folder / "results")
        yield disk, project


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount a small disk")
@pytest.mark.parametrize("on_small_disk", [False, True], indirect=True, ids=["results", "all"])
def test_full_disk(finished, on_small_disk):
    """A disk with room for a random share of what a random job makes, in many places."""
    disk, project = on_small_disk
    chance = random.Random(SEED)
    expected = Results(finished.results).digests()
    results = Results(project.results)
    for place in range(PLACES):
        while True:
            output, freed = remove_one_job(project.results, chance)
            target = str(project.results.relative_to(project.folder) / output)
            disk.remount(f"size={disk.used + int(chance.uniform(0.0, 0.9) * freed)}")
            code, printed = run(project, target)
            if code:
                break
            disk.remount("size=4g")  # it made do with less
        print(place, output, SENTENCE.findall(printed), flush=True)
        assert SENTENCE.findall(printed) and "Traceback" not in printed, printed
        found = results.digests()
        assert [name for name in found if found[name] != expected[name]] == []
        disk.remount("size=4g")
        project.snakemake(target)
        assert results.digests() == expected and results.hidden() == []
        assert project.would_run(target) == {}


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may mount a small disk")
def test_read_only_folder(finished, tmp_path):
    with SmallDisk(tmp_path / "disk") as disk:
        results = disk.folder / "results"
        disk.remount("ro")
        code, printed = run(finished, "--config", f"results={results}")
        assert code == 1 and "Traceback" not in printed
        assert len(re.findall(r"found a disk that is read-only", printed)) == 1
        assert str(results) in printed


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become another user")
def test_lost_permission(finished, tmp_path):
    """Somebody else, who may read all and write only beside the results."""
    project = Project(tmp_path / "project", finished.configuration)
    shutil.copytree(finished.folder, project.folder, symlinks=True)
    for folder in (project.folder, tmp_path, *tmp_path.parents):  # pytest makes them for one person
        if folder.stat().st_mode & 0o055 != 0o055 and folder.stat().st_uid == 0:
            folder.chmod(folder.stat().st_mode | 0o055)
    words = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups", sys.executable]
    if subprocess.run(
        [*words, "-c", "import vermilion, numpy"], env=project.environment()
    ).returncode:
        pytest.skip("other users may not read this working copy or its environment")
    code, printed = run(project, user=NOBODY)
    assert code and "Traceback" not in printed, printed
    assert "found no permission to write; expected a folder that user" in printed


LATE = """
import os, subprocess, sys
from pathlib import Path
if any(".snakemake/scripts" in word for word in sys.orig_argv):
    rename = Path.replace
    def later(self, target):
        hidden = self.with_name(f".late-{self.name}")
        rename(self, hidden)
        subprocess.Popen(["sh", "-c", 'sleep 3; mv "$0" "$1"', str(hidden), str(target)], start_new_session=True)
        return Path(target)
    Path.replace = later
"""


def test_file_system_that_shows_files_late(finished, tmp_path):
    """What a job wrote appears three seconds after its end, as on a network file system."""
    expected = Results(finished.results).digests()
    output, _ = remove_one_job(finished.results, random.Random(SEED), only_files=True)
    (tmp_path / "sitecustomize.py").write_text(LATE)
    environment = finished.environment()
    environment["PYTHONPATH"] = f"{tmp_path}{os.pathsep}{environment['PYTHONPATH']}"
    target = str(finished.results.relative_to(finished.folder) / output)
    done = subprocess.run(
        finished.command(target),
        cwd=finished.folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "Waiting at most" in done.stderr
    assert Results(finished.results).digests() == expected
    assert finished.would_run() == {}


def test_clock_set_back(finished):
    """Results from the future are used, and nothing else is made again; an image from the future is named."""
    expected = Results(finished.results).digests()
    output, _ = remove_one_job(finished.results, random.Random(SEED), only_files=True)
    target = str(finished.results.relative_to(finished.folder) / output)
    future = time.time() + 7200
    for path in finished.results.rglob("*"):
        os.utime(path, (future, future))
    finished.snakemake(target)
    assert Results(finished.results).digests() == expected
    assert finished.would_run() == {}

    image = next((finished.folder / "captures" / "s1" / "phone" / "frames").rglob("*.png"))
    os.utime(image, (future, future))
    assert finished.would_run() == {}
    manifest = sorted((finished.results / "takes/s1/phone/capture").glob("0*.json"))[0]
    kept = manifest.read_bytes()
    manifest.unlink()
    refused = finished.snakemake(check=False)
    assert refused.returncode
    assert f"{image.name}: found a time in the future" in refused.stdout + refused.stderr
    os.utime(image)
    manifest.write_bytes(kept)
    assert finished.would_run() == {}


def test_two_runs_at_once(finished):
    """The second one says who holds the folder, and leaves it alone."""
    with hold(finished.results):
        code, printed = run(finished)
        plain = finished.snakemake(check=False)
    assert code == 1 and len(printed.strip().splitlines()) == 1
    for told in (printed, plain.stderr):
        assert f"process {os.getpid()}, since 20" in told and os.uname().nodename in told
        assert "Wait until it has ended, or stop it" in told
    assert plain.returncode and finished.would_run() == {}
