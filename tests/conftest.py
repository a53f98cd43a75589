"""Shared fixtures."""

from __future__ import annotations

import os
from pathlib import Path

# As the workflow does: libraries under a test start no threads of their own. Before numpy loads.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import pytest  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
#: The file that takes longest begins; those that wait for what it makes come last.
_BEGIN, _END = ("test_faults",), ("test_reruns", "test_chunks")


def pytest_collection_modifyitems(items):
    """Order the files for processes that each take one at a time (`-n 2 --dist loadfile`)."""
    items.sort(key=lambda item: (item.path.stem not in _BEGIN) + (item.path.stem in _END))


@pytest.fixture(scope="session")
def data_root() -> Path:
    """The optional data folder; the test is skipped, with the reason, where it is absent."""
    folder = Path(os.environ.get("VERMILION_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"optional data not found at {folder} (set VERMILION_DATA)")
    return folder
