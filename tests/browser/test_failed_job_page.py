"""A job that fails during a propagation is named on the page, with its log."""

import json

import pytest

from tests.browser.test_sketch_page import draw_lips
from tests.sketch_take import CAMERA, SUGGESTED
from vermilion.guided.sketch import sketch_path

pytestmark = pytest.mark.slow


def of_an_earlier_run(route) -> None:
    status = route.fetch().json()
    status["run"] |= {"state": "done", "started": 1.0, "taken_s": 9.0}
    route.fulfill(body=json.dumps(status), content_type="application/json")


def test_a_job_that_fails_is_named_with_its_log(page, take):
    page.press("g")
    draw_lips(page, take)
    path = sketch_path(take.labels, CAMERA, SUGGESTED[0])
    path.write_text(path.read_text().replace('"camera": "cam"', '"camera": "other"'))
    page.press("p")
    page.says("propagation-text", "jobs? will run")
    # What the server said before the run started comes late: it is not the end of this one.
    page.tab.route("**/api/status", of_an_earlier_run)
    page.tab.wait_for_timeout(1500)
    page.press("Escape", "p")
    page.says("propagation-text", "jobs? will run")
    page.press("Enter")
    page.tab.wait_for_timeout(2500)
    assert "Done" not in page.text("propagation-text")
    page.tab.unroute_all(behavior="ignoreErrors")  # an answer may be on its way just now
    page.says("propagation-text", "guided_refine failed")
    page.says("log", "camera other")
    page.screenshot("failed")
