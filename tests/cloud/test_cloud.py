"""Without a shared file system: results in a bucket are those of a local run; a job of Kubernetes asks for what its rule does."""

import subprocess
import sys

import pytest

from tests.cloud.conftest import BUCKET, environment, storage

pytestmark = pytest.mark.slow
#: Rendered images, cameras, labels, truth; the checked manifest of a take.
TARGETS = [
    "results/tiny/captures/s1/plain/frames/face2/000000.png",
    "results/tiny/takes/s1/plain/capture/000000-000000.json",
]
FETCH = """
import sys
from pathlib import Path
import boto3

bucket = boto3.resource("s3", endpoint_url=sys.argv[1]).Bucket(sys.argv[2])
for item in bucket.objects.filter(Prefix="captures/"):
    path = Path(item.key)
    path.parent.mkdir(parents=True, exist_ok=True)
    bucket.download_file(item.key, str(path))
"""


def run(project, *options):
    words = [*project.command("--cores", "1", "--config", "chunk_frames=8", *options)]
    return subprocess.run(
        words, cwd=project.folder, env=environment(project.folder), capture_output=True, text=True
    )


def fetched(address, folder):
    """Name -> bytes, of every result in the bucket."""
    folder.mkdir()
    words = [sys.executable, "-c", FETCH, address, BUCKET]
    subprocess.run(words, cwd=folder, env=environment(folder), check=True)
    root = folder / "captures"
    return {
        path.relative_to(root).as_posix(): path.read_bytes()
        for path in root.rglob("*")
        if path.is_file()
    }


def test_results_in_a_bucket_are_those_of_a_local_run(project, store, tmp_path):
    there = run(
        project,
        *("--workflow-profile", "profiles/cloud", "--executor", "local"),
        *storage(store, "captures"),
        "--",
        *TARGETS,
    )
    assert there.returncode == 0, there.stderr[-4000:]
    found = fetched(store, tmp_path / "fetched")
    project.results.unlink()  # it led to the local copies
    here = run(project, "--", *TARGETS)
    assert here.returncode == 0, here.stderr[-4000:]
    skipped = ("logs/", "benchmarks/", ".snakemake_timestamp")
    results = {
        name: content for name, content in found.items() if not any(s in name for s in skipped)
    }
    assert len(results) > 20
    assert {
        name for name, content in results.items() if (project.folder / name).read_bytes() != content
    } == set()


def test_a_stage_that_reads_more_than_its_inputs_is_refused(project, store):
    ended = run(
        project,
        *("--workflow-profile", "profiles/cloud", "--executor", "local"),
        *storage(store, "refused"),
        "--",
        "results/tiny/takes/s1/plain/cameras",
    )
    assert ended.returncode != 0
    assert "rule cameras opens files that the graph does not name" in ended.stderr


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
