"""From measures to tables, figures and the summary page."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stages.evaluation.conftest import CFG, SUBJECT
from tests.stages.evaluation.test_measures import reconstruction, values
from tests.stages.run_script import run_script
from vermilion.draw import to_display
from vermilion.images import write_srgb8
from vermilion.tables import read_table

pytestmark = pytest.mark.slow


def test_tables_figures_and_page(scene):
    root, out = scene.root, reconstruction(scene)
    ev = root / "evaluation"
    run_script(
        "measures",
        params={"cfg": CFG, "takes": [{"take": "ana/rom", "role": "tattoo"}]},
        input={
            "takes": [ev / "truth/sums.npz"],
            "seconds": [ev / "truth/seconds.tsv"],
            "reconstructions": [out / "sums.npz"],
            "tables": [ev / "truth/measures.tsv", out / "measures.tsv"],
        },
        output={
            "measures": ev / "measures.tsv",
            "kinds": ev / "kinds.tsv",
            "table1": ev / "table1.tsv",
            "picture": ev / "table1.png",
        },
    )
    table = read_table(ev / "table1.tsv")
    together = table[table["subject"] == "all"].set_index("regressor")["mean_mm"]
    assert together["PS"] == pytest.approx(values(root, "truth")["PS-ana"], abs=1e-6)
    run_script(
        "evaluation_figures",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={"cfg": CFG},
        input={"maps": ev / "truth/maps.npz", "frames": ev / "truth/frames.tsv"},
        output={"maps": ev / "error_maps.png", "curves": ev / "curves.png"},
    )
    run_script(
        "quality",
        input={"tables": [ev / "truth/quality.tsv"]},
        output={"flagged": root / "quality.tsv"},
    )
    write_page(root, ev)
    page = (ev / "summary.html").read_text(encoding="utf-8")
    assert "not tracked, so not measured" in page
    assert "PS-ana" in page
    assert 'src="http' not in page
    assert page.count("data:image/") >= 4


def write_page(root, ev):
    overlay = root / "overlay.png"
    write_srgb8(overlay, to_display(np.full((20, 30, 3), 0.5)))
    run_script(
        "summary",
        params={
            "cfg": {"evaluation.figures.embed_video_mb": 1.0, "evaluation.measures": {"seed": 0}},
            "names": {
                "maps": ["ana/rom"],
                "training": ["MS"],
                "overlays": [["tracking", "ana/rom"]],
                "videos": [],
                "timelines": [],
            },
            "frames": [
                {
                    "take": "ana/rom",
                    "role": "tattoo",
                    "frames": 40,
                    "held_out": 11,
                    "against": "truth",
                }
            ],
        },
        input={
            "measures": ev / "measures.tsv",
            "kinds": ev / "kinds.tsv",
            "table1": ev / "table1.tsv",
            "picture": ev / "table1.png",
            "quality": root / "quality.tsv",
            "maps": [ev / "error_maps.png"],
            "curves": [ev / "curves.png"],
            "training": [root / "models/MS.cv.png"],
            "overlays": [overlay],
            "videos": [],
            "timelines": [],
        },
        output={"page": ev / "summary.html"},
    )
