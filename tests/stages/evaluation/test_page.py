"""From measures to tables, figures and the summary page."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.stages.evaluation.conftest import CFG, MODELS, SUBJECT
from tests.stages.evaluation.test_measures import reconstruction, values
from tests.stages.lip_scene import CHUNKS, TEST
from tests.stages.run_script import run_script
from vermilion.imaging.draw import to_display
from vermilion.imaging.images import write_srgb8
from vermilion.report.headline import closing_table
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow


#: Tables and figures of all takes together, file names by output.
TOGETHER = {
    "measures": "measures.tsv", "seconds": "seconds.tsv", "kinds": "kinds.tsv", "table1": "table1.tsv", "table2": "table2.tsv",
    "table3": "table3.tsv", "comparisons": "comparisons.tsv", "headline": "headline.tsv", "estimators": "estimators.tsv",
    "image": "table1.png", "figure16": "figure16.png",
}  # fmt: skip
#: Images of a take.
SHEETS = {
    "maps": "error_maps.png", "renders": "renders.png", "stretch": "stretch.png",
    "curves": "curves.png",
}  # fmt: skip


@pytest.fixture(scope="module")
def tables(scene):
    """The evaluation folder with all tables and images but the page."""
    root, out = scene.root, reconstruction(scene)
    ev = root / "evaluation"
    run_script(
        "evaluation/measures",
        params={
            "cfg": CFG | {"training.regressor": "kernel"},
            "takes": [{"take": "ana/rom", "role": "tattoo"}],
        },
        input={
            "takes": [ev / "truth/sums.npz"],
            "seconds": [ev / "truth/seconds.tsv"],
            "frames": [ev / "truth/frames.tsv"],
            "curves": [root / f"models/{name}.cv.tsv" for name in MODELS],
            "reconstructions": [out / "sums.npz"],
            "tables": [ev / "truth/measures.tsv", out / "measures.tsv"],
        },
        output={name: ev / file for name, file in TOGETHER.items()},
    )
    run_script(
        "evaluation/evaluation_figures",
        wildcards={"subject": SUBJECT, "take": "rom"},
        params={
            "cfg": CFG,
            "source": [str(root / f"takes/{SUBJECT}/rom/inpaint/{CHUNKS[0]}")],
            "camera": "face2",
        },
        input={"maps": ev / "truth/maps.npz", "frames": ev / "truth/frames.tsv"},
        output={name: ev / file for name, file in SHEETS.items()},
    )
    return ev


def test_rows_of_all_takes_are_those_of_the_only_take(scene, tables):
    table = read_table(tables / "table1.tsv")
    together = table[table["subject"] == "all"].set_index("regressor")["mean_mm"]
    assert together["PS"] == pytest.approx(values(scene.root, "truth")["PS-ana"], abs=1e-6)
    kinds = read_table(tables / "kinds.tsv")
    base = kinds[(kinds["regressor"] == "base") & (kinds["region"] == "mouth")]
    assert base["frames"].sum() == len(TEST)
    assert np.average(base["mean_mm"], weights=base["frames"]) == pytest.approx(
        together["base"], rel=0.01
    )


def test_every_comparison_of_section_6_is_there(tables):
    rows = read_table(tables / "comparisons.tsv")
    pairs = set(zip(rows["first"], rows["second"], strict=True))
    assert {
        ("MS/rbf", "MS/affine"), ("MS", "MS/shape-only"), ("MS", "MS/distances-only"),
        ("MS", "MS/rbf"), ("GR", "contour"), ("PS", "base"), ("GR/neutral", "GR"),
        ("MS/neutral", "MS"), ("MS", "null"), ("PS", "null/neutral"), ("GR/neutral", "null/neutral"),
    } <= pairs  # fmt: skip
    assert set(rows["measure"]) == {"vertex_error_mean_mm", "lip_motion_error_mm", "feature_error"}
    features = read_table(tables / "table2.tsv")
    assert set(features.loc[features["regressor"] == "MS", "features"]) == {
        "shape coefficients", "contour distances", "combined",
    }  # fmt: skip
    tracking = read_table(tables / "table3.tsv").set_index("features")["mean_mm"]
    table = read_table(tables / "table1.tsv").set_index(["subject", "regressor"])["mean_mm"]
    assert tracking["combined"] == table["all", "MS"]
    estimators = read_table(tables / "estimators.tsv")
    assert set(estimators["estimator"]) == {"rbf", "affine", "kernel", "none"}
    nothing = [rows.loc[rows["regressor"] == "null"] for rows in (features, estimators)]
    assert all(len(rows) == 1 and rows["feature_error"].item() > 0 for rows in nothing)
    assert tracking["none"] == table["all", "null"]


def test_headline_holds_every_regressor_against_one_that_learnt_nothing(tables):
    rows = read_table(tables / "headline.tsv").set_index("regressor")
    assert rows.index.tolist() == [
        "base", "base/neutral", "contour", "contour/neutral", "null", "null/neutral", "oracle",
        "PS", "PS/neutral", "MS", "MS/neutral", "MS/paper", "GR", "GR/neutral",
    ]  # fmt: skip
    assert rows.loc[["PS", "MS", "GR/neutral"], "null"].tolist() == ["null/neutral"] * 3
    assert rows.loc["GR", "null"] == "null"
    expected = rows.loc["MS", "lip_motion_mm"] / rows.loc["null/neutral", "lip_motion_mm"]
    assert rows.loc["MS", "over_null"] == pytest.approx(expected)
    assert rows.loc["base", "lip_motion_ratio"] == 1.0
    assert rows["flipped_rate"].drop("base").notna().all()
    text = closing_table(read_table(tables / "headline.tsv"))
    assert " ".join(text.splitlines()[0].split()).startswith("lip motion, mm of base of null")


def test_sheets_have_a_column_a_mesh(tables):
    size = CFG["evaluation.figures"]["map_size_px"]
    # base, contour, null, oracle; PS, MS, GR, and told the neutral; truth
    columns = {"maps": 10, "renders": 12, "stretch": 11}
    for name, count in columns.items():
        image = cv2.imread(str(tables / SHEETS[name]))
        assert image.shape[1] == count * size, name
        assert image.shape[0] // size == 4


def test_page_is_whole_and_needs_no_network(scene, tables):
    root = scene.root
    run_script(
        "report/quality",
        params={"skipped": []},
        input={"tables": [tables / "truth/quality.tsv"]},
        output={"flagged": root / "quality.tsv"},
    )
    write_page(root, tables)
    page = (tables / "summary.html").read_text(encoding="utf-8")
    for text in (
        "What learning brings", "MS: of the lips' motion".replace("'", "&#x27;"),
        "not tracked, so not measured", "PS-ana", "RBF network against affine map",
        "Table 2: cross-validation error", "Table 3: tracking error", "trained on",
        'href="../takes/ana/rom/multiview/report.html"',
    ):  # fmt: skip
        assert text in page, text
    assert 'src="http' not in page
    assert page.count("data:image/") >= 8


def write_page(root, ev):
    overlay = root / "overlay.png"
    write_srgb8(overlay, to_display(np.full((20, 30, 3), 0.5)))
    run_script(
        "report/summary",
        params={
            "cfg": {
                "evaluation.figures.embed_video_mb": 1.0,
                "evaluation.measures": {"seed": 0},
                "training": {"regressor": "kernel"},
            },
            "applied": "MS",
            "regressors": [
                {
                    "regressor": "MS",
                    "trained_on": "ana/rom, bo/rom",
                    "frames": 60,
                    "judged_on": "ana/rom",
                }
            ],
            "names": {
                "maps": ["ana/rom"],
                "training": ["MS"],
                "overlays": [["tracking", "ana/rom"]],
                "videos": [],
                "timelines": [],
                "reconstructions": ["ana/rom"],
            },
            "frames": [
                {
                    "take": "ana/rom",
                    "role": "tattoo",
                    "frames": 40,
                    "split": "test:30-39",
                    "train": 30,
                    "held_out": 11,
                    "against": "truth",
                }
            ],
        },
        input={
            **{name: ev / file for name, file in TOGETHER.items()},
            "quality": root / "quality.tsv",
            **{name: [ev / file] for name, file in SHEETS.items()},
            "reconstructions": [root / "takes/ana/rom/multiview/report.html"],
            "training": [root / "models/MS.cv.png"],
            "overlays": [overlay],
            "videos": [],
            "timelines": [],
        },
        output={"page": ev / "summary.html"},
    )
