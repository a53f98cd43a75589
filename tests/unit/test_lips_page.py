"""The page of a take: what it embeds, what it says of flagged frames."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from vermilion.export.page_video import page_video
from vermilion.imaging.video import VideoReader, write_video
from vermilion.report.lips_page import TakeFile, TakePage, take_page


def rows(*items):
    return pd.DataFrame(items, columns=["stage", "frame", "valid", "reason"])


def page_of(flagged, opening=(1.0, np.nan, 3.0)):
    return take_page(
        TakePage(
            "a<b", np.array([100, 101, 102]), 25.0, "ICT", "none", b"mp4", np.array(opening), flagged,
            [TakeFile("corrected.usdc", 2_500_000, "the mesh")], "results/x/config.yaml",
            track="../tracking/C", guide="../bad_take.md",
        )
    )  # fmt: skip


def taken(html):
    return json.loads(re.search(r"const take = (.*);\n", html)[1])


def test_marks_are_frames_of_the_video_by_stage():
    html = page_of(rows(("apply", 102, 1, "outside"), ("tracking", 101, 0, "lost</script>")))
    data = taken(html)
    assert [row["name"] for row in data["rows"]] == ["tracking", "apply"]
    assert data["rows"][0]["marks"] == [[1, 0, "lost</script>"]]
    assert data["opening"] == [1.0, None, 3.0] and data["first"] == 100
    assert html.count("</script>") == 1  # no reason of a frame ends the script
    assert "a&lt;b" in html and "2.5 MB" in html and "not usable" in html


def test_it_says_which_models_were_used_and_where_the_track_lies():
    html = page_of(rows())
    assert "Face model: ICT. Correction: none." in html
    assert "<code>../tracking/C</code>" in html


def test_frames_of_one_kind_of_reason_are_one_row():
    reasons = [rows(("apply", n, 1, f"inner edge {n / 10} times as rough")) for n in (100, 102)]
    html = page_of(pd.concat(reasons))
    assert "2 of 3 frames have warnings." in html
    assert "inner edge 10.0 to 10.2 times as rough" in html and html.count("<tr><td>apply") == 1
    assert 'href="../bad_take.md"' in html


def test_a_clean_take_says_so():
    assert "every stage could use every frame" in page_of(rows())


def test_the_page_needs_nothing_from_elsewhere():
    html = page_of(rows())
    assert not re.search(r"https?://", html)


@pytest.mark.parametrize(("most", "halved"), [(9_000_000, False), (20_000, True)])
def test_the_video_is_original_and_result_within_its_size(tmp_path, most, halved):
    overlay = tmp_path / "overlay.mp4"
    noise = np.random.default_rng(0)
    images = []
    for _ in range(75):
        image = noise.integers(0, 255, (128, 192, 3), dtype=np.uint8)
        image[:, 64:128] = 255  # the middle column, which the page leaves out
        images.append(image)
    write_video(overlay, images, 25.0)
    path = tmp_path / "page.mp4"
    path.write_bytes(page_video(overlay, 25.0, most))
    reader = VideoReader(path)
    assert reader.n_frames == 75
    assert reader.size == ((64, 64) if halved else (128, 128))
    assert path.stat().st_size < 2 * most
    assert reader.read(40)[:, reader.size[0] // 2 - 4 : reader.size[0] // 2 + 4].mean() < 200
