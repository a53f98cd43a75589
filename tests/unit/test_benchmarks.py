"""Benchmarks: each is listed with a line, has a help, and is imported without an effect."""

import ast
from pathlib import Path

import pytest

from benchmarks.__main__ import benchmarks, main
from tests.syntax import tree_of

ROOT = Path(__file__).resolve().parents[2]
MODULES = {
    path.stem: tree_of(path)
    for path in sorted((ROOT / "benchmarks").glob("*.py"))
    if path.stem not in ("__init__", "__main__")
}
#: What a module may do when it is imported: nothing but give names to things.
HARMLESS = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef, ast.Assign, ast.AnnAssign)


def functions_of(tree):
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_benchmark_is_listed_with_a_line(capsys):
    assert main([]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[2:])
    assert listed == benchmarks()
    assert all(line.endswith(".") and len(line) <= 100 for line in listed.values())


def test_every_module_is_a_benchmark_or_shared_by_some():
    imported = {
        node.module.removeprefix("benchmarks.")
        for tree in MODULES.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module.startswith("benchmarks.")
    }
    assert set(MODULES) - set(benchmarks()) <= imported
    for name in benchmarks():
        assert {"add_arguments", "run"} <= functions_of(MODULES[name]), name


@pytest.mark.parametrize("name", benchmarks())
def test_help_is_the_docstring(name, capsys):
    with pytest.raises(SystemExit) as end:
        main([name, "--help"])
    assert end.value.code == 0
    shown = capsys.readouterr().out
    assert f"usage: python -m benchmarks {name}" in shown
    assert (ast.get_docstring(MODULES[name]) or "nothing") in shown


def test_an_unknown_name_lists_what_there_is(capsys):
    assert main(["bench_studio"]) == 2
    message = capsys.readouterr().err
    assert "'bench_studio'" in message and all(name in message for name in benchmarks())


def test_a_folder_without_the_take_is_named(tmp_path, capsys):
    assert main(["tracking", "--results", str(tmp_path), "--take", "p1/phone"]) == 1
    message = capsys.readouterr().err
    assert "no such take" in message and str(tmp_path / "takes" / "p1" / "phone") in message


@pytest.mark.parametrize("name", MODULES)
def test_an_import_has_no_effect(name):
    """A module imports and defines; it sets no variable, option or seed of another module."""
    docstring, *body = MODULES[name].body
    assert isinstance(docstring, ast.Expr) and isinstance(docstring.value, ast.Constant)
    for node in body:
        assert isinstance(node, HARMLESS), ast.unparse(node)
        for target in getattr(node, "targets", []):
            assert isinstance(target, ast.Name | ast.Tuple), ast.unparse(node)
