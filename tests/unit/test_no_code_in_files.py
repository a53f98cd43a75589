"""No file that Vermilion reads or writes runs code: the source is scanned for what could."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.syntax import nodes_of

#: Modules that store Python objects, or whose loaders run code.
PICKLING = {
    *("pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"),
    *("jsonpickle", "torch"),
}
#: Functions, as they are called, that run code or read pickles.
RUNNING = {
    "eval",
    "exec",
    "os.system",
    "os.popen",
    "yaml.load",
    "yaml.unsafe_load",
    "yaml.full_load",
}
RUNNING |= {"pd.read_pickle", "pandas.read_pickle"}
METHODS = {"read_pickle", "to_pickle", "unsafe_load", "full_load"}
#: Array files are opened here alone, after they were looked at; tables here.
OPENED_IN = {
    "load": {"src/vermilion/storage/arrays.py", "src/vermilion/storage/sequences.py"},
    "save": {"src/vermilion/storage/arrays.py"},
    "savez": {"src/vermilion/storage/arrays.py"},
    "savez_compressed": {"src/vermilion/storage/arrays.py"},
    "read_csv": {"src/vermilion/storage/tables.py"},
}
#: The names of results are the project's own file `workflow/rules/paths.smk`.
KNOWN = {("src/vermilion/app/run_files.py", "exec")}


def findings(nodes: Iterable[ast.AST], name: str) -> list[str]:
    """What in a source file could run code from a file, or opens arrays beside `storage`."""
    found = []
    for node in nodes:
        if isinstance(node, ast.Import):
            found += [a.name for a in node.names if a.name.split(".")[0] in PICKLING]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PICKLING:
            found.append(node.module)
        elif isinstance(node, ast.Call):
            found += _of_call(node, name)
    return [what for what in found if (name, what) not in KNOWN]


def _of_call(node: ast.Call, name: str) -> list[str]:
    called = ast.unparse(node.func)
    last = called.rpartition(".")[2]
    values = {word.arg: word.value for word in node.keywords}
    found = []
    if called in RUNNING or ("." in called and last in METHODS):
        found.append(called)
    if "shell" in values and ast.unparse(values["shell"]) != "False":
        found.append(f"{called}(shell=...)")
    if "allow_pickle" in values and ast.unparse(values["allow_pickle"]) != "False":
        found.append(f"{called}(allow_pickle=...)")
    library = called.partition(".")[0] in ("np", "numpy", "pd", "pandas")
    in_package = name.startswith(("src/", "workflow/"))
    if library and in_package and last in OPENED_IN:
        if name not in OPENED_IN[last]:
            found.append(called)
        elif last != "read_csv" and "allow_pickle" not in values:
            found.append(f"{called} without allow_pickle=False")
    return found


def nodes_in(text: str) -> Iterable[ast.AST]:
    return ast.walk(ast.parse(text))


def sources() -> list[Path]:
    folders = ("src", "workflow", "benchmarks", "tools")
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))


def test_no_source_file_runs_code_of_a_file():
    assert len(sources()) > 300
    found = {}
    for path in sources():
        name = path.relative_to(ROOT).as_posix()
        wrong = findings(nodes_of(path), name)
        if wrong:
            found[name] = wrong
    assert found == {}


def test_no_rule_names_pickle():
    rules = [ROOT / "Snakefile", *sorted((ROOT / "workflow").rglob("*.smk"))]
    assert len(rules) > 10
    named = [p.name for p in rules if any(f"import {m}" in p.read_text() for m in PICKLING)]
    assert named == []


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import pickle", "pickle"),
        ("from joblib import load", "joblib"),
        ("import torch.nn", "torch.nn"),
        ("np.load(path, allow_pickle=True)", "np.load"),
        ("np.load(path)", "np.load"),
        ("numpy.savez(path, a=a)", "numpy.savez"),
        ("yaml.load(text)", "yaml.load"),
        ("pd.read_csv(path)", "pd.read_csv"),
        ("frame.to_pickle(path)", "frame.to_pickle"),
        ("eval(text)", "eval"),
        ("subprocess.run(words, shell=True)", "subprocess.run(shell=...)"),
    ],
)
def test_the_scan_finds_it(text, what):
    assert what in findings(nodes_in(text), "src/vermilion/somewhere.py")


def test_the_scan_finds_a_save_that_may_pickle():
    assert findings(nodes_in("np.save(stream, a)"), "src/vermilion/storage/arrays.py")
    assert not findings(
        nodes_in("np.save(s, a, allow_pickle=False)"), "src/vermilion/storage/arrays.py"
    )
