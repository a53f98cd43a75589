"""Another tracker's sequences as the base: its jobs take the place of our tracker's, the rest is the same."""

import json

import pytest

from .test_graph import jobs_of

pytestmark = pytest.mark.slow

#: Jobs of our own tracker.
OURS = {
    "identity", "image_identity", "tracking", "appearance", "image_fit", "image_fit_join", "offsets",
    "residuals", "ablations", "tracking_meshes",
}  # fmt: skip
#: Jobs that a sequence adds: each once a run, a subject, a take or a chunk of the tiny capture.
ADDED = {
    "tracked_topology": 3, "tracked_meshes": 5, "external_topology": 1, "external_model": 1,
    "external_identity": 2, "external_fit": 3, "external_meshes": 5,
}  # fmt: skip
#: Jobs that read the face model of the base.
READERS = (
    "external_identity", "external_fit", "external_meshes", "contours", "correspondence", "features",
    "layers", "neutral_pair", "lip_shapes", "evaluate", "apply", "apply_export",
)  # fmt: skip


def jobs(project, *, of, **tracking):
    """Rule, inputs and outputs of the jobs of the tiny capture with three sequences."""
    sheet = (project.folder / "config/takes.tiny.tsv").read_text().splitlines()
    rows = [sheet[0] + "\tof", *(line + "\t" for line in sheet[1:])]
    for subject, take in (("s1", "rom"), ("s1", "phone"), ("s2", "rom")):
        source = project.folder / f"tracks/{subject}_{take}"
        source.mkdir(parents=True, exist_ok=True)
        (source / "0000.obj").touch()
        cells = [subject, f"{take}_ft", "tracked", str(source), "0", "7", "30", "none"]
        rows.append("\t".join([*cells, take if of else ""]))
    (project.folder / "config/takes.external.tsv").write_text("\n".join(rows) + "\n")
    settings = ["--config", "takes=config/takes.external.tsv"]
    if tracking:
        settings.append(f"tracking={json.dumps(tracking)}")
    run = project.snakemake("--dry-run", *settings)
    return jobs_of(run.stdout + run.stderr)


def counted(found):
    names = [rule for rule, _, _ in found]
    return {name: names.count(name) for name in sorted(set(names))}


def test_sequences_are_the_base_of_every_stage(fresh_project):
    ours, theirs = jobs(fresh_project, of=False), jobs(fresh_project, of=True)
    before, after = counted(ours), counted(theirs)
    assert not set(ADDED) & set(before)
    assert {name: after[name] for name in ADDED} == ADDED
    assert not OURS & set(after)
    rest = {name: n for name, n in before.items() if name not in OURS}
    assert {name: n for name, n in after.items() if name not in ADDED} == rest
    for rule in READERS:
        inputs = [given for name, given, _ in theirs if name == rule]
        assert inputs and all("face_model/external.npz" in given for given in inputs), rule
    ours_read_by = {name for name, given, _ in theirs if "face_model/tracker.npz" in given}
    assert ours_read_by <= {"all", "external_topology"}
    (export,) = [given for name, given, _ in theirs if name == "apply_export"]
    assert "s1/phone/tracking/placement.npz" in export
    assert "s1/phone_ft/tracking/sequence.npz" in export


def test_weights_and_a_model_of_another_run_are_inputs(fresh_project):
    base = {"weights": "tracks/{subject}_{of}.csv"}
    for name in ("s1_rom", "s1_phone", "s2_rom"):
        (fresh_project.folder / "tracks").mkdir(exist_ok=True)
        (fresh_project.folder / f"tracks/{name}.csv").touch()
    found = jobs(fresh_project, of=True, external={"base": base})
    (model,) = [given for name, given, _ in found if name == "external_model"]
    assert "tracks/s1_rom.csv" in model and "tracks/s2_rom.csv" in model
    assert "phone" not in model  # the held-out shot teaches nothing
    (fresh_project.folder / "other.npz").touch()
    found = jobs(fresh_project, of=True, external={"base": {"model": "other.npz"}})
    assert not {"external_topology", "external_model"} & {name for name, _, _ in found}
    assert all("other.npz" in given for name, given, _ in found if name == "features")
