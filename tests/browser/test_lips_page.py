"""The page of a take in a real browser, as wide as a desk's and as a phone's."""

import numpy as np
import pandas as pd
import pytest

from tests.browser.conftest import opened
from vermilion.imaging.video import write_video
from vermilion.report.lips_page import TakePage, take_page

sync_api = pytest.importorskip("playwright.sync_api")

pytestmark = pytest.mark.slow
FRAMES, FPS, BAD = 50, 25.0, 30


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """A page of fifty frames, of which one is flagged."""
    folder = tmp_path_factory.mktemp("page")
    images = [np.full((120, 160, 3), 4 * n, np.uint8) for n in range(FRAMES)]
    write_video(folder / "shot.mp4", images, FPS)
    flagged = pd.DataFrame(
        [{"stage": "tracking", "frame": 100 + BAD, "valid": 0, "reason": "lost"}]
    )
    frames = np.arange(100, 100 + FRAMES)
    html = take_page(
        TakePage(
            "a_clip_with_a_rather_long_name_without_spaces", frames, FPS, "ICT-FaceKit", "none",
            (folder / "shot.mp4").read_bytes(), np.linspace(0, 9, FRAMES), flagged, [],
            "results/lips/clip/config.yaml",
        )
    )  # fmt: skip
    (folder / "lips.html").write_text(html, encoding="utf-8")
    return folder / "lips.html"


@pytest.mark.parametrize("size_px", [(1366, 900), (390, 844)])
def test_the_video_plays_and_the_time_line_leads_to_its_frames(chromium, page_file, size_px):
    page, said, asked = opened(chromium, page_file, size_px)
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= size_px[0], "the page is wider than the window"
    assert page.evaluate("document.getElementById('shot').videoWidth") == 160

    line = page.locator("#line")
    line.scroll_into_view_if_needed()
    box = line.bounding_box()
    left, right = 108, 8
    share = (BAD + 0.5) / FRAMES
    line.click(position={"x": left + share * (box["width"] - left - right), "y": 8})
    text = page.locator("#said")
    sync_api.expect(text).to_have_text(f"frame {100 + BAD}: tracking: lost")
    page.keyboard.press("ArrowRight")
    sync_api.expect(text).to_have_text(f"frame {100 + BAD + 1}")
    page.click("#play")
    page.wait_for_function("!document.getElementById('shot').paused")
    page.close()
    assert said == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
