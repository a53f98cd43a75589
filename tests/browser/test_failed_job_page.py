"""A job that fails during a propagation is named on the page, with its log."""

import pytest

from tests.browser.test_sketch_page import draw_lips
from tests.sketch_take import CAMERA, SUGGESTED
from vermilion.guided.sketch import sketch_path

pytestmark = pytest.mark.slow


def test_a_job_that_fails_is_named_with_its_log(page, take):
    page.press("g")
    draw_lips(page, take)
    path = sketch_path(take.labels, CAMERA, SUGGESTED[0])
    path.write_text(path.read_text().replace('"camera": "cam"', '"camera": "other"'))
    page.press("p")
    page.says("propagation-text", "jobs? will run")
    page.press("Enter")
    page.says("propagation-text", "guided_refine failed")
    page.says("log", "camera other")
    page.screenshot("failed")
