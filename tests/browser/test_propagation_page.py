"""Propagation from the page in a real browser: jobs, progress, cancel, before and after."""

import pytest

from tests.browser.test_sketch_page import draw_lips
from tests.sketch_take import N_FRAMES, SUGGESTED
from vermilion.guided.refined_frame import RefinedFrame

pytestmark = pytest.mark.slow


def guided(take, name):
    return take.results / "takes" / "s" / "t" / "guided" / name


def test_the_take_follows_two_drawn_frames(page, take):
    page.press("g", "p")
    page.says("propagation-text", "No frame is drawn yet")
    page.press("Escape")
    for frame in SUGGESTED:
        page.go_to(frame)
        draw_lips(page, take, frame)
    page.press("p")
    page.says("propagation-text", "jobs will run")
    jobs = page.text("jobs").split()
    counts = dict(zip(jobs[::2], map(int, jobs[1::2]), strict=True))
    # The suggestions of the folder are there already.
    assert counts == {
        "guided_refine": 2, "guided_train": 1, "guided_correct": 1, "guided_export": 1,
    }  # fmt: skip
    page.screenshot("jobs")
    # Started and cancelled: nothing half made stays, and the page says so.
    page.press("Enter")
    page.says("propagation-text", "so far")
    page.tab.click("#propagation-cancel")
    page.says("propagation-text", "Cancelled")
    assert not guided(take, "overlay.mp4").exists()
    page.press("Escape", "p")
    page.says("propagation-text", "jobs? will run")
    page.press("Enter")
    page.says("propagation-text", r"\d of \d jobs done")
    page.screenshot("progress")
    page.says("propagation-text", "Done in")
    assert guided(take, "overlay.mp4").is_file()
    refined = RefinedFrame.load(guided(take, f"refined/{SUGGESTED[0]:06d}.npz"))
    assert refined.kind == "sketch"
    page.press("s")
    page.tab.locator("#thumbs button").nth(N_FRAMES - 1).wait_for()
    assert page.tab.locator("#thumbs button").count() == N_FRAMES
    page.tab.locator("#thumbs button").first.click()
    page.press("m", "m")
    page.screenshot("before_and_after")
    assert page.text("right-tag") == "After"
    # Unchanged: nothing would run.
    page.press("Escape", "p")
    page.says("propagation-text", "Nothing has changed")
    page.press("Escape")
    assert page.complaints == []
