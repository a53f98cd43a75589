"""The page of all results in a real browser: what is seen first, what is folded, where images lead."""

import cv2
import numpy as np
import pytest

from tests.browser.conftest import SCREENSHOTS, opened
from vermilion.imaging.video import write_video
from vermilion.report import page as pieces
from vermilion.report.overview import beside

sync_api = pytest.importorskip("playwright.sync_api")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """A page with a video, three figures, a wide table and a large image."""
    folder = tmp_path_factory.mktemp("summary") / "evaluation"
    (folder.parent / "overlays").mkdir(parents=True)
    folder.mkdir()
    images = [np.full((120, 360, 3), 4 * n, np.uint8) for n in range(10)]
    write_video(folder.parent / "shot.mp4", images, 25.0)
    noise = np.random.default_rng(0).integers(0, 255, (900, 1600, 3), dtype=np.uint8)
    cv2.imwrite(str(folder.parent / "overlays/sheet.png"), noise)
    cells = "".join(f"<td>{n}.00 mm of something</td>" for n in range(30))
    html = pieces.page(
        "Results",
        "5 takes.",
        [
            ("The video beside its result", beside([("ana/phone", folder.parent / "shot.mp4")], [], 1.0, folder)),
            ("Three figures", pieces.figures([(f"{n} mm", "error", "A sentence.") for n in range(3)])),
        ],
        [
            ("A wide table", f'<div class="scroll"><table><tr>{cells}</tr></table></div>'),
            ("Images of every stage", pieces.image(folder.parent / "overlays/sheet.png", "tracking", folder)),
        ],
    )  # fmt: skip
    (folder / "summary.html").write_text(html, encoding="utf-8")
    return folder / "summary.html"


@pytest.mark.parametrize("size_px", [(1366, 768), (390, 844)])
def test_the_video_comes_first_and_the_rest_is_folded(chromium, page_file, size_px):
    page, said, asked = opened(chromium, page_file, size_px)
    box = page.locator("video").bounding_box()
    assert box["y"] + box["height"] < size_px[1], "the video is not seen without scrolling"
    assert page.locator("details.part[open]").count() == 0
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENSHOTS / f"summary_{size_px[0]}.png", full_page=True)

    page.click("#unfold")
    assert page.locator("details.part[open]").count() == 2
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= size_px[0], "the page is wider than the window"
    shown = page.locator("figure img")
    assert shown.evaluate("image => image.naturalWidth") == 1032
    assert shown.locator("..").get_attribute("href") == "../overlays/sheet.png"

    page.goto("about:blank")
    page.goto(page_file.as_uri() + "#images-of-every-stage")
    unfolded = page.locator("details.part[open]")
    sync_api.expect(unfolded).to_have_count(1)
    assert unfolded.get_attribute("id") == "images-of-every-stage"
    page.close()
    assert said == []
    local = ("file:", "data:", "about:")
    assert [url for url in asked if not url.startswith(local)] == []
