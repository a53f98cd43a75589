"""The house as docs/architecture.md draws it: floors, no circles, modules and functions of a size."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

from tests.syntax import nodes_of, text_of, tree_of
from vermilion.config.root import Configuration

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "vermilion"
#: Rooms from the ground up. A room imports from floors below, and on its own floor from rooms that
#: stand before it.
FLOORS = (
    ("storage", "provenance", "geometry", "imaging"),
    ("config", "faces", "appearance"),
    (
        "studio", "capture", "landmarks", "multiview", "inpaint", "scan", "tracking", "external", "detail",
        "contours", "correspondence", "features",
    ),
    ("regression", "database", "correction", "guided", "baselines", "evaluation"),
    ("export", "report"),
    ("app",),
)  # fmt: skip
ORDER = [room for floor in FLOORS for room in floor]

MODULE_LINES, FUNCTION_LINES, PARAMETERS = 300, 60, 9
#: Compiled kernels: one loop over pixels or triangles with all its arrays as arguments.
KERNELS = {("studio/kernels.py", "shade_hits"), ("geometry/closest_kernels.py", "closest_of")}

#: Stage -> where its name differs, and why.
PACKAGE_OF = {
    "face_model": "faces",  # one interface, many models
    "training": "regression",  # estimators serve guided correction as well
    "apply": "export",  # applying is correction; what is the stage's own is its files
}
#: Rule files that are no stage.
SHARED_RULES = {"beginning", "bucket", "common", "paths", "resources", "run", "targets"}
#: Stages that have no section of their own: what they read belongs to another stage's section.
WITHOUT_SECTION = {
    "scan": "tracking.scans",
    "external": "tracking.external",
    "report": "evaluation.figures",
}
#: Sections that are no stage: names of files and folders.
PLAIN_KEYS = {"results", "takes", "chunk_frames", "skip_takes"}


#: Names that several modules share, and what they mean in all of them.
SAME_OF_SEVERAL = {
    "a program, or a subcommand of one": {"main", "add_arguments", "run"},
    "a part of a face model that build.py asks for": {
        "studio_model",
        "template_model",
        "tracker_model",
    },
    "rows of the quality table, one a frame": {"quality_rows"},
}


def name_of(path):
    return ".".join(path.relative_to(SOURCE).with_suffix("").parts)


@cache
def texts(folder):
    """Path -> text of every Python file below a folder of the project."""
    return {path: text_of(path) for path in sorted((ROOT / folder).rglob("*.py"))}


@cache
def modules():
    """Module name -> its file."""
    return {name_of(path): path for path in texts("src/vermilion")}


@cache
def imports():
    """Module name -> modules of the library that it imports, wherever the import stands."""
    found = defaultdict(set)
    for name, path in modules().items():
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name}: a relative import"
                wanted = [(node.module, f"{node.module}.{alias.name}") for alias in node.names]
            elif isinstance(node, ast.Import):
                wanted = [(alias.name, alias.name) for alias in node.names]
            else:
                continue
            for base, whole in wanted:
                if whole.startswith("vermilion."):
                    base, whole = (
                        part.removeprefix("vermilion").lstrip(".") for part in (base, whole)
                    )
                    found[name].add(whole if whole in modules() else base or "__init__")
    return found


def test_every_room_has_a_floor():
    rooms = {name.split(".")[0] for name in modules()} - {"__init__"}
    assert rooms <= set(ORDER)


def test_no_room_imports_from_a_higher_one():
    wrong = [
        f"{name} imports {other}"
        for name, others in imports().items()
        for other in sorted(others)
        if name != "__init__" and ORDER.index(other.split(".")[0]) > ORDER.index(name.split(".")[0])
    ]
    assert wrong == []


def test_a_name_means_one_thing():
    """Public functions and classes of modules: two of a name do the same of two kinds, or are programs."""
    homes = defaultdict(list)
    for module, path in modules().items():
        for node in tree_of(path).body:
            kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
            if isinstance(node, kinds) and not node.name.startswith("_"):
                homes[node.name].append(module)
    assert len(homes) > 1500
    same = {name for names in SAME_OF_SEVERAL.values() for name in names}
    assert {n: h for n, h in homes.items() if len(h) > 1 and n not in same} == {}
    assert sorted(n for n in same if len(homes[n]) < 2) == [], "these have one home: take them out"


def test_the_library_does_not_see_the_configuration():
    """Rooms take plain settings: of `config` they know the names of regressors alone."""
    wrong = {
        name: other
        for name, others in imports().items()
        for other in others
        if other.startswith("config.") and other != "config.regressors"
        if name.split(".")[0] not in ("config", "app")
    }
    assert wrong == {}


def test_no_circle_of_imports():
    done, open_ = set(), []

    def visit(name):
        if name in open_:
            raise AssertionError(" -> ".join([*open_[open_.index(name) :], name]))
        if name in done:
            return
        open_.append(name)
        for other in sorted(imports()[name]):
            visit(other)
        open_.pop()
        done.add(name)

    for name in sorted(modules()):
        visit(name)


@pytest.mark.parametrize("folder", ["src/vermilion", "workflow/scripts", "benchmarks"])
def test_a_module_is_one_idea(folder):
    assert texts(folder)
    long = {str(p.relative_to(ROOT)): len(t.splitlines()) for p, t in texts(folder).items()}
    assert {name: lines for name, lines in long.items() if lines > MODULE_LINES} == {}


@cache
def functions(folder):
    """Place -> each function below a folder of the project, without the kernels."""
    return {
        f"{path.relative_to(ROOT)}:{node.lineno}:{node.name}": node
        for path in texts(folder)
        for node in nodes_of(path)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (str(path.relative_to(ROOT / folder)), node.name) not in KERNELS
    }


@pytest.mark.parametrize("folder", ["src/vermilion", "workflow/scripts", "benchmarks"])
def test_a_function_fits_on_a_screen(folder):
    long = {
        name: node.end_lineno - node.lineno + 1
        for name, node in functions(folder).items()
        if node.end_lineno - node.lineno + 1 > FUNCTION_LINES
    }
    assert long == {}


@pytest.mark.parametrize("folder", ["src/vermilion", "workflow/scripts", "benchmarks"])
def test_a_function_has_few_parameters(folder):
    many = {}
    for name, node in functions(folder).items():
        arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
        count = sum(argument.arg not in ("self", "cls") for argument in arguments)
        if count > PARAMETERS:
            many[name] = count
    assert many == {}


def stages():
    """Names of the rule files that are stages."""
    rules = (ROOT / "workflow" / "rules").glob("*.smk")
    return {path.stem for path in rules} - SHARED_RULES


@pytest.mark.parametrize("stage", sorted(stages()))
def test_a_stage_has_one_name(stage):
    """Configuration key = rule file = script folder = package."""
    assert (ROOT / "workflow" / "scripts" / stage).is_dir()
    assert (SOURCE / PACKAGE_OF.get(stage, stage) / "__init__.py").is_file()
    assert stage in Configuration.model_fields or stage in WITHOUT_SECTION


def test_every_section_is_a_stage():
    assert set(Configuration.model_fields) - PLAIN_KEYS <= stages()


def test_every_folder_of_scripts_is_a_stage():
    folders = {path.name for path in (ROOT / "workflow" / "scripts").iterdir() if path.is_dir()}
    assert folders - {"__pycache__"} == stages()


def test_a_path_of_the_results_is_spelt_once():
    """Rule files take paths from paths.smk: none of them spells a results folder by itself."""
    for path in (ROOT / "workflow" / "rules").glob("*.smk"):
        if path.stem != "paths":
            code = re.sub(r'"""(?:.|\n)*?"""', "", path.read_text())
            assert not re.search(r"\{subject\}/\{take\}[/\"]|/takes/|/subjects/", code.replace(
                '"{subject}/{take}', ""
            )), path.name  # fmt: skip


def test_each_path_has_one_name():
    text = (ROOT / "workflow" / "rules" / "paths.smk").read_text()
    values = re.findall(r"^    \w+ = (.+)$", text, re.MULTILINE)
    assert len(values) > 80
    assert len(values) == len(set(values))
