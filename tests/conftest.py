"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

# As the workflow does: libraries under a test start no threads of their own. Before numpy loads.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import pytest  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]


def pytest_collection_modifyitems(items):
    """Share out the tests among processes (`-n 2 --dist loadgroup`) without making fixtures twice.

    A file's tests stay together, and so do all that use the finished run of the tiny capture; these
    take longest and begin.
    """
    for item in items:
        group = "finished" if "finished" in item.fixturenames else item.path.stem
        item.add_marker(pytest.mark.xdist_group(group))
    items.sort(key=lambda item: "finished" not in item.fixturenames)


@pytest.fixture(scope="session")
def data_root() -> Path:
    """The optional data folder; the test is skipped, with the reason, where it is absent."""
    folder = Path(os.environ.get("VERMILION_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"optional data not found at {folder} (set VERMILION_DATA)")
    return folder
