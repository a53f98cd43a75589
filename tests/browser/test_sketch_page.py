"""The sketch page in a real browser: drawing, solving, undoing, two tabs, keys, errors."""

import re

import numpy as np
import pytest

from tests.browser.conftest import SIZE, lips
from tests.sketch_take import CAMERA, SUGGESTED
from vermilion.guided.sketch import read_sketch, sketch_path

pytestmark = pytest.mark.slow
FIRST = SUGGESTED[0]


def saved(take, frame=FIRST):
    """Curve name -> (points, handles) on disk."""
    path = sketch_path(take.labels, CAMERA, frame)
    if not path.is_file():
        return {}
    return {n: (c.points_px, c.handles_px) for n, c in read_sketch(path).curves.items()}


def draw_lips(page, take, frame=FIRST):
    for key, points in zip("12", lips(take, frame).values(), strict=True):
        page.press(key)
        page.draw(points)
        page.still()


def off(points, line):
    """Mean distance in y of points (n, 2) from a line (m, 2), over their common stretch."""
    inside = (points[:, 0] > line[:, 0].min()) & (points[:, 0] < line[:, 0].max())
    return np.abs(points[inside, 1] - np.interp(points[inside, 0], line[:, 0], line[:, 1])).mean()


def test_lips_are_drawn_with_the_mouse_and_solved_in_a_second(page, take):
    page.says("frame-text", f"^Frame {FIRST} ")  # the first suggestion
    page.press("g")  # the magnet off: the stroke stays where it was drawn
    draw_lips(page, take)
    found = saved(take)
    assert set(found) == {"upper_inner", "lower_inner"}
    for name, line in lips(take, FIRST).items():
        assert off(found[name][0], line) < 0.4
        assert 3 <= len(found[name][1]) <= 14
    page.screenshot("drawn")
    page.press("Enter")
    page.says("solve-text", r"solved in \d")
    figures = re.findall(r"\d+\.\d+", page.text("solve-text"))
    assert float(figures[1]) < 0.5  # px off the strokes, mean
    page.says("message", "is solved")
    page.press("d")
    page.screenshot("solved")
    assert page.complaints == []
    assert page.hosts == {page.tab.url.split("/")[2]}


def test_a_sketch_and_its_undo_outlive_a_reload(page, take):
    page.press("g")
    draw_lips(page, take)
    page.tab.reload()
    page.tab.locator("body[data-ready]").wait_for()
    page.still()
    page.says("frame-text", f"^Frame {FIRST} ")
    assert set(saved(take)) == {"upper_inner", "lower_inner"}
    page.press("Control+z")
    page.still()
    assert set(saved(take)) == {"upper_inner"}
    page.press("Control+z")
    page.still()
    assert saved(take) == {}
    page.press("Control+y", "Control+Shift+Z")
    page.still()
    assert set(saved(take)) == {"upper_inner", "lower_inner"}


def test_undo_stays_in_its_frame(page, take):
    page.press("g")
    page.draw(lips(take, FIRST)["upper_inner"])
    page.still()
    page.go_to(2)
    page.press("Control+z")
    page.still()
    page.says("frame-text", "^Frame 2 ")
    assert set(saved(take)) == {"upper_inner"}


def test_everything_works_with_keys_alone(page, take):
    page.press("k")
    page.says("message", "own contour is the start")
    page.still()
    before = saved(take)
    assert set(before) == {"upper_inner", "lower_inner"}
    page.press("2", "]", "]", "]", "Shift+ArrowDown", "ArrowRight")
    page.still()
    moved = saved(take)["lower_inner"][1] - before["lower_inner"][1]
    assert (np.abs(moved).sum(axis=1) > 0).sum() == 1
    np.testing.assert_allclose(moved.sum(axis=0), [0.5, 3.0], atol=1e-6)
    page.press("a")
    page.still()
    assert len(saved(take)["lower_inner"][1]) == len(moved) + 1
    page.press("Delete", "t")
    page.still()
    assert len(saved(take)["lower_inner"][1]) == len(moved)
    assert read_sketch(sketch_path(take.labels, CAMERA, FIRST)).curves["lower_inner"].kind == "near"
    page.press("Escape", "Enter")
    page.says("solve-text", r"solved in \d")
    page.press("n")
    page.says("frame-text", f"^Frame {SUGGESTED[1]} ")
    page.press("c")  # the curves of the frame drawn before it
    page.says("message", f"curves of frame {FIRST} are the start")
    page.still()
    assert set(saved(take, SUGGESTED[1])) == {"upper_inner", "lower_inner"}
    page.press("x")
    page.still()
    assert set(saved(take, SUGGESTED[1])) == {"upper_inner"}
    page.press("?")
    page.screenshot("keys")
    sheet = page.text("keys")
    for words in ("solve the frame", "next suggested frame", "undo, in this frame", "magnet"):
        assert words in sheet
    page.press("Escape")
    assert not page.tab.locator("#help").is_visible()


def test_handles_are_dragged_added_and_rubbed_out(page, take):
    page.press("g")
    line = lips(take, FIRST)["upper_inner"]
    page.draw(line)
    page.still()
    points, handles = saved(take)["upper_inner"]
    (start,) = page.on_screen(handles[1:2])
    page.tab.mouse.move(*start)
    page.tab.mouse.down()
    page.tab.mouse.move(start[0], start[1] - 20, steps=4)
    page.tab.mouse.up()
    page.still()
    moved = saved(take)["upper_inner"][1]
    assert moved[1, 1] < handles[1, 1] - 2
    np.testing.assert_allclose(np.delete(moved, 1, 0), np.delete(handles, 1, 0), atol=1e-3)
    # Pressed on the curve between two handles: one more.
    points = saved(take)["upper_inner"][0]
    free = np.linalg.norm(points[:, None] - moved, axis=2).min(axis=1).argmax()
    page.tab.mouse.click(*page.on_screen(points[free : free + 1])[0])
    page.still()
    assert len(saved(take)["upper_inner"][1]) == len(moved) + 1
    page.press("e")
    page.draw(saved(take)["upper_inner"][1][:2])
    page.still()
    assert len(saved(take)["upper_inner"][1]) == len(moved) - 1


def test_a_pen_draws_and_its_other_end_erases(page, take):
    page.press("g")
    places = page.on_screen(lips(take, FIRST)["upper_inner"])
    send = page.tab.context.new_cdp_session(page.tab).send

    def stroke(places, buttons, button):
        kinds = ["mousePressed", *["mouseMoved"] * (len(places) - 2), "mouseReleased"]
        for kind, (x, y) in zip(kinds, places, strict=True):
            held = 0 if kind == "mouseReleased" else buttons
            event = {"type": kind, "x": x, "y": y, "button": button, "buttons": held}
            send("Input.dispatchMouseEvent", {**event, "pointerType": "pen", "clickCount": 1})

    stroke(places, 1, "left")
    page.still()
    points, _ = saved(take)["upper_inner"]
    assert off(points, lips(take, FIRST)["upper_inner"]) < 0.4


def test_the_magnet_pulls_a_stroke_onto_the_contour(page, take):
    true = lips(take, FIRST)["lower_inner"]
    page.press("2")
    page.draw(true + np.array([0, 3]))
    page.tab.locator("#undo:enabled").wait_for()  # the magnet answers before there is a curve
    page.still()
    snapped = saved(take)["lower_inner"][0]
    middle = snapped[len(snapped) // 5 : -len(snapped) // 5]
    assert off(middle, true) < 0.8


def test_a_second_tab_shows_what_the_first_one_saved(open_page, take):
    first, second = open_page(), open_page()
    first.press("g")
    first.draw(lips(take, FIRST)["upper_inner"])
    first.still()
    second.says("message", "changed in another tab")
    second.press("Control+z")  # nothing of its own to undo
    assert set(saved(take)) == {"upper_inner"}


def test_a_tab_that_missed_a_change_does_not_overwrite_it(open_page, take):
    first, second = open_page(), open_page()
    for page in (first, second):
        page.press("g")
    second.tab.route("**/api/status", lambda route: route.abort())
    first.draw(lips(take, FIRST)["upper_inner"])
    first.still()
    before = saved(take)["upper_inner"][0]
    second.press("2")
    second.draw(lips(take, FIRST)["lower_inner"])
    second.says("message", "changed in another tab|does not answer")
    second.tab.wait_for_timeout(500)
    assert set(saved(take)) == {"upper_inner"}
    np.testing.assert_array_equal(saved(take)["upper_inner"][0], before)


def test_a_curve_that_crosses_itself_is_not_saved_and_says_so(page, take):
    page.press("g")
    line = lips(take, FIRST)["upper_inner"]
    page.draw(line)
    page.still()
    before = saved(take)["upper_inner"][0]
    loop = np.array([[260, 330], [330, 300], [380, 330], [330, 360], [270, 300], [255, 300.0]])
    page.draw(loop)
    page.says("message", "crosses itself")
    page.says("saved", "not saved")
    page.press("Enter")
    page.says("message", "cannot be solved")
    page.screenshot("refused")
    np.testing.assert_array_equal(saved(take)["upper_inner"][0], before)
    page.press("Control+z")
    page.still()
    np.testing.assert_array_equal(saved(take)["upper_inner"][0], before)


def test_the_page_fits_a_small_screen(page):
    for name in ("header", "footer", "#time", "main"):
        box = page.tab.locator(name).bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= SIZE["width"] + 0.5
        assert box["y"] + box["height"] <= SIZE["height"] + 0.5
    for button in page.tab.locator("header button").all():
        box = button.bounding_box()
        assert box["x"] + box["width"] <= SIZE["width"]
    bar = page.tab.locator("#left-bar").bounding_box()
    assert bar["height"] < 40  # one line of buttons


def test_neighbours_are_there_before_they_are_asked_for(page):
    page.go_to(2)
    page.tab.wait_for_timeout(2000)
    asked = []
    page.tab.on("request", lambda request: asked.append(request.url))
    page.press(".")
    page.says("frame-text", "^Frame 3 ")
    page.tab.wait_for_timeout(500)
    assert not [url for url in asked if "/image/" in url and url.endswith("/3")]
