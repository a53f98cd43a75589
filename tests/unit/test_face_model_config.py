"""The face model's configuration refuses what could not work, and says what to do."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from vermilion.config.face_model import FaceModelConfig


def test_the_default_needs_no_file():
    assert FaceModelConfig().name == "procedural"


def test_ict_needs_a_path_or_a_permitted_download():
    assert FaceModelConfig(name="ict", path="somewhere").path == "somewhere"
    with pytest.raises(ValidationError, match=r"path is empty and face_model\.download is false"):
        FaceModelConfig(name="ict")


def test_a_download_needs_its_checksum():
    with pytest.raises(ValidationError, match=r"face_model\.sha256 is empty"):
        FaceModelConfig(name="ict", download=True)
    assert FaceModelConfig(name="ict", download=True, sha256="0" * 64).download


def test_unknown_keys_are_refused():
    with pytest.raises(ValidationError, match="Extra inputs"):
        FaceModelConfig(resolution=3)
