"""The notebook of the documentation runs on a finished capture, cell by cell."""

import json

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pytest

from .conftest import ROOT


@pytest.mark.slow
def test_the_notebook_runs_on_a_finished_run(finished, monkeypatch, capsys):
    monkeypatch.setenv("VERMILION_RESULTS", str(finished.results))
    drawn = []
    monkeypatch.setattr(plt, "show", lambda: (drawn.append(plt.gcf()), plt.close("all")))
    notebook = json.loads((ROOT / "docs" / "notebooks" / "corrected_lips.ipynb").read_text())
    names: dict = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [], "outputs are not committed"
            exec("".join(cell["source"]), names)
    assert len(drawn) == 3
    assert "no correction" in capsys.readouterr().out
