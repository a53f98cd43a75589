"""Every job is a process of its own: it imports what it uses, not what some other job would use."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "workflow" / "scripts"
SLOW = ("matplotlib", "numba", "pandas", "scipy.optimize", "scipy.stats", "sklearn")
LOAD = "import runpy, sys; runpy.run_path(sys.argv[1]); print(*sys.modules)"


@pytest.mark.parametrize(
    "script",
    [
        "capture/capture",
        "landmarks/landmarks_views",
        "multiview/multiview_refine",
        "tracking/residuals",
    ],
)
def test_a_job_without_tables_and_plots_starts_without_their_libraries(script):
    words = [sys.executable, "-c", LOAD, str(SCRIPTS / f"{script}.py")]
    loaded = subprocess.run(words, check=True, capture_output=True, text=True).stdout.split()
    assert "numpy" in loaded
    assert not set(SLOW) & set(loaded)


def test_a_regressor_is_read_without_scikit_learn():
    words = [sys.executable, "-c", "import vermilion.regression.model, sys; print(*sys.modules)"]
    loaded = subprocess.run(words, check=True, capture_output=True, text=True).stdout.split()
    assert not {"sklearn", "pandas", "scipy.stats"} & set(loaded)
