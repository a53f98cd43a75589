"""Drift and the report page of the tiny capture, with a frame that cannot be read."""

from __future__ import annotations

import base64
import re

import cv2
import numpy as np
import pandas as pd
import pytest

from tests import lip_patch
from tests.stages.multiview_jobs import CFG, PLACE, inputs, make_capture, reconstruct
from tests.stages.run_script import run_script
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow

#: One camera misses a frame; of another frame a single image is left.
LOST = {(1, "left"), (3, "front"), (3, "left")}
FULL_SIZE = {**CFG, "multiview.drift": {**CFG["multiview.drift"], "scale": 1.0}}
WHOLE = "000000-000003"


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    root = tmp_path_factory.mktemp("report")
    make_capture(root, lip_patch.cameras(), LOST)
    reconstruct(root)
    drift(root, WHOLE)
    report(root, "rom", tracked=True)
    return root


def drift(root, chunk):
    first, last = (int(number) for number in chunk.split("-"))
    meshes = np.load(root / f"H/{WHOLE}.npy")[first : last + 1]
    np.save(root / f"{chunk}.npy", meshes)
    run_script(
        "multiview/multiview_drift",
        wildcards={**PLACE, "chunk": chunk},
        params={
            "cfg": FULL_SIZE,
            "source": str(root / "rom"),
            "neutral": 0,
            "frames": list(range(first, last + 1)),
        },
        input={**inputs(root), "meshes": root / f"{chunk}.npy"},
        output={"drift": root / f"drift/{chunk}.tsv"},
    )


def report(root, name, tracked):
    """The page; of the neutral alone, as a plain take has it, where it is not tracked."""
    run_script(
        "multiview/multiview_report",
        wildcards={**PLACE, "take": name},
        params={"cfg": FULL_SIZE, "source": str(root / "rom"), "neutral": 0},
        input={
            **inputs(root),
            "track": [root / "track.npz"] if tracked else [],
            "meshes": [root / f"H/{WHOLE}.npy"] if tracked else [],
            **{
                kind: [root / f"{kind}/{WHOLE}.{end}"] if tracked else []
                for kind, end in (("visibility", "npy"), ("quality", "tsv"), ("drift", "tsv"))
            },
        },
        output={"page": root / f"{name}.html", "drift": root / f"{name}.tsv"},
    )


def images_in(page):
    """Decoded images (h, w, 3) of a page."""
    files = re.findall(r'src="data:image/(?:png|jpeg);base64,([^"]+)"', page)
    return [cv2.imdecode(np.frombuffer(base64.b64decode(f), np.uint8), 1) for f in files]


def test_drift_is_small_and_says_what_is_missing(take):
    table = read_table(take / "rom.tsv").set_index(["frame", "camera"])
    for frame in (0, 1, 2):
        assert table.loc[(frame, "all"), "drift_mm_vermilion"] < 0.1
    assert "left" in table.loc[(1, "left"), "reason"]
    assert np.isnan(table.loc[(3, "all"), "drift_mm_skin"])
    assert "1 readable images" in table.loc[(3, "all"), "reason"]


def test_chunk_size_changes_no_drift(take):
    drift(take, "000002-000003")
    whole, part = (read_table(take / f"drift/{c}.tsv") for c in (WHOLE, "000002-000003"))
    same = whole[whole["frame"] >= 2].reset_index(drop=True)
    pd.testing.assert_frame_equal(same, part)


def test_the_page_names_the_flagged_frame_and_the_missing_image(take):
    page = (take / "rom.html").read_text()
    flagged = page.split("Flagged frames</h2>")[1].split("<h2")[0]
    assert "1 readable images" in flagged and ">3<" in flagged
    missing = page.split("Missing images</h2>")[1].split("<h2")[0]
    assert ">left<" in missing and ">1<" in missing


def test_the_page_has_everything_in_it(take):
    page = (take / "rom.html").read_text()
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert sources and all(s.startswith(("data:image/", "#")) for s in sources)
    assert "http" not in page and "<script" not in page and "url(" not in page
    shown = [int(n) for n in re.findall(r"<h3>Frame (\d+)</h3>", page)]
    assert 0 in shown and 3 not in shown and len(shown) >= 2
    images = images_in(page)
    assert len(images) == 1 + len(shown)  # curves, then a sheet a frame
    assert all(image.shape[1] == 7 * 200 for image in images[1:])


def test_a_take_of_a_neutral_alone_has_a_page(take):
    report(take, "plain", tracked=False)
    page = (take / "plain.html").read_text()
    assert len(images_in(page)) == 1
    assert "neighbouring cameras" in page
    assert len(read_table(take / "plain.tsv", ["frame", "camera"])) == 0
