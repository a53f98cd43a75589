"""The fingerprint sees what runs, and nothing else."""

import pytest

from vermilion.provenance import fingerprint as module
from vermilion.provenance.fingerprint import _files_of, _read, fingerprint
from vermilion.provenance.known_code import KnownCode


@pytest.fixture(autouse=True)
def known(tmp_path, monkeypatch):
    """Where entries are kept, none at first; returns what opens that file again, as another process does."""

    def opened():
        store = KnownCode(tmp_path / "kept" / "fingerprints.json")
        monkeypatch.setattr(module, "known_code", lambda: store)
        return store

    opened()
    return opened


@pytest.fixture
def project(tmp_path):
    source = tmp_path / "vermilion"
    (source / "deep").mkdir(parents=True)
    (source / "__init__.py").write_text('"""Package."""\n')
    (source / "deep" / "__init__.py").write_text("")
    (source / "deep" / "maths.py").write_text("from vermilion.base import ONE\n\nTWO = ONE + 1\n")
    (source / "base.py").write_text('"""Base."""\n\nONE = 1\n')
    (source / "other.py").write_text("THREE = 3\n")
    script = tmp_path / "script.py"
    script.write_text("def main():\n    from vermilion.deep.maths import TWO\n    print(TWO)\n")

    def mark():
        for cached in (fingerprint, _read, _files_of):
            cached.cache_clear()
        return fingerprint(script, source)

    return source, script, mark


def test_comment_docstring_and_layout_change_nothing(project):
    source, script, mark = project
    before = mark()
    (source / "base.py").write_text('"""Another docstring."""\n# a comment\nONE   =   1\n')
    script.write_text("# why\n" + script.read_text())
    assert mark() == before


def test_line_in_an_indirect_import_changes_it(project):
    source, _, mark = project
    before = mark()
    (source / "base.py").write_text("ONE = 2\n")
    assert mark() != before


def test_module_that_is_not_imported_changes_nothing(project):
    source, _, mark = project
    before = mark()
    (source / "other.py").write_text("THREE = 4\n")
    assert mark() == before


def test_package_file_on_the_way_counts(project):
    source, _, mark = project
    before = mark()
    (source / "deep" / "__init__.py").write_text("SIDE_EFFECT = 1\n")
    assert mark() != before


def test_the_script_itself_counts(project):
    _, script, mark = project
    before = mark()
    script.write_text(script.read_text() + "\nmain()\n")
    assert mark() != before


def test_what_another_process_has_parsed_is_not_parsed_again(project, known, monkeypatch):
    source, _, mark = project
    store = known()
    before = mark()
    store.write()
    known()
    with monkeypatch.context() as patch:
        patch.setattr(module, "_parsed", None)
        assert mark() == before
    (source / "base.py").write_text("ONE = 2\n")
    assert mark() != before
    (source / "base.py").write_text('"""Base."""\n\nONE = 1\n')
    assert mark() == before


@pytest.mark.parametrize("damage", [b"", b"[1]", b'{"a": 1}', b"\xff"])
def test_a_damaged_file_of_entries_is_none(project, known, damage):
    _, _, mark = project
    store = known()
    before = mark()
    store.write()
    store.path.write_bytes(damage)
    assert known().found == {}
    assert mark() == before


def test_entries_of_two_processes_are_kept_and_a_folder_that_is_none_harms_nothing(tmp_path):
    one, other = (KnownCode(tmp_path / "kept.json") for _ in range(2))
    one.add("a", "1", ("vermilion.base",))
    other.add("b", "2", ())
    one.write()
    other.write()
    assert KnownCode(tmp_path / "kept.json").found == {
        "a": ("1", ("vermilion.base",)),
        "b": ("2", ()),
    }
    (tmp_path / "file").touch()
    nowhere = KnownCode(tmp_path / "file" / "kept.json")
    nowhere.add("a", "1", ())
    nowhere.write()
    assert nowhere.get("a") == ("1", ())
