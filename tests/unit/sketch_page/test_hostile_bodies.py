"""What the server of the sketch page refuses, each with a sentence."""

import json

import pytest

from tests.sketch_take import CAMERA
from tests.unit.sketch_page.visits import SKETCH, UPPER, WIDTH, curve, saved, sketch
from vermilion.app.sketch.sketch_store import NOTHING


def body(**content):
    return json.dumps({"revision": NOTHING, "sketch": sketch(), **content}).encode()


def million_points():
    return b'{"revision": "none", "sketch": {"curves": [' + b"[1,2]," * 1_000_000 + b"[1,2]]}}"


@pytest.mark.parametrize(
    ("content", "status", "sentence"),
    [
        (million_points(), 413, "1 MB"),
        (b"x" * 1_000_001, 413, "1 MB"),
        (b"{", 400, "not JSON"),
        (b"", 400, "not JSON"),
        (b"\xff\xfe{}", 400, "not JSON"),
        (b"[" * 100_000, 400, "not JSON"),
        (b"[1, 2]", 400, "not a JSON object"),
        (body(sketch=sketch(**curve([[1.0, float("nan")], [2, 3]]))), 400, "not finite"),
        (body(sketch=sketch(**curve([[float("inf"), 1], [2, 3]]))), 400, "not finite"),
        (body().replace(b"250.0", b"1e999"), 422, "not finite"),
        (b'{"sketch": null}', 400, "'revision'"),
        (b'{"revision": 7, "sketch": null}', 400, "'revision'"),
        (b'{"revision": "none"}', 400, "no sketch"),
        (body(sketch=[]), 422, "expected an object"),
        (body(sketch=sketch(curves="all")), 422, "the curves"),
        (body(sketch=sketch(**curve("up"))), 422, "text as points"),
        (body(sketch=sketch(**curve([[1, 2, 3], [4, 5, 6]]))), 422, "point 0"),
        (body(sketch=sketch(**curve([["1", "2"], ["3", "4"]]))), 422, "point 0"),
        (body(sketch=sketch(**curve([[1, 2]] * 2001))), 422, "2001 points"),
        (body(sketch=sketch(**curve([[1, 2], [WIDTH + 50, 2]]))), 422, "lies at"),
        (body(sketch=sketch(**curve([[0, 0], [9, 9], [9, 0], [0, 9]]))), 422, "crosses itself"),
        (body(sketch=sketch(**curve(UPPER, handles={"a": 1}))), 422, "object as handles"),
        (body(sketch=sketch(curves={"nose": {"kind": "sure", "points": UPPER}})), 422, "'nose'"),
        (body(sketch=sketch(version=99)), 422, "version 99"),
        (body(sketch=sketch(frame=3)), 422, "frame 3"),
        (body(sketch=sketch(camera="other")), 422, "camera other"),
        (body(sketch=sketch(image_size_px=[WIDTH, 1])), 422, "image"),
    ],
)
def test_a_hostile_body_is_refused_with_a_sentence(page, take, content, status, sentence):
    headers = {"Content-Type": "application/json"}
    answer = page.put(SKETCH, content=content, headers=headers)
    assert (answer.status_code, sentence in answer.json()["error"]) == (status, True), answer.text
    assert len(answer.json()["error"]) < 500
    assert saved(take) == []


def test_a_long_body_without_a_length_is_refused_too(page, take):
    parts = (b"x" * 100_000 for _ in range(11))
    headers = {"Content-Type": "application/json"}
    assert page.put(SKETCH, content=parts, headers=headers).status_code == 413


def test_other_types_of_bodies_are_refused(page):
    answer = page.put(SKETCH, content=body(), headers={"Content-Type": "text/plain"})
    assert answer.status_code == 415


@pytest.mark.parametrize("frame", ["6", "99999999999999999999", "-1", "1.5", "x", "000002/x"])
def test_a_frame_out_of_range_is_refused(page, frame):
    for path in (f"/api/sketch/{CAMERA}", f"/api/image/{CAMERA}", f"/api/mesh/base/{CAMERA}"):
        answer = page.get(f"{path}/{frame}")
        assert answer.status_code == 404
        assert answer.json()["error"]
    put = page.put(f"/api/sketch/{CAMERA}/{frame}", json={"revision": NOTHING, "sketch": None})
    assert put.status_code == 404
    assert page.post(f"/api/solve/{frame}", json={}).status_code == 404


def test_other_methods_are_refused(page):
    for method, path in (("DELETE", SKETCH), ("GET", "/api/propagate"), ("POST", "/api/take")):
        answer = page.request(method, path, json={})
        assert answer.status_code == 405
        assert path in answer.json()["error"]
