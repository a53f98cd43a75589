"""A scan adds one job, and only its subject's jobs read what it makes."""

import json

import pytest

from vermilion.config.load import load_configuration
from vermilion.storage.errors import ConfigurationError

from .test_graph import jobs_of


@pytest.mark.slow
def test_a_scan_changes_the_model_of_its_subject_alone(fresh_project):
    (fresh_project.folder / "head.obj").touch()
    scans = json.dumps({"scans": {"s1": {"path": "head.obj"}}})
    run = fresh_project.snakemake("--dry-run", "--config", f"tracking={scans}")
    jobs = jobs_of(run.stdout + run.stderr)
    made_by_scan = [made for rule, _, made in jobs if rule == "scan"]
    assert [made.count("subjects/s1/") for made in made_by_scan] == [4]
    # A model from a scan has no identities for images to choose from.
    assert {rule for rule, _, made in jobs if "s1/identity.npz" in made} == {"identity"}
    for rule in ("identity", "tracking", "tracking_meshes", "correspondence", "evaluate"):
        inputs = {"s1": "", "s2": ""}
        for name, given, made in jobs:
            if name.removeprefix("image_") == rule:
                inputs["s1" if "/s1" in made else "s2"] += given
        assert "subjects/s1/tracker.npz" in inputs["s1"], rule
        assert "face_model/tracker.npz" not in inputs["s1"], rule
        assert "face_model/tracker.npz" in inputs["s2"], rule
        assert "s1/tracker.npz" not in inputs["s2"], rule
    basis = [given for rule, given, _ in jobs if rule == "features"]
    assert basis and all("face_model/tracker.npz" in given for given in basis)


def test_scans_of_nobody_and_without_landmarks_are_refused(tmp_path):
    sheet = tmp_path / "takes.tsv"
    sheet.write_text(
        "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"
        "anna\trom\tvideo\tx.mp4\t0\t9\t30\tnone\n"
    )
    raw = {
        "takes": str(sheet),
        "landmarks": {"detector": "files", "files": {"path": "{subject}.csv"}},
        "tracking": {"scans": {"ann": {"path": "ann.obj"}}},
    }
    with pytest.raises(ConfigurationError) as error:
        load_configuration(raw, "mine.yaml", check_disk=False)
    text = str(error.value)
    assert "key tracking.scans.ann: found a subject without takes; expected one of anna" in text
    assert "key tracking.scans.ann.landmarks: found nothing; expected a file" in text
