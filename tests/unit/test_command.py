"""The command `vermilion`: its subcommands, and what `doctor` finds."""

import subprocess
import sys
from pathlib import Path

import pytest

from vermilion.app import doctor, main
from vermilion.app.commands import lips
from vermilion.app.place import from_here
from vermilion.app.snakemake_command import python
from vermilion.app.subcommands import parser_of


def test_every_subcommand_has_a_line_and_a_help(capsys):
    found = main.commands()
    assert {"lips", "demo", "run", "report", "verify", "doctor", "docs"} <= set(found)
    for name, line in found.items():
        assert line.endswith("."), name
        with pytest.raises(SystemExit) as ended:
            module = f"vermilion.app.commands.{name.replace('-', '_')}"
            parser_of(module, f"vermilion {name}").parse_args(["--help"])
        assert ended.value.code == 0 and f"vermilion {name}" in capsys.readouterr().out


def test_the_list_loads_nothing_heavy():
    code = (
        "import sys; from vermilion.app.main import main; main([]); print('numpy' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.endswith("False\n")


def test_an_unknown_subcommand_lists_those_there_are(capsys):
    assert main.main(["lisp"]) == 2
    assert "lips" in capsys.readouterr().err


def test_what_a_subcommand_does_not_know_goes_to_snakemake(monkeypatch):
    given = []
    monkeypatch.setattr(lips, "run", lambda arguments: given.append(arguments) or 0)
    assert main.main(["lips", "a b.mp4", "--cores", "2", "--model", "m.h5", "-n"]) == 0
    assert given[0].video == "a b.mp4" and given[0].model == "m.h5"
    assert given[0].options == ["--cores", "2", "-n"]


def test_a_subcommand_that_passes_nothing_on_refuses_what_it_does_not_know():
    with pytest.raises(SystemExit):
        main.main(["doctor", "--colour"])


def test_an_error_of_ours_is_a_sentence(capsys, tmp_path):
    assert main.main(["lips", str(tmp_path / "none.mp4")]) == 1
    assert "found no file or folder" in capsys.readouterr().err


def test_paths_below_the_project_are_relative_to_it(tmp_path):
    assert from_here(tmp_path / "results" / "x", tmp_path) == "results/x"
    assert from_here("/elsewhere/y", tmp_path) == "/elsewhere/y"


def test_doctor_says_what_to_do(tmp_path, monkeypatch):
    assert doctor.interpreter((3, 10, 1)).state == "missing"
    assert "3.11" in doctor.interpreter((3, 10, 1)).remedy
    found = doctor.landmark_environment(tmp_path / ".venv-mediapipe")
    assert found.state == "optional" and "setup_landmarks.sh" in str(found)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert doctor.browser().state == "optional"
    monkeypatch.setenv("VERMILION_ICT_FACEKIT", str(tmp_path / "none"))
    assert doctor.face_files().state == "missing"
    assert doctor.disk(Path("/")).state in ("good", "missing")


def test_a_folder_with_a_blank_in_its_name_does_not_stop_the_workflow(tmp_path):
    project = tmp_path / "Größe x"
    project.mkdir()
    (project / "env").symlink_to(sys.prefix)
    named = python(str(project / "env" / "bin" / "python"))
    try:
        assert " " not in named
        said = subprocess.run(
            ["sh", "-c", f"{named} -c 'import numpy, sys; print(sys.executable)'"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert said.stdout.strip() == named
    finally:
        Path(named).parents[1].unlink()
    assert python("/plain/bin/python") == "/plain/bin/python"
