"""What `make` refuses before it sets anything up."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="no make")


def make(*words, folder=PROJECT):
    """`make -n` as a user starts it, who may be running these tests through another make."""
    names = [name for name in os.environ if name.startswith(("MAKE", "MFLAGS", "GNUMAKEFLAGS"))]
    environment = {name: value for name, value in os.environ.items() if name not in names}
    return subprocess.run(
        ["make", "-n", "--no-print-directory", *words], cwd=folder, env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_misspelt_variable_is_refused_with_those_there_are():
    run = make("lips", "VIDEO=README.md", "MODELS=generic")
    assert run.returncode and "Nothing here reads MODELS" in run.stderr
    assert "MODEL" in run.stderr and run.stdout == ""


@pytest.mark.parametrize("words", [(), ("VIDEO=",), ("VIDEO= ",)])
def test_lips_without_a_video_asks_for_one_before_the_set_up(words):
    run = make("lips", *words)
    assert run.returncode and "Name a video: make lips VIDEO=clip.mp4" in run.stderr
    assert run.stdout == ""


def test_a_video_that_is_not_there_stops_before_the_set_up(tmp_path):
    run = make("lips", "VIDEO=not there.mp4")
    assert run.returncode and "no file or folder not there.mp4" in run.stderr
    clip = tmp_path / "a clip (1).mp4"
    clip.write_bytes(b"")
    assert make("lips", f"VIDEO={clip}").returncode == 0


@pytest.mark.parametrize(
    "words",
    [
        (
            "lips",
            "VIDEO=README.md",
            "MODEL=generic",
            "SCAN=a.obj",
            "EYES=63",
            "OUT=b",
            "FIRST=1",
            "LAST=2",
        ),
        ("generic", "PEOPLE=2"),
        ("plates", "CONFIG=a.yaml", "TAKE=s/t", "FORMAT=png", "OUT=b"),
        ("setup", "PYTHON=python3", "VENV=/x/venv", "PIP_INDEX_URL=x", "UV_NO_INDEX=1"),
        (
            "setup",
            "https_proxy=x",
            "VERMILION_CACHE=/x",
            "PYTHONDONTWRITEBYTECODE=",
            "SHELL=/bin/sh",
        ),
        ("-j", "2", "-O", "lint", "docs"),
        ("help",),
        ("-e", "help"),
    ],
)
def test_the_variables_that_it_reads_are_taken(words):
    run = make(*words)
    assert run.returncode == 0, run.stderr


def test_variables_of_a_make_above_are_not_refused(tmp_path):
    (tmp_path / "Makefile").write_text(f"all:\n\t+$(MAKE) -n -C '{PROJECT}' help\n")
    run = make("all", "COLOUR=red", folder=tmp_path)
    assert run.returncode == 0, run.stderr
