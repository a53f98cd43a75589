"""A take, its desk, and who comes to the page."""

import shutil
from dataclasses import replace

import pytest
from starlette.testclient import TestClient

from tests.sketch_take import TAKE, make_take
from tests.unit.sketch_page.visits import (
    ADDRESS,
    PORT,
)
from vermilion.app.sketch.desk import Desk
from vermilion.app.sketch.security import Gate
from vermilion.app.sketch.server import application
from vermilion.app.sketch.take_files import TakeFiles


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Made once; no test opens it itself."""
    return make_take(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def take(made, tmp_path_factory):
    return replace(
        made, folder=shutil.copytree(made.folder, tmp_path_factory.mktemp("take") / "take")
    )


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
