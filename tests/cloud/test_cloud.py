"""Without a shared file system: results in a bucket are those of a local run; a job of Kubernetes asks for what its rule does."""

import json
import subprocess
import sys

import pytest

from tests.cloud.conftest import BUCKET, environment, storage

pytestmark = pytest.mark.slow
#: What two runs have not in common: logs, times and memory of jobs, measured seconds, the ledger of local results,
#: Snakemake's own time stamps.
OF_THE_RUN = ("/logs/", "/benchmarks/", "/seconds.tsv", "/checksums.tsv", ".snakemake_timestamp")
FETCH = """
import sys
from pathlib import Path
import boto3

bucket = boto3.resource("s3", endpoint_url=sys.argv[1]).Bucket(sys.argv[2])
for item in bucket.objects.filter(Prefix=sys.argv[3] + "/results/"):
    path = Path(item.key)
    path.parent.mkdir(parents=True, exist_ok=True)
    bucket.download_file(item.key, str(path))
"""


def run(project, *options):
    """Run Snakemake in a copy of the project."""
    words = project.command("--config", "chunk_frames=8", *options)
    return subprocess.run(
        words, cwd=project.folder, env=environment(project.folder), capture_output=True, text=True
    )


def in_bucket(address, folder):
    """Options of a run whose results lie in a folder of the bucket."""
    return ["--workflow-profile", "profiles/cloud", "--retries", "0", *storage(address, folder)]


def fetched(address, folder, into):
    """Fetch the results in a folder of the bucket; the folder that they lie in."""
    into.mkdir()
    words = [sys.executable, "-c", FETCH, address, BUCKET, folder]
    subprocess.run(words, cwd=into, env=environment(into), check=True)
    return into / folder


def said(ended, machines):
    """What a run and its failed jobs said last."""
    failed = [path for path in machines.glob("*.code") if path.read_text().strip() != "0"]
    logs = "".join(path.with_suffix(".log").read_text()[-3000:] for path in failed)
    return ended.stderr[-4000:] + logs


def results_of(folder):
    """Name -> bytes of the results of a run, without what is of the run itself."""
    names = {path.relative_to(folder).as_posix(): path for path in folder.glob("results/**/*")}
    return {
        name: path.read_bytes()
        for name, path in names.items()
        if path.is_file() and not any(part in f"/{name}" for part in OF_THE_RUN)
    }


def test_jobs_that_have_their_inputs_alone_make_what_a_local_run_makes(
    project, store, elsewhere, tmp_path
):
    """All stages of the tiny capture: a file that a rule opens and does not name would be missing."""
    there = run(project, *in_bucket(store, "whole"), *elsewhere)
    assert there.returncode == 0, said(there, tmp_path / "machines")
    found = results_of(fetched(store, "whole", tmp_path / "fetched"))
    project.results.unlink()  # it led to the local copies
    here = run(project)
    assert here.returncode == 0, here.stderr[-4000:]
    made = results_of(project.folder)
    assert len(found) > 700
    assert set(found) == set(made)
    assert {name for name in found if found[name] != made[name]} == set()


def test_captures_of_the_user_are_read_where_they_lie(project, store, elsewhere, tmp_path):
    """As from a volume that all jobs mount: neither captures nor the user's other files are in the bucket."""
    made = run(project, "--", "results/tiny/takes/s1/plain/capture/000000-000000.json")
    assert made.returncode == 0, made.stderr[-4000:]
    volume = tmp_path / "volume"
    (project.results / "captures").rename(volume)
    sheet = (project.folder / "config" / "takes.tiny.tsv").read_text()
    named = sheet.replace("s1\tplain\tplain\tstudio", f"s1\tplain\tplain\t{volume}/s1/plain")
    (project.folder / "given.tsv").write_text(named)
    given = ["results=results/given", "takes=given.tsv"]
    target = ["--", "results/given/takes/s1/plain/cameras"]
    there = run(project, *given, *in_bucket(store, "given"), *elsewhere, *target)
    assert there.returncode == 0, said(there, tmp_path / "machines")
    found = results_of(fetched(store, "given", tmp_path / "fetched"))
    (project.folder / "results" / "given").unlink()
    here = run(project, *given, *target)
    assert here.returncode == 0, here.stderr[-4000:]
    assert any(name.endswith("cameras.txt") for name in found)
    assert not any("captures" in name for name in found)
    made = results_of(project.folder)
    assert found == {name: made[name] for name in made if name.startswith("results/given/")}


def test_corrections_of_a_studio_take_are_refused(project, store):
    guided = json.dumps({"takes": {"s1/phone": "base"}})
    ended = run(
        project,
        *(f"guided={guided}", *in_bucket(store, "refused"), "--executor", "local"),
        *("--", "results/tiny/takes/s1/plain/cameras"),
    )
    assert ended.returncode != 0
    assert "guided.takes: found s1/phone, a take of the studio" in ended.stderr


def test_a_job_of_kubernetes_asks_for_what_its_rule_does(project, store, kubernetes):
    ended = run(
        project,
        *("--workflow-profile", "profiles/kubernetes", "--retries", "0", "--jobs", "4"),
        *storage(store, "rendered"),
        "--",
        "results/tiny/face_model/studio.npz",
    )
    jobs = [item for item in kubernetes.created if item.get("spec")]
    assert len(jobs) == 1, ended.stdout + ended.stderr
    (container,) = jobs[0]["spec"]["template"]["spec"]["containers"]
    assert container["image"] == "YOUR-REGISTRY/vermilion:latest"
    asked = container["resources"]
    assert asked["requests"]["memory"] == asked["limits"]["memory"] == "3000M"
    command = " ".join(container["command"] + container.get("args", []))
    assert "face_model:" in command and "s3://facility/rendered" in command
    assert str(project.folder) not in command
    assert ended.returncode != 0  # this cluster fails every job
