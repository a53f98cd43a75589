"""The shared cache never gives one job the result of another."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.workflow.conftest import copy_project

#: Two people of one group, by number: they need no account.
PEOPLE, GROUP = (61001, 61002), 61000
#: Python's own folder may be closed to others; what a person writes is still their own.
AS_PERSON = ["--clear-groups", "--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]
MODEL = "results/tiny/face_model/tracker.npz"

SNAKEFILE = """
from vermilion.provenance.cache import roles_of, wildcards_of


rule all:
    input:
        "x.out",
        "y.out",
        "x.swapped.out",


rule made:
    input:
        first="same1.txt",
        second="same2.txt",
    output:
        "{name}.out",
    wildcard_constraints:
        name="[xy]",
    cache: True
    params:
        WC
    script:
        "made.py"


rule swapped:
    input:
        first="same2.txt",
        second="same1.txt",
    output:
        "{name}.swapped.out",
    wildcard_constraints:
        name="[xy]",
    cache: True
    params:
        WC
    script:
        "made.py"
"""
SCRIPT = """
from pathlib import Path

first = Path(snakemake.input.first).read_text()
Path(snakemake.output[0]).write_text(f"{snakemake.wildcards.name} {first}")
"""


@pytest.mark.slow
def test_jobs_that_differ_by_wildcard_or_role_do_not_share(tmp_path):
    (tmp_path / "Snakefile").write_text(
        SNAKEFILE.replace("WC", "wc=wildcards_of,\n        roles=roles_of,")
    )
    (tmp_path / "made.py").write_text(SCRIPT)
    (tmp_path / "same1.txt").write_text("one")
    (tmp_path / "same2.txt").write_text("two")
    cache = tmp_path / "cache"
    cache.mkdir()
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--cache", "made", "swapped"]
    environment = {**os.environ, "SNAKEMAKE_OUTPUT_CACHE": str(cache)}
    run = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "x.out").read_text() == "x one"
    assert (tmp_path / "y.out").read_text() == "y one"
    assert (tmp_path / "x.swapped.out").read_text() == "x two"
    assert len([p for p in cache.rglob("*") if p.is_file() and p.stat().st_size]) >= 3


def clone_of(person, folder):
    """A working copy that belongs to a person."""
    folder.mkdir()
    project = copy_project(folder)
    subprocess.run(["chown", "-R", f"{person}:{GROUP}", str(folder)], check=True)
    return project


def computed(project, person, cache):
    """Whether a person's run computes the face model, or takes it from the cache."""
    shutil.rmtree(project.results, ignore_errors=True)
    words = ["setpriv", f"--reuid={person}", f"--regid={GROUP}", *AS_PERSON]
    words += project.command(MODEL, "--cache", "--cores", "1")
    person_s = {"SNAKEMAKE_OUTPUT_CACHE": str(cache), "LOGNAME": f"person{person}"}
    home = {"HOME": str(project.folder), "XDG_CACHE_HOME": str(project.folder / "home")}
    run = subprocess.run(
        words,
        cwd=project.folder,
        env={**project.environment(), **person_s, **home},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert (project.folder / MODEL).is_symlink()
    return (project.results / "logs" / "face_model.log").stat().st_size > 0


@pytest.mark.slow
@pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("setpriv") is None, reason="to be two people needs root"
)
def test_two_people_share_what_is_the_same_and_nothing_else(tmp_path):
    cache = tmp_path / "cache"
    cache.mkdir()
    os.chown(cache, -1, GROUP)
    cache.chmod(0o2775)
    for folder in (tmp_path, *tmp_path.parents):  # pytest makes them for one person
        if folder.stat().st_mode & 0o055 == 0o055:
            break
        folder.chmod(0o755)
    first, second = (clone_of(person, tmp_path / str(person)) for person in PEOPLE)
    assert computed(first, PEOPLE[0], cache)
    assert not computed(second, PEOPLE[1], cache)
    assert (second.folder / MODEL).read_bytes() == (first.folder / MODEL).read_bytes()
    assert (first.folder / MODEL).resolve().parent == cache
    second.edit_configuration(lambda keys: keys["face_model"].update(tracker_expressions="all"))
    assert computed(second, PEOPLE[1], cache)
    module = first.folder / "src" / "vermilion" / "faces" / "model.py"
    module.write_text(module.read_text() + "\nEDITED = True\n")
    assert computed(first, PEOPLE[0], cache)
    assert not computed(first, PEOPLE[0], cache)
