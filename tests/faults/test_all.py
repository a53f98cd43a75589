"""How many malformed inputs there are, and what the heavy ones cost in a process of their own."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.faults.case import MOST_BYTES, MOST_SECONDS
from tests.faults.memory import MODULES, cases


def test_there_are_at_least_a_hundred_and_each_has_its_own_name():
    names = [f"{module}: {case.name}" for module in MODULES for case in cases(module)]
    assert len(names) == len(set(names)) >= 100


@pytest.mark.slow
def test_heavy_inputs_stay_under_a_gigabyte_in_a_process_of_their_own():
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults.memory"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert len(rows) == sum(case.heavy for module in MODULES for case in cases(module))
    assert {name: int(peak) >> 20 for peak, _, name in rows if int(peak) > MOST_BYTES} == {}
    assert {name: seconds for _, seconds, name in rows if float(seconds) > MOST_SECONDS} == {}
