"""Sketches on the page: kept, shown, solved."""

import json
import struct

import numpy as np
import pytest

from tests.sketch_take import CAMERA, LOST, N_FRAMES, SUGGESTED, TAKE
from tests.unit import guided_mouths as mouths
from tests.unit.sketch_page.visits import HEIGHT, SKETCH, UPPER, WIDTH, curve, drawn, saved, sketch
from vermilion.app.sketch.packet import pack
from vermilion.app.sketch.sketch_store import NOTHING


def test_a_stroke_is_saved_at_once_with_its_handles(page, take):
    before = page.get(SKETCH).json()
    assert (before["revision"], before["curves"]) == (NOTHING, None)
    answer = page.put(SKETCH, json={"revision": NOTHING, "sketch": sketch()})
    assert answer.status_code == 200
    again = page.get(SKETCH).json()
    assert again["revision"] == answer.json()["revision"]
    assert again["curves"]["upper_inner"] == {"kind": "sure", "points": UPPER, "handles": UPPER}
    # One file, nothing half written beside it.
    assert [path.name for path in saved(take)] == ["000002.json"]
    assert list((take.labels / "sketches" / CAMERA).iterdir()) == saved(take)


def test_a_second_tab_does_not_overwrite_the_first(page, take):
    first = page.put(SKETCH, json={"revision": NOTHING, "sketch": sketch()}).json()["revision"]
    other = sketch(**curve(UPPER[:2]))
    late = page.put(SKETCH, json={"revision": NOTHING, "sketch": other})
    assert late.status_code == 409
    assert "another tab" in late.json()["error"]
    assert page.get(SKETCH).json()["curves"]["upper_inner"]["points"] == UPPER
    # Nor does its removal, nor where the file was changed by hand.
    assert page.put(SKETCH, json={"revision": NOTHING, "sketch": None}).status_code == 409
    saved(take)[0].write_text(json.dumps(other))
    assert page.put(SKETCH, json={"revision": first, "sketch": None}).status_code == 409
    now = page.get(SKETCH).json()["revision"]
    assert page.put(SKETCH, json={"revision": now, "sketch": None}).json()["revision"] == NOTHING
    assert saved(take) == []


def test_a_broken_file_is_named_and_can_be_replaced(page, take):
    path = take.labels / "sketches" / CAMERA / "000002.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("{")
    found = page.get(SKETCH).json()
    assert found["curves"] is None
    assert "not JSON" in found["problem"]
    assert page.post("/api/solve/2", json={}).status_code == 422
    body = {"revision": found["revision"], "sketch": sketch()}
    assert page.put(SKETCH, json=body).status_code == 200


def unpacked(data):
    length = struct.unpack("<I", data[:4])[0]
    header, offset, arrays = json.loads(data[4 : 4 + length]), 4 + length, {}
    for entry in header["arrays"]:
        count = int(np.prod(entry["shape"]))
        arrays[entry["name"]] = np.frombuffer(data, entry["type"], count, offset)
        offset += -(-arrays[entry["name"]].nbytes // 4) * 4
    assert offset == len(data)
    return header, arrays


def test_a_packet_gives_its_arrays_back():
    arrays = {"a": np.arange(3, dtype=np.uint8), "b": np.ones((2, 3), np.float32)}
    header, found = unpacked(pack({"x": 1}, arrays))
    assert header["x"] == 1
    np.testing.assert_array_equal(found["a"], [0, 1, 2])
    np.testing.assert_array_equal(found["b"], np.ones(6))


def test_the_take_is_described_with_what_is_known_of_its_frames(page):
    facts = page.get("/api/take").json()
    assert (facts["take"], facts["first"], facts["last"]) == (TAKE, 0, N_FRAMES - 1)
    assert facts["cameras"] == [
        {"name": CAMERA, "width": WIDTH, "height": HEIGHT, "magnet": True}
    ]  # fmt: skip
    status = page.get("/api/status").json()
    assert status["suggested"] == list(SUGGESTED)
    assert list(status["bad"]) == [str(LOST)]
    assert status["sketched"] == status["propagated"] == []
    assert page.get(f"/api/image/{CAMERA}/1").headers["content-type"] == "image/jpeg"


def test_a_solve_brings_the_contour_onto_the_stroke_and_moves_nothing_else(page, take, desk):
    body = {"revision": NOTHING, "sketch": drawn(take, 4)}
    assert page.put(f"/api/sketch/{CAMERA}/4", json=body).status_code == 200
    assert page.get(f"/api/mesh/refined/{CAMERA}/4").status_code == 404
    found = page.post("/api/solve/4", json={}).json()
    assert found["mean_px"] < 0.5
    assert found["warning"] == ""
    assert page.get("/api/status").json()["solved"] == [4]
    header, arrays = unpacked(page.get(f"/api/mesh/refined/{CAMERA}/4").content)
    still = np.ones(desk.data.face.n_vertices, dtype=bool)
    still[desk.data.regions.mouth_vertices] = False
    assert arrays["moved_mm"][still].max() == 0
    assert arrays["moved_mm"].max() == pytest.approx(header["largest_mm"], abs=1e-4)
    # The mesh in 3D lies on the neutral, so that the view keeps still.
    rigid = desk.data.face.regions["rigid"]
    shown = arrays["vertices_mm"].reshape(-1, 3)
    np.testing.assert_allclose(shown[rigid], desk.data.neutral_mm[rigid], atol=0.5)
    # Another stroke: the frame is no longer solved.
    changed = sketch(4)
    revision = page.get(f"/api/sketch/{CAMERA}/4").json()["revision"]
    page.put(f"/api/sketch/{CAMERA}/4", json={"revision": revision, "sketch": changed})
    assert page.get("/api/status").json()["solved"] == []


def test_a_solve_without_a_sketch_says_so(page):
    answer = page.post("/api/solve/1", json={})
    assert answer.status_code == 422
    assert "draw the lips first" in answer.json()["error"]


def test_a_solve_that_does_not_converge_says_so(page):
    far = [[x, y - 120] for x, y in UPPER]
    page.put(SKETCH, json={"revision": NOTHING, "sketch": sketch(**curve(far))})
    assert "did not converge" in page.post("/api/solve/2", json={}).json()["warning"]


def test_the_magnet_brings_a_stroke_onto_the_detected_contour(page, take):
    true = np.array(drawn(take, 4)["curves"]["upper_inner"]["points"])
    stroke = {"curve": "upper_inner", "points": (true - [0, 3]).tolist()}
    answer = page.post(f"/api/magnet/{CAMERA}/4", json=stroke)
    assert answer.status_code == 200
    snapped = np.array(answer.json()["points"])
    height = np.interp(snapped[:, 0], true[:, 0], true[:, 1])
    middle = slice(len(snapped) // 5, -len(snapped) // 5)
    assert np.abs(snapped[:, 1] - height)[middle].mean() < 0.6
    wrong = page.post(f"/api/magnet/{CAMERA}/4", json={"curve": "nose", "points": UPPER})
    assert wrong.status_code == 422


def test_a_sketch_can_start_from_the_meshs_own_contour(page, take):
    found = np.array(page.get(f"/api/curve/upper_inner/{CAMERA}/4").json()["points"])
    drawn_px = mouths.drawn(take.base_mm[4], mouths.camera(CAMERA)).curves["upper_inner"].points_px
    height = np.interp(found[:, 0], drawn_px[:, 0], drawn_px[:, 1])
    inside = (found[:, 0] > drawn_px[4, 0]) & (found[:, 0] < drawn_px[-4, 0])
    assert np.abs(found[:, 1] - height)[inside].max() < 1.5
