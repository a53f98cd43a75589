"""Models of the generated head."""

import pytest

from tests import heads
from vermilion.faces.model import FaceModel


@pytest.fixture
def studio() -> FaceModel:
    return heads.studio()


@pytest.fixture
def template() -> FaceModel:
    return heads.template()


@pytest.fixture
def tracker() -> FaceModel:
    return heads.tracker()
