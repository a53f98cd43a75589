"""What `make test-interchange` asks other programs; `make test` leaves it out."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: The environment that tools/setup_interchange.sh made; without the variable nothing is collected.
ENVIRONMENT = Path(os.environ.get("VERMILION_INTERCHANGE", "")).absolute()
if "VERMILION_INTERCHANGE" not in os.environ:
    collect_ignore_glob = ["test_*.py"]


def require(path: Path) -> Path:
    """Skip with the reason of the environment where a part of it is not there."""
    if not path.exists():
        notes = Path(f"{ENVIRONMENT}.unavailable")
        reason = notes.read_text().strip() if notes.exists() else f"{path} is missing"
        pytest.skip(reason)
    return path


@pytest.fixture(scope="session")
def scene(tmp_path_factory) -> Path:
    """The exported files, written by this project's interpreter; Alembic where there is one."""
    folder = tmp_path_factory.mktemp("scene") / "take"
    paths = [ROOT / "src", ROOT, ENVIRONMENT / "alembic"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))}
    subprocess.run(
        [sys.executable, "-m", "tests.interchange.scene", folder],
        check=True,
        cwd=ROOT,
        env=environment,
    )
    return folder
