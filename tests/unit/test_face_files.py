"""Where the face model of `vermilion lips` comes from."""

import zipfile

import pytest
import yaml

from vermilion.app.face_files import VARIABLE, face_model, face_model_before
from vermilion.config.face_model import TITLES, FaceModelConfig
from vermilion.faces.ict_archive import archive_contents
from vermilion.faces.ict_cache import CONTENT_SHA256, cached_archive, content_sha256, fetch
from vermilion.storage.errors import InputError, VermilionError

FILES = {"vertex_indices.json": b"{}", "generic_neutral_mesh.obj": b"v 0 0 0\n"}


def archive(path, files=FILES, top="ICT-FaceKit-1/"):
    with zipfile.ZipFile(path, "w") as out:
        for name, content in files.items():
            out.writestr(f"{top}FaceXModel/{name}", content)
        out.writestr(f"{top}README.md", "text")
    return path


def test_what_is_pinned_is_the_content_not_the_packing(tmp_path):
    one = archive(tmp_path / "one.zip")
    two = archive(tmp_path / "two.zip", dict(reversed(FILES.items())), "other/")
    assert content_sha256(archive_contents(one)) == content_sha256(archive_contents(two))
    changed = archive(tmp_path / "three.zip", {**FILES, "generic_neutral_mesh.obj": b"v 0 0 1\n"})
    assert content_sha256(archive_contents(changed)) != content_sha256(archive_contents(one))


def test_the_archive_is_fetched_once_and_checked(tmp_path):
    source = archive(tmp_path / "one.zip")
    content = content_sha256(archive_contents(source))
    kept = fetch(tmp_path / "cache", source.as_uri(), content)
    assert kept == cached_archive(tmp_path / "cache") and kept.is_file()
    source.unlink()
    assert fetch(tmp_path / "cache", source.as_uri(), content) == kept


def test_another_content_is_not_kept(tmp_path):
    source = archive(tmp_path / "one.zip")
    with pytest.raises(InputError, match="SHA-256"):
        fetch(tmp_path / "cache", source.as_uri())
    assert not list((tmp_path / "cache").iterdir())


def test_the_users_own_copy_comes_first_then_the_cache(tmp_path):
    own = archive(tmp_path / "own.zip")
    environment = {VARIABLE: str(own), "VERMILION_CACHE": str(tmp_path / "cache")}
    assert face_model(environment).section == {"name": "ict", "path": str(own)}
    kept = cached_archive(tmp_path / "cache")
    kept.parent.mkdir()
    archive(kept)
    del environment[VARIABLE]
    found = face_model(environment)
    assert found.section == {"name": "ict", "path": str(kept)}
    assert found.name == "ICT-FaceKit" and str(kept) in found.said


@pytest.fixture
def offline(tmp_path, monkeypatch):
    """Variables of a user without a copy of ICT-FaceKit and without a network."""

    def refused(*_, **__):
        raise InputError("no answer", "the archive", "Fetch it by hand.")

    monkeypatch.setattr("vermilion.app.face_files.fetch", refused)
    return {"VERMILION_CACHE": str(tmp_path / "empty")}


def test_without_any_of_them_a_sentence_and_the_embedded_model(offline):
    found = face_model(offline)
    assert found.section == {"name": "procedural"}
    assert "no answer" in found.said and f"export {VARIABLE}=" in found.said
    assert "embedded (ICT-FaceKit was not found" in found.name


def test_a_face_model_has_one_name_for_people(offline, monkeypatch):
    monkeypatch.setitem(TITLES, "procedural", "home-made")
    names = [face_model(offline).name, face_model({VARIABLE: "procedural"}).name]
    assert all(name.startswith("home-made (") for name in [*names, FaceModelConfig().title])
    assert "home-made" in face_model(offline).said


def test_a_result_keeps_the_face_model_that_it_was_made_with(offline, tmp_path):
    own = archive(tmp_path / "own.zip")
    configuration = tmp_path / "config.yaml"
    section = {"name": "ict", "path": str(own)}
    configuration.write_text(yaml.safe_dump({"face_model": section}), encoding="utf-8")
    found = face_model(offline, face_model_before(configuration), "results/lips/x")
    assert found.section == section and "with which results/lips/x was made" in found.said
    asked = face_model({**offline, VARIABLE: "procedural"}, section)
    assert asked.section == {"name": "procedural"}  # what the user asks for comes first


def test_a_result_is_not_overwritten_with_another_face_model(offline, tmp_path):
    before = {"name": "ict", "path": str(tmp_path / "gone.zip")}
    with pytest.raises(VermilionError, match=r"gone\.zip any more.*export .*, or give OUT="):
        face_model(offline, before, "results/lips/x")
    assert face_model(offline, {"name": "procedural"}).section == {"name": "procedural"}


@pytest.mark.parametrize("text", ["", "face_model: 3\n", "a: [\n", "results: x\n"])
def test_a_configuration_that_tells_no_face_model_is_no_error(tmp_path, text):
    assert face_model_before(tmp_path / "absent.yaml") is None
    (tmp_path / "config.yaml").write_text(text, encoding="utf-8")
    assert face_model_before(tmp_path / "config.yaml") is None


def test_a_copy_that_is_not_there_is_an_error():
    with pytest.raises(InputError, match="not there"):
        face_model({VARIABLE: "/nowhere/at/all"})


@pytest.mark.data
@pytest.mark.slow
def test_the_pinned_content_is_that_of_the_data_folder(data_root):
    files = archive_contents(data_root / "ict-facekit" / "FaceXModel.tar.xz")
    assert content_sha256(files) == CONTENT_SHA256
