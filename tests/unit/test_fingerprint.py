"""The fingerprint sees what runs, and nothing else."""

import pytest

from vermilion.provenance.fingerprint import _read, fingerprint


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
        for cached in (fingerprint, _read):
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
