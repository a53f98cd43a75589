"""Where the face model of `vermilion lips` comes from."""

import zipfile

import pytest

from vermilion.app.face_files import VARIABLE, face_model
from vermilion.faces.ict_archive import archive_contents
from vermilion.faces.ict_cache import CONTENT_SHA256, cached_archive, content_sha256, fetch
from vermilion.storage.errors import InputError

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
    assert face_model(environment)[0] == {"name": "ict", "path": str(own)}
    kept = cached_archive(tmp_path / "cache")
    kept.parent.mkdir()
    archive(kept)
    del environment[VARIABLE]
    assert face_model(environment) == ({"name": "ict", "path": str(kept)}, [])


def test_without_any_of_them_a_sentence_and_the_embedded_model(tmp_path, monkeypatch):
    def refused(*_, **__):
        raise InputError("no answer", "the archive", "Fetch it by hand.")

    monkeypatch.setattr("vermilion.app.face_files.fetch", refused)
    section, (sentence,) = face_model({"VERMILION_CACHE": str(tmp_path)})
    assert section == {"name": "procedural"} and "no answer" in sentence


def test_a_copy_that_is_not_there_is_an_error():
    with pytest.raises(InputError, match="not there"):
        face_model({VARIABLE: "/nowhere/at/all"})


@pytest.mark.data
@pytest.mark.slow
def test_the_pinned_content_is_that_of_the_data_folder(data_root):
    files = archive_contents(data_root / "ict-facekit" / "FaceXModel.tar.xz")
    assert content_sha256(files) == CONTENT_SHA256
