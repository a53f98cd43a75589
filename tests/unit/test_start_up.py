"""Every job is a process of its own: it imports what it uses, not what some other job would use."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "workflow" / "scripts"
SLOW = ("matplotlib", "numba", "pandas", "scipy.optimize", "scipy.stats", "sklearn")
JOBS = (
    "capture/capture",
    "landmarks/landmarks_views",
    "multiview/multiview_refine",
    "tracking/residuals",
)
#: Loads one script after the other, then a model's reader; says what each has added to the process.
LOAD = """
import json, runpy, sys
added, before = {}, set()
for name in sys.argv[1:]:
    if name.endswith(".py"):
        runpy.run_path(name)
    else:
        __import__(name)
    added[name] = sorted(set(sys.modules) - before)
    before = set(sys.modules)
print(json.dumps(added))
"""
MODEL = "vermilion.regression.model"


def path_of(job: str) -> str:
    return str(SCRIPTS / f"{job}.py")


@pytest.fixture(scope="module")
def added() -> dict[str, list[str]]:
    """Script or module -> what it loads that those before it have not loaded yet."""
    words = [sys.executable, "-c", LOAD, *map(path_of, JOBS), MODEL]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def test_the_first_job_loads_all_that_it_stands_on(added):
    assert {"numpy", "vermilion.storage.errors"} <= set(added[path_of(JOBS[0])])


@pytest.mark.parametrize("job", JOBS)
def test_a_job_without_tables_and_plots_starts_without_their_libraries(job, added):
    assert not set(SLOW) & set(added[path_of(job)])


def test_a_regressor_is_read_without_scikit_learn(added):
    assert MODEL in added[MODEL]
    assert not {"sklearn", "pandas", "scipy.stats"} & set(added[MODEL])
