"""Sketch files: what is written is read, and each fault is a sentence. Curves in the image."""

import json

import numpy as np
import pytest

from vermilion.guided.curves import first_self_crossing, mouth_axes, press_together, resampled
from vermilion.guided.sketch import (
    MOST_POINTS,
    Sketch,
    SketchCurve,
    read_sketch,
    sketch_path,
    write_sketch,
)
from vermilion.storage.errors import InputError

UPPER = [[100.0, 200.0], [150.0, 190.0], [200.0, 201.5]]
LOWER = [[100.0, 200.0], [150.0, 220.0], [200.0, 201.5]]


def content(**changed) -> dict:
    base = {
        "format": "vermilion sketch",
        "version": 1,
        "unit": "px",
        "camera": "face2",
        "frame": 12,
        "image_size_px": [512, 640],
        "curves": {
            "upper_inner": {"kind": "sure", "points": UPPER},
            "lower_inner": {"kind": "near", "points": LOWER},
        },
    }
    return base | changed


def curve(points, kind="sure", name="upper_inner") -> dict:
    return {"curves": {name: {"kind": kind, "points": points}}}


def test_a_sketch_is_read_as_it_was_written(tmp_path):
    curves = {
        "upper_inner": SketchCurve(np.array(UPPER)),
        "lower_outer": SketchCurve(np.array(LOWER), "near"),
    }
    path = sketch_path(tmp_path, "face2", 12)
    write_sketch(path, Sketch("face2", 12, (512, 640), curves))
    assert path == tmp_path / "sketches" / "face2" / "000012.json"
    again = read_sketch(path)
    assert (again.camera, again.frame, again.image_size_px) == ("face2", 12, (512, 640))
    assert {name: c.kind for name, c in again.curves.items()} == {
        "upper_inner": "sure",
        "lower_outer": "near",
    }
    np.testing.assert_array_equal(again.curves["lower_outer"].points_px, LOWER)


def test_a_sketch_that_cannot_be_read_is_not_written(tmp_path):
    path = tmp_path / "000001.json"
    bad = Sketch(
        "a", 1, (100, 100), {"upper_inner": SketchCurve(np.array([[1.0, np.nan], [2, 3]]))}
    )
    with pytest.raises(InputError, match="not finite"):
        write_sketch(path, bad)
    assert list(tmp_path.iterdir()) == []


ZIGZAG = [[100, 100], [200, 100], [200, 150], [150, 50]]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"format": "contours"}, "the format 'contours'"),
        ({"version": 2}, "a sketch of version 2.*Update Vermilion"),
        ({"version": "1"}, "the version '1'"),
        ({"unit": "mm"}, "the unit 'mm'"),
        ({"camera": 3}, "the camera 3"),
        ({"frame": -1}, "the frame -1"),
        ({"frame": 10**12}, "the frame 1000000000000"),
        ({"frame": True}, "the frame True"),
        ({"image_size_px": [512]}, r"the image size \[512\]"),
        ({"curves": {}}, "one or more"),
        ({"curves": {"moustache": {}}}, "a curve named 'moustache'"),
        ({"curves": {"upper_inner": 5}}, "which is a number"),
        (curve(UPPER, kind="perhaps"), "of the kind 'perhaps'"),
        (curve("line"), "with text as points"),
        (curve([[1.0, 2.0]]), r"with 1 point\(s\); expected two points or more"),
        (curve([[1.0, 2.0], [3.0]]), r"whose point 1 is \[3.0\]"),
        (curve([[1.0, 2.0], ["3", 4.0]]), "whose point 1 is"),
        (curve([[1.0, 2.0], [True, 4.0]]), "whose point 1 is"),
        (curve([[1.0, 2.0], [10**400, 4.0]]), "whose point 1 is"),
        (curve([[1.0, 2.0], [float("nan"), 4.0]]), r"point \[1\] is not finite"),
        (curve([[1.0, 2.0], [float("inf"), 4.0]]), "is not finite"),
        (curve([[1.0, 2.0], [600.0, 4.0]]), "lies at .* expected pixels of an image of 512 x 640"),
        (curve([[5.0, 5.0], [5.0, 5.0]]), "points are all the same"),
        (curve([[float(k % 512), 9.0] for k in range(MOST_POINTS + 1)]), "with 2001 points"),
        (curve(ZIGZAG), "crosses itself between the points 0 and 2"),
    ],
)
def test_each_fault_is_a_sentence_that_names_the_file(tmp_path, changed, message):
    path = tmp_path / "000012.json"
    path.write_text(json.dumps(content(**changed)))
    with pytest.raises(InputError, match=message) as caught:
        read_sketch(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "null", "[" * 100_000])
def test_what_is_no_json_object_is_refused(tmp_path, text):
    path = tmp_path / "000012.json"
    path.write_text(text)
    with pytest.raises(InputError):
        read_sketch(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="000003"):
        read_sketch(tmp_path / "000003.json")


def test_samples_lie_evenly_on_the_curve():
    points, step = resampled(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), 1.0, 500)
    assert step == pytest.approx(1.0)
    assert len(points) == 21
    np.testing.assert_allclose(points[10], [10.0, 0.0])
    few, step = resampled(points, 1.0, 6)
    assert len(few) == 6 and step == pytest.approx(4.0)


def test_a_curve_crosses_itself_only_where_it_does():
    angle = np.linspace(0, np.pi, 50)
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert first_self_crossing(arc) is None
    assert first_self_crossing(np.array(ZIGZAG, float)) == (0, 2)


def test_up_is_up_in_the_image_of_a_tilted_mouth():
    angle = np.radians(25)
    direction = np.array([np.cos(angle), np.sin(angle)])
    along, up = mouth_axes([np.linspace(-50, 50, 20)[:, None] * -direction])
    np.testing.assert_allclose(along, direction, atol=1e-12)
    assert up[1] < 0 and abs(up @ along) < 1e-12


def test_where_the_lower_lip_is_drawn_above_the_upper_both_meet():
    x = np.linspace(0, 100, 101)
    upper = np.stack([x, 50.0 + 0 * x], axis=1)
    lower = np.stack([x, 55.0 - 10.0 * (x > 60)], axis=1)  # 5 px above beyond x = 60
    along, up = np.array([1.0, 0.0]), np.array([0.0, -1.0])
    new_upper, new_lower, upper_moved, lower_moved = press_together(upper, lower, along, up)
    np.testing.assert_array_equal(upper_moved, x > 60)
    np.testing.assert_array_equal(lower_moved, x > 60)
    np.testing.assert_allclose(new_upper[x > 60], new_lower[x > 60])
    np.testing.assert_allclose(new_upper[x > 60, 1], 47.5)
    np.testing.assert_array_equal(new_upper[x <= 60], upper[x <= 60])
