"""A default has one home, the configuration; where the library repeats one, both are equal."""

import ast
import inspect
from dataclasses import MISSING, fields, is_dataclass
from importlib import import_module
from pathlib import Path

import pytest

from tests.syntax import tree_of
from tests.unit.default_pairs import CLASSES, FUNCTIONS, WITHOUT_SECTION
from vermilion.config.root import Configuration
from vermilion.config.studio import StudioTake
from vermilion.config.tracking import ScanConfig

SOURCE = Path(__file__).resolve().parents[2] / "src" / "vermilion"
#: Sections by name; those of one take or one scan stand beside the whole configuration.
ROOTS = {
    "": Configuration(),
    "studio_take": StudioTake(),
    "scan": ScanConfig(path="head.obj"),
}


def configured(key):
    """The default of a key: dotted from the configuration, or `root:key`."""
    root, _, path = key.rpartition(":")
    value = ROOTS[root]
    for part in path.split("."):
        value = getattr(value, part)
    return plain(value)


def plain(value):
    """Lists as tuples: a configuration has the one, a frozen dataclass the other."""
    return tuple(plain(item) for item in value) if isinstance(value, list | tuple) else value


def found(name):
    """What a dotted name below the package stands for."""
    parts = name.split(".")
    for split in range(len(parts), 0, -1):
        if SOURCE.joinpath(*parts[:split]).with_suffix(".py").is_file():
            target = import_module("vermilion." + ".".join(parts[:split]))
            for part in parts[split:]:
                target = getattr(target, part)
            return target
    raise AttributeError(name)


def default_of(item):
    return item.default_factory() if item.default is MISSING else item.default


def differences(values, sections, pair, prefix=""):
    """Fields that differ from the configuration, or are in no section: `field: library, key`."""
    for name, value in values.items():
        place = prefix + name
        if place in pair.unset:
            continue
        keys = [f"{s}.{name}" for s in sections if hasattr(configured(s), name)]
        if place in pair.renamed:
            keys = [pair.renamed[place]]
        if is_dataclass(value):
            # A class with its own defaults has its own pair.
            inner = {item.name: getattr(value, item.name) for item in fields(value)}
            if value != type(value)():
                yield from differences(inner, keys[:1], pair, f"{place}.")
        elif keys and plain(value) != configured(keys[0]):
            yield f"{place}: {value!r}, {keys[0]}: {configured(keys[0])!r}"
        elif not keys:
            yield f"{place}: {value!r}, in none of {', '.join(sections)}"


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_settings_have_the_defaults_of_the_configuration(name):
    pair = CLASSES[name]
    values = {
        item.name: default_of(item)
        for item in fields(found(name))
        if not (item.default is MISSING and item.default_factory is MISSING)
    }
    # Arrays are results of a fit, not settings.
    values = {name: value for name, value in values.items() if not hasattr(value, "shape")}
    assert list(differences(values, pair.sections, pair)) == []


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_keywords_have_the_defaults_of_the_configuration(name):
    parameters = inspect.signature(found(name)).parameters
    defaults = {keyword: parameters[keyword].default for keyword in FUNCTIONS[name]}
    without = [key for key, value in defaults.items() if value is inspect.Parameter.empty]
    assert without == [], "these have no default any more: remove the pairs"
    wrong = {
        keyword: (value, configured(FUNCTIONS[name][keyword]))
        for keyword, value in defaults.items()
        if plain(value) != configured(FUNCTIONS[name][keyword])
    }
    assert wrong == {}


def is_number(node):
    if isinstance(node, ast.Tuple):
        return bool(node.elts) and all(is_number(item) for item in node.elts)
    value = node.operand if isinstance(node, ast.UnaryOp) else node
    is_constant = isinstance(value, ast.Constant)
    return (
        is_constant and isinstance(value.value, int | float) and not isinstance(value.value, bool)
    )


def classes_with_numbers():
    """module.Class of every dataclass of the library with a number as the default of a field."""
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        for node in tree_of(path).body:
            if parts[0] == "config" or not isinstance(node, ast.ClassDef):
                continue
            if any("dataclass" in ast.unparse(d) for d in node.decorator_list) and any(
                isinstance(item, ast.AnnAssign) and item.value and is_number(item.value)
                for item in node.body
            ):
                yield ".".join([*parts, node.name])


def test_every_class_with_defaults_has_a_section_or_a_reason():
    known = set(classes_with_numbers())
    assert len(known) > 20
    without = sorted(known - set(CLASSES) - set(WITHOUT_SECTION))
    assert without == [], "pair these with a section of the configuration, or take the defaults out"
    assert sorted(set(WITHOUT_SECTION) - known) == [], "no class has such defaults any more"
    assert sorted(set(WITHOUT_SECTION) & set(CLASSES)) == [], "a section and a reason for none"
