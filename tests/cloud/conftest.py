"""A store and a cluster on this machine that speak the protocols of S3 and Kubernetes; `make test-cloud`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import yaml

from tests.workflow.conftest import copy_project

#: The packages that tools/setup_cloud.sh fetched; without the variable nothing is collected.
PACKAGES = Path(os.environ.get("VERMILION_CLOUD", "")).absolute()
if "VERMILION_CLOUD" not in os.environ:
    collect_ignore_glob = ["test_*.py"]
PORT, BUCKET = 5055, "facility"
HERE = Path(__file__).resolve().parent


def environment(project: Path) -> dict[str, str]:
    """Of a process that has the project's library and the packages for clouds."""
    paths = os.pathsep.join([str(PACKAGES), str(project / "src")])
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    keys = {"AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret"}
    region = {"AWS_DEFAULT_REGION": "us-east-1"}
    return {**os.environ, **keys, **region, "PYTHONPATH": paths, "PATH": programs}


@pytest.fixture
def project(tmp_path):
    """A copy of the project in which nothing has run."""
    (tmp_path / "project").mkdir()
    return copy_project(tmp_path / "project")


@pytest.fixture(scope="session")
def store():
    """Address of a server that speaks S3, with an empty bucket."""
    notes = Path(f"{PACKAGES}.unavailable")
    if notes.exists():
        pytest.skip(notes.read_text().strip())
    words = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(PORT)]
    with open(os.devnull, "w") as nothing:
        server = subprocess.Popen(words, env=environment(Path("/")), stdout=nothing, stderr=nothing)
    address = f"http://127.0.0.1:{PORT}"
    try:
        for _ in range(300):
            try:
                request = urllib.request.Request(f"{address}/{BUCKET}", method="PUT")
                urllib.request.urlopen(request).close()
                break
            except OSError:
                time.sleep(0.2)
        yield address
    finally:
        server.kill()
        server.wait()


def storage(address: str, folder: str) -> list[str]:
    """Options for a folder in the bucket of a store."""
    return [
        *("--default-storage-prefix", f"s3://{BUCKET}/{folder}"),
        *("--storage-s3-endpoint-url", address),
        *("--storage-s3-access-key", "key"),
        *("--storage-s3-secret-key", "secret"),
    ]


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Options by which each job starts in an empty folder, with what it is sent and what it fetches alone.

    The environment of the programs is the only thing that jobs share with the machine that starts them.
    """
    machines = tmp_path / "machines"
    machines.mkdir()
    monkeypatch.setenv("MACHINES", str(machines))
    return [
        *("--executor", "cluster-generic", "--job-deploy-sources", "--jobs", "2"),
        *("--cluster-generic-submit-cmd", str(HERE / "submit.sh")),
        *("--cluster-generic-status-cmd", str(HERE / "status.sh")),
        *("--seconds-between-status-checks", "1"),
    ]


class Cluster(ThreadingHTTPServer):
    """What a Kubernetes that fails every job is asked for."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), _Answers)
        self.created: list[dict] = []


class _Answers(BaseHTTPRequestHandler):
    server: Cluster

    def _answer(self, content: dict) -> None:
        body = json.dumps(content).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self):
        content = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.created.append(content)
        self._answer(content)

    def do_GET(self):
        failed = {"status": {"failed": 1}, "metadata": {"name": "job"}}
        self._answer({"items": []} if "/pods" in self.path else failed)

    def do_DELETE(self):
        self._answer({"status": "Success"})

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def kubernetes(tmp_path, monkeypatch):
    """A cluster that remembers what it is asked to run."""
    cluster = Cluster()
    threading.Thread(target=cluster.serve_forever, daemon=True).start()
    here = {"cluster": {"server": f"http://127.0.0.1:{cluster.server_port}"}, "name": "here"}
    content = {
        "apiVersion": "v1", "kind": "Config", "current-context": "here", "clusters": [here],
        "contexts": [{"name": "here", "context": {"cluster": "here", "user": "me"}}],
        "users": [{"name": "me", "user": {}}],
    }  # fmt: skip
    (tmp_path / "kube.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.setenv("KUBECONFIG", str(tmp_path / "kube.yaml"))
    yield cluster
    cluster.shutdown()
