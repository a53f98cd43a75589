"""The graph of jobs: truth stays in the evaluation, and parameters hold what a rule reads."""

import io
import json
import re

import pytest

from vermilion.app.workflow import run_workflow
from vermilion.provenance.fingerprint import imported_files

from .conftest import ROOT, Project

RULES = sorted((ROOT / "workflow" / "rules").glob("*.smk"))
SCRIPTS = sorted((ROOT / "workflow" / "scripts").rglob("*.py"))
#: Rules that measure.
MEASURING = {"evaluate", "evaluate_reconstruction"}


def jobs_of(printed: str) -> list[tuple[str, str, str]]:
    """(rule, inputs, outputs) of every job that a dry run prints."""
    pattern = r"^(?:local)?rule (\w+):\n((?:    .+\n)+)"
    jobs = []
    for rule, body in re.findall(pattern, printed, flags=re.MULTILINE):
        fields = dict(re.findall(r"^    (\w+): (.*)$", body, flags=re.MULTILINE))
        jobs.append((rule, fields.get("input", ""), fields.get("output", "")))
    return jobs


@pytest.fixture(scope="module")
def planned(fresh_project):
    """(rule, inputs, outputs) of every job of the tiny capture."""
    run = fresh_project.snakemake("--dry-run")
    jobs = jobs_of(run.stdout + run.stderr)
    assert len(jobs) > 50
    return jobs


@pytest.mark.slow
def test_only_the_evaluation_reads_truth(planned):
    readers = {rule for rule, inputs, _ in planned if "/truth/" in inputs}
    writers = {rule for rule, _, outputs in planned if "/truth/" in outputs}
    assert readers == MEASURING
    assert writers and all(rule.startswith("studio_rig_") for rule in writers)


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["scan", "guided"])
def test_without_scans_or_takes_to_be_corrected_there_is_no_such_job(planned, rule):
    assert not [name for name, _, _ in planned if name.startswith(rule)]


@pytest.mark.slow
def test_only_the_evaluation_reads_external_truth(fresh_project, data_root):
    if (ROOT / "../shared/data").resolve() != data_root.resolve():
        pytest.skip("config/sample.yaml names ../shared/data, the data lie elsewhere")
    link = fresh_project.folder.parent / "shared"
    if not link.exists():
        link.mkdir()
        (link / "data").symlink_to(data_root.resolve())
    run = Project(fresh_project.folder, "config/sample.yaml").snakemake("--dry-run")
    jobs = jobs_of(run.stdout + run.stderr)
    assert {rule for rule, inputs, _ in jobs if "capture-sample-truth" in inputs} == MEASURING


@pytest.mark.slow
def test_contours_wait_for_the_track_unless_labels_count_as_drawn(fresh_project, planned):
    contours = json.dumps({"detector": {"kind": "boosted"}})
    run = fresh_project.snakemake("--dry-run", "--config", f"contours={contours}")
    for jobs, follow in ((planned, True), (jobs_of(run.stdout + run.stderr), False)):
        for rule in ("contour_detector", "contours"):
            inputs = [inputs for name, inputs, _ in jobs if name == rule]
            assert inputs and all(("/tracking/C/" in found) == follow for found in inputs)


def test_a_change_of_the_evaluation_reruns_nothing_that_comes_before_it():
    measuring = {
        path.stem
        for path in SCRIPTS
        if any(found.parent.name == "evaluation" for found in imported_files(path))
    }
    assert measuring == {
        "evaluate", "evaluate_reconstruction", "guided_evaluate", "measures", "summary",
    }  # fmt: skip


def test_no_script_reads_configuration_or_other_paths_by_itself():
    for path in SCRIPTS:
        text = path.read_text()
        assert "snakemake.config" not in text, path.name
        assert not re.search(r"results/|yaml", text), path.name


def rules_in(path):
    """(name, body) of the rules of a file."""
    return re.findall(r"^ *rule (\w*):\n((?:(?: +.*)?\n)+)", path.read_text(), flags=re.MULTILINE)


@pytest.mark.parametrize("path", RULES, ids=lambda p: p.stem)
def test_every_rule_has_log_resources_and_fingerprint(path):
    for name, body in rules_in(path):
        assert "log:" in body, f"{path.name}: {name}"
        assert "mem_mb" in body and "runtime" in body, f"{path.name}: {name}"
        assert "code=code_of(" in body, f"{path.name}: {name}"
        if "cache:" in body:
            assert "wc=wildcards_of" in body and "roles=roles_of" in body, f"{path.name}: {name}"
        else:
            assert "benchmark:" in body, f"{path.name}: {name}"


#: Ways to wait for images: in a bucket, each also gives the images themselves.
WAITS = (
    "mono_images", "chunk_images", "captured_take", "captured_chunk", "captured_neutral", "window_images",
    "images_of", "capture_inputs", "landmark_model_inputs", "exports_need", "files_around",
)  # fmt: skip


@pytest.mark.parametrize("path", RULES, ids=lambda p: p.stem)
def test_a_rule_that_is_told_where_images_lie_finds_them_in_a_bucket_too(path):
    for body in re.split(r"^ *rule ", path.read_text(), flags=re.MULTILINE)[1:]:
        name, (inputs, _, rest) = body.partition(":")[0], body.partition(" output:")
        params = rest.partition(" params:")[2]
        if re.search(r"^ *source=|\"source\":", params, re.M):
            assert any(way in inputs for way in WAITS), f"{path.name}: {name}"
        if "P.manifest" in inputs:
            assert "captured_take" in inputs, f"{path.name}: {name}"


def test_no_function_of_a_rule_file_replaces_another():
    """All rule files share one namespace: the later of two functions of a name serves both."""
    found = [name for path in RULES for name in re.findall(r"^def (\w+)\(", path.read_text(), re.M)]
    assert sorted(found) == sorted(set(found))


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.stem)
def test_a_script_is_run_by_one_rule_with_its_own_fingerprint(path):
    text = "".join(rule.read_text() for rule in RULES)
    assert (
        text.count(f'"../scripts/{path.parent.name}/{path.name}"')
        == text.count(f'code_of("{path.parent.name}/{path.stem}")')
        >= 1
    )


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.stem)
def test_a_key_that_a_script_reads_is_listed_by_its_rule(path):
    read = set(re.findall(r'cfg\["([a-z_]+\.[a-z_.]+)"\]', path.read_text()))
    files = "".join(rules.read_text() for rules in RULES)
    for body in re.split(r"^ *rule ", files, flags=re.MULTILINE)[1:]:
        if f"/{path.parent.name}/{path.name}" not in body or "cfg=cfg_of(" not in body:
            continue
        for shared in re.findall(r"\*([A-Z_]+)", body):  # keys of several rules: a tuple
            body += re.search(rf"^{shared} = .*(?:\n    .*|\n[)\]])*", files, re.MULTILINE)[0]
        listed = set(re.findall(r'"([a-z_.]+)"', body))  # or only the last part, below one section
        assert {key for key in read if not listed & {key, key.rpartition(".")[2]}} == set()


@pytest.mark.slow
def test_wrong_configuration_stops_before_any_job(fresh_project):
    run = fresh_project.snakemake("--config", "chunk_frames=none", "results=", check=False)
    printed = run.stdout + run.stderr
    assert run.returncode != 0
    assert "2 problem(s) in the configuration" in printed
    assert "key chunk_frames: found" in printed and "key results: found" in printed
    assert "Job stats" not in printed


@pytest.mark.slow
def test_a_detector_that_nothing_trains_is_one_sentence_where_landmarks_are_needed(
    fresh_project, tmp_path, monkeypatch
):
    without = ("--config", "landmarks={training_takes: []}")
    assert "captures" in fresh_project.would_run("captures", *without)
    monkeypatch.chdir(fresh_project.folder)
    monkeypatch.setenv("PYTHONPATH", fresh_project.environment()["PYTHONPATH"])
    terminal = io.StringIO()
    assert run_workflow(fresh_project.command(*without), tmp_path / "s.log", stream=terminal) == 1
    told = terminal.getvalue().partition("\n\n")[2].strip().splitlines()
    assert "config/tiny.yaml, key landmarks.training_takes: found none; expected" in told[0]
    assert told[0].endswith("`mediapipe` is for real faces.")
    assert told[1:] == [f"Log: {tmp_path / 's.log'}"]


@pytest.mark.slow
def test_a_measured_person_has_a_face_model_of_their_size(tmp_path, fresh_project):
    """One job more, of that person alone; what is tracked of them reads it."""
    lines = (ROOT / "config" / "takes.tiny.tsv").read_text().splitlines()
    measured = "s1\tphone\t"
    rows = [line + ("\t62.5" if line.startswith(measured) else "\t") for line in lines[1:]]
    sheet = tmp_path / "takes.tsv"
    sheet.write_text("\n".join([lines[0] + "\teye_distance_mm", *rows]) + "\n")
    run = fresh_project.snakemake("--dry-run", "--config", f"takes={sheet}")
    jobs = jobs_of(run.stdout + run.stderr)
    own = [outputs for rule, _, outputs in jobs if rule == "sized_tracker"]
    assert len(own) == 1 and "/subjects/s1/tracker.npz" in own[0]
    readers = {rule for rule, inputs, _ in jobs if "/subjects/s1/tracker.npz" in inputs}
    assert {"tracking", "tracking_meshes", "evaluate"} <= readers
