"""The sketch page's server: who may talk to it, what it refuses, and what it keeps."""

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("starlette", reason="starlette is not installed: `make setup`")
pytest.importorskip("httpx2", reason="httpx2 is not installed: `make setup`")
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from tests.sketch_take import CAMERA, CHUNK, LOST, N_FRAMES, SUGGESTED, TAKE, make_take
from tests.unit import guided_mouths as mouths
from vermilion.app.sketch.desk import Desk
from vermilion.app.sketch.packet import pack
from vermilion.app.sketch.propagation_run import PropagationRun, jobs_of
from vermilion.app.sketch.security import Gate
from vermilion.app.sketch.server import STATIC, application
from vermilion.app.sketch.sketch_store import NOTHING
from vermilion.app.sketch.take_files import TakeFiles
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import write_sequence

PORT = 8765
ADDRESS = f"http://127.0.0.1:{PORT}"
WIDTH, HEIGHT = mouths.IMAGE_PX
SKETCH = f"/api/sketch/{CAMERA}/2"
UPPER = [[250.0, 330.0], [320.0, 322.0], [390.0, 330.0]]


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    return make_take(tmp_path_factory.mktemp("take"))


@pytest.fixture(scope="module")
def desk(take):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(take.folder)
        yield Desk(TakeFiles.of(take.configuration, TAKE))


@pytest.fixture(scope="module")
def gate(desk):
    return Gate(application(desk), PORT)


@pytest.fixture
def visitor(gate):
    """A client that has no cookie yet."""
    return TestClient(gate, base_url=ADDRESS, follow_redirects=False)


@pytest.fixture
def page(gate, take):
    """A client that has exchanged the token; the take has no sketch afterwards."""
    client = TestClient(gate, base_url=ADDRESS, headers={"Origin": ADDRESS})
    assert client.get(f"/?token={gate.token}").status_code == 200
    yield client
    for path in take.labels.rglob("*.json"):
        path.unlink()


def sketch(frame=2, **changed):
    content = {
        "format": "vermilion sketch", "version": 1, "unit": "px", "camera": CAMERA, "frame": frame,
        "image_size_px": [WIDTH, HEIGHT],
        "curves": {"upper_inner": {"kind": "sure", "points": UPPER, "handles": UPPER}},
    }  # fmt: skip
    return content | changed


def curve(points, **more):
    return {"curves": {"upper_inner": {"kind": "sure", "points": points, **more}}}


def saved(take, frame=2):
    return sorted((take.labels / "sketches" / CAMERA).glob(f"{frame:06d}*"))


def drawn(take, frame):
    """What a careful person draws on a frame, as the page sends it."""
    curves = mouths.drawn(take.true_mm[frame], mouths.camera(CAMERA)).curves
    points = {name: c.points_px.tolist() for name, c in curves.items()}
    return sketch(frame, curves={n: {"kind": "sure", "points": p} for n, p in points.items()})


# Closed --------------------------------------------------------------------------------------------


def test_without_the_token_nothing_is_answered(visitor):
    for path in ("/", "/?token=wrong", "/static/main.js", "/api/take", f"/api/image/{CAMERA}/0"):
        answer = visitor.get(path)
        assert answer.status_code == 401
        assert "with its token" in answer.text
    assert visitor.get("/", headers={"Cookie": f"vermilion_sketch_{PORT}=guess"}).status_code == 401


def test_the_token_becomes_a_cookie_that_scripts_and_other_sites_do_not_get(visitor, gate):
    answer = visitor.get(f"/?token={gate.token}")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert gate.token not in answer.headers["set-cookie"]
    assert visitor.get("/api/take").json()["take"] == TAKE


@pytest.mark.parametrize("host", ["example.org", f"example.org:{PORT}", "127.0.0.1:1", ""])
def test_another_host_name_is_refused(page, host):
    answer = page.get("/api/take", headers={"Host": host})
    assert answer.status_code == 403
    assert "127.0.0.1 alone" in answer.json()["error"]


@pytest.mark.parametrize("origin", ["http://example.org", "null", "http://127.0.0.1:1"])
def test_another_origin_is_refused_even_with_the_cookie(page, take, origin):
    body = {"revision": NOTHING, "sketch": sketch()}
    for answer in (
        page.get("/api/take", headers={"Origin": origin}),
        page.put(SKETCH, json=body, headers={"Origin": origin}),
        page.post("/api/propagate", json={}, headers={"Origin": origin}),
    ):
        assert answer.status_code == 403
        assert "another page" in answer.json()["error"]
    assert saved(take) == []


def test_a_change_without_an_origin_is_refused(page, take):
    del page.headers["Origin"]
    assert page.put(SKETCH, json={"revision": NOTHING, "sketch": sketch()}).status_code == 403
    assert saved(take) == []


def test_a_link_on_another_site_is_refused(page):
    for site in ("cross-site", "same-site"):
        assert page.get("/", headers={"Sec-Fetch-Site": site}).status_code == 403
    assert page.get("/", headers={"Sec-Fetch-Site": "none"}).status_code == 200


def test_there_is_no_socket(page, visitor):
    for client in (page, visitor):
        with pytest.raises(WebSocketDisconnect), client.websocket_connect("/api/status"):
            pass


def test_every_answer_forbids_foreign_and_inline_scripts(page, visitor):
    for answer in (page.get("/"), page.get("/api/take"), page.get("/nothing"), visitor.get("/")):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_the_page_asks_nobody_else_and_has_no_inline_script():
    texts = {path.name: path.read_text() for path in STATIC.glob("*.*")}
    assert {"index.html", "main.js", "style.css"} <= set(texts)
    for name, text in texts.items():
        addresses = re.findall(r"https?://[^\s\"']*|(?:src|href)=\"//[^\"]*", text)
        assert [a for a in addresses if a != "http://www.w3.org/2000/svg"] == [], name
    assert "<script>" not in texts["index.html"]
    assert "onclick=" not in texts["index.html"]
    assert "style=" not in texts["index.html"]


def test_three_js_comes_with_its_licence_and_version():
    vendored = STATIC / "vendor"
    assert "The MIT License" in (vendored / "LICENSE.three.txt").read_text()
    assert 'const t="170"' in (vendored / "three.module.min.js").read_text()[:400]


@pytest.mark.parametrize(
    "path",
    [
        "/static/../server.py", "/static/..%2fserver.py", "/static/%2e%2e/%2e%2e/desk.py",
        "/static//etc/passwd", "/static/vendor/../../desk.py", "/api/sketch/..%2f..%2fx/2",
        "/api/image/..%2f..%2f..%2fetc%2fpasswd/0", "/api/mesh/base/..%2fcam/0",
        f"/api/mesh/..%2ftruth/{CAMERA}/0", f"/api/curve/..%2fx/{CAMERA}/0",
    ],
)  # fmt: skip
def test_no_path_leads_out_of_the_take(page, path):
    answer = page.get(path)
    assert answer.status_code == 404
    assert answer.json()["error"].endswith(("GET.", "has no file", ".")), answer.text


def test_sketches_are_not_written_through_a_link_out_of_the_take(page, take, tmp_path):
    folder = take.labels / "sketches"
    folder.mkdir(parents=True, exist_ok=True)
    aside = folder / CAMERA
    if aside.is_dir():
        aside.rmdir()
    aside.symlink_to(tmp_path)
    try:
        answer = page.put(SKETCH, json={"revision": NOTHING, "sketch": sketch()})
        assert answer.status_code == 403
        assert "outside the take" in answer.json()["error"]
        assert list(tmp_path.iterdir()) == []
    finally:
        aside.unlink()


# Hostile bodies ------------------------------------------------------------------------------------


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


# Sketches ------------------------------------------------------------------------------------------


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


# What the page shows -------------------------------------------------------------------------------


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


# Propagation ---------------------------------------------------------------------------------------


def test_a_propagation_needs_a_sketch(page):
    for path in ("/api/jobs", "/api/propagate"):
        answer = page.post(path, json={})
        assert answer.status_code == 422
        assert "No frame is drawn yet" in answer.json()["error"]


def test_the_jobs_of_a_dry_run_are_counted():
    printed = (
        "Job stats:\njob    count\n-----  -----\nguided_refine    3\nguided_train   1\ntotal  4\n"
    )
    assert jobs_of(printed) == {"guided_refine": 3, "guided_train": 1}
    assert jobs_of("Nothing to be done") == {}


def test_progress_and_a_failed_job_are_read_from_what_the_workflow_prints(tmp_path):
    log = tmp_path / "job.log"
    log.write_text("line\n" * 100 + "InputError: found nothing\n")
    run = PropagationRun("c.yaml", [], [])
    for line in (
        "rule guided_train:", "3 of 5 steps (60%) done", "Error in rule guided_correct:",
        "    jobid: 1", f"    log: {log} (check log file(s) for error details)",
    ):  # fmt: skip
        run._take_in(line)
    report = run.report()
    assert (report["done"], report["total"], report["rule"]) == (3, 5, "guided_train")
    assert "guided_correct failed" in run._failure()
    assert run.log().startswith(str(log))
    assert run.log().endswith("found nothing")


def test_a_take_that_does_not_follow_the_strokes_says_what_to_change(page, take):
    page.put(f"/api/sketch/{CAMERA}/4", json={"revision": NOTHING, "sketch": drawn(take, 4)})
    chunk = take.results / "takes" / "s" / "t" / "guided" / "chunks" / f"{CHUNK}.npy"
    try:
        write_sequence(chunk, take.base_mm)
        status = page.get("/api/status").json()
        assert status["propagated"] == list(range(N_FRAMES))
        assert max(status["changed_mm"].values()) < 1e-4
        assert "guided.regions.inner_mm (now 5)" in status["followed"]
        write_sequence(chunk, take.true_mm)
        status = page.get("/api/status").json()
        assert status["followed"] == ""
        assert min(status["changed_mm"].values()) > 0.1
    finally:
        chunk.unlink()


# Opening -------------------------------------------------------------------------------------------


def test_a_take_that_cannot_be_shown_is_refused_with_a_sentence(take, monkeypatch):
    monkeypatch.chdir(take.folder)
    with pytest.raises(InputError, match=r"`guided.takes` names s/t"):
        TakeFiles.of(take.configuration, "s/other")
    with pytest.raises(InputError, match="no readable configuration"):
        TakeFiles.of("nothing.yaml", TAKE)
    with pytest.raises(InputError, match="no workflow in this folder"):
        TakeFiles.of(take.configuration, TAKE, Path("nowhere/paths.smk"))
    files = TakeFiles.of(take.configuration, TAKE)
    chunk = files.sequence_chunks[0]
    chunk.rename(chunk.with_suffix(".away"))
    try:
        with pytest.raises(InputError, match=r"no sequence of take s/t yet.*snakemake guided"):
            Desk(files)
    finally:
        chunk.with_suffix(".away").rename(chunk)
