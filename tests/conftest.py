"""Shared fixtures."""

from __future__ import annotations

import atexit
import gc
import os
from pathlib import Path

# As the workflow does: libraries under a test start no threads of their own. Before numpy loads.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import pytest  # noqa: E402

# A process of tests holds many modules and items that never go: less often looked through for garbage,
# and not at all before they are collected.
gc.set_threshold(50_000)
gc.disable()

ROOT = Path(__file__).resolve().parents[1]
#: The file that makes the tiny run begins. Files that wait for that run come last, the longest of them first;
#: a process with one or two tests left takes a further file at once: two long single tests do not stand together.
_BEGIN = "test_faults"
_LONG = ("test_chunks", "test_guided", "test_failed_takes", "test_reruns")


def pytest_collection_modifyitems(items):
    """Order the files for processes that each take one at a time (`-n 2 --dist loadfile`)."""
    waiting = {item.path for item in items if "finished" in item.fixturenames}

    def place(item):
        if item.path not in waiting:
            return 0
        name = item.path.stem
        if name == _BEGIN:
            return -1
        return 1 + (_LONG.index(name) if name in _LONG else len(_LONG))

    items.sort(key=place)


def pytest_collection_finish():
    gc.freeze()
    gc.enable()
    atexit.register(gc.unfreeze)  # not before: all would be looked through twice


@pytest.fixture(scope="session")
def data_root() -> Path:
    """The optional data folder; the test is skipped, with the reason, where it is absent."""
    folder = Path(os.environ.get("VERMILION_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"optional data not found at {folder} (set VERMILION_DATA)")
    return folder
