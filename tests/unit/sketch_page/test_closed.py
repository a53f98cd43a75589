"""The server of the sketch page is closed: loopback, one token, one site, one take."""

import re

import pytest
from starlette.websockets import WebSocketDisconnect

from tests.sketch_take import CAMERA, TAKE
from tests.unit.sketch_page.visits import PORT, SKETCH, saved, sketch
from vermilion.app.sketch.server import STATIC
from vermilion.app.sketch.sketch_store import NOTHING


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
