"""A real browser on the sketch page: Playwright drives Debian's Chromium.

    pip install playwright (in the lock file);  apt-get install chromium

Without them the tests are skipped. Screenshots stay in results/browser/.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.sketch_take import CAMERA, TAKE, make_take
from tests.unit import guided_mouths as mouths

ROOT = Path(__file__).resolve().parents[2]
SCREENSHOTS = ROOT / "results" / "browser"
NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1366, "height": 768}
#: A job on a busy machine.
PATIENCE_MS = 180_000


def opened(chromium, file: Path, size_px: tuple[int, int]):
    """A page from a file in a window of a size, once its video can play; what it said, and which addresses it asked for."""
    page = chromium.new_page(viewport={"width": size_px[0], "height": size_px[1]})
    said, asked = [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    page.wait_for_function("document.querySelector('video').readyState >= 2")
    return page, said, asked


@pytest.fixture(scope="session")
def chromium():
    """A browser; VERMILION_CHROMIUM names another program than Debian's."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="no playwright: `make setup` installs it"
    )
    pytest.importorskip("uvicorn", reason="no uvicorn: `make setup` installs it")
    named = os.environ.get("VERMILION_CHROMIUM")
    program = named or next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip("no Chromium: `apt-get install chromium`, or set VERMILION_CHROMIUM")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """A take to draw on, rendered."""
    return make_take(tmp_path_factory.mktemp("take") / "project", rendered=True)


@pytest.fixture(scope="module")
def address(take):
    """Address of a server for the take, with its token."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "PYTHONUNBUFFERED": "1"}
    environment.pop("DISPLAY", None)
    words = ["-m", "vermilion.app.sketch", take.configuration, TAKE, "--no-browser", "--cores", "1"]
    server = subprocess.Popen(
        [sys.executable, *words], cwd=take.folder, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    line = server.stdout.readline()
    found = re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", line)
    assert found, line + server.stdout.read()
    yield found[0]
    server.send_signal(signal.SIGINT)
    server.wait(30)


class Page:
    """What a person does on the page.

    Attributes:
        tab: the browser's page.
        complaints: what the browser's console said; what the server refused is a sentence of the page, not one of these.
        hosts: who was asked for anything.
    """

    def __init__(self, tab, address: str):
        self.tab, self.complaints, self.hosts = tab, [], set()
        tab.set_default_timeout(PATIENCE_MS)
        tab.on("console", self._hear)
        tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        tab.on("request", lambda request: self.hosts.add(request.url.split("/")[2]))
        tab.goto(address)
        tab.locator("body[data-ready]").wait_for()
        self.still()

    def _hear(self, message) -> None:
        if message.type == "error" and "server responded with a status of 4" not in message.text:
            self.complaints.append(message.text)

    def press(self, *keys: str) -> None:
        for key in keys:
            self.tab.keyboard.press(key)

    def text(self, name: str) -> str:
        return self.tab.locator(f"#{name}").inner_text()

    def says(self, name: str, words: str) -> None:
        """Wait until a line of the page says so."""
        self.tab.locator(f"#{name}", has_text=re.compile(words)).wait_for()

    def still(self) -> None:
        """Wait until the image is where it will stay, and everything is saved."""
        self.tab.locator("#image[data-framed]").wait_for()
        self.tab.wait_for_timeout(300)
        self.says("saved", "^saved$")

    def on_screen(self, points_px: np.ndarray) -> np.ndarray:
        """Where pixels (n, 2) of the image are on the screen, (n, 2)."""
        scale, x, y = map(float, self.tab.get_attribute("#image", "data-place").split())
        box = self.tab.locator("#image").bounding_box()
        return np.asarray(points_px) * scale + [x + box["x"], y + box["y"]]

    def draw(self, points_px: np.ndarray) -> None:
        """Draw a stroke through pixels (n, 2) of the image with the mouse."""
        places = self.on_screen(points_px)
        self.tab.mouse.move(*places[0])
        self.tab.mouse.down()
        for place in places[1:]:
            self.tab.mouse.move(*place)
        self.tab.mouse.up()

    def go_to(self, frame: int) -> None:
        self.press("Home")
        for _ in range(frame):
            self.press(".")
        self.says("frame-text", f"^Frame {frame} ")
        self.still()

    def screenshot(self, name: str) -> None:
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        self.tab.wait_for_timeout(600)
        self.tab.screenshot(path=SCREENSHOTS / f"{name}.png")


@pytest.fixture
def open_page(chromium, address, take):
    """Opens tabs of one browser; the take has no sketch before and after."""
    clear(take)
    context = chromium.new_context(viewport=SIZE)
    yield lambda: Page(context.new_page(), address)
    context.close()
    clear(take)


@pytest.fixture
def page(open_page):
    return open_page()


def clear(take) -> None:
    for path in take.labels.rglob("*.json"):
        path.unlink()


def lips(take, frame: int) -> dict[str, np.ndarray]:
    """The true inner contours of a frame, (n, 2) px each: what the image shows."""
    curves = mouths.drawn(take.true_mm[frame], mouths.camera(CAMERA)).curves
    return {name: curve.points_px[::3] for name, curve in curves.items()}
