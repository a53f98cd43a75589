"""Check that each function tells the shape of every array that it takes and returns.

`python tools/check_docstrings.py src` lists functions whose docstring does not, and exits with 1.
A function is looked at where an annotation names an array. The shape of a parameter stands in
parentheses after its name: "points_mm: (N, 3)", "`points_mm` (N, 3)", "points (N, 3)". Arguments of
`__init__`, and what properties of a dataclass return, may stand in the docstring of the class.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

#: A shape: (N, 3), (V,), (..., T, 9), (h, w, 3), (T * 9,), (6 + K,), "scalar"
_SHAPE = r"\((?:\.\.\.|[\w' +*/-]+)(?:,\s*(?:\.\.\.|[\w' +*/-]*))+\)"
#: Compiled kernels describe their arrays in the module's text.
_KERNELS = {"kernel", "njit", "jit", "guvectorize", "vectorize"}


def takes_array(annotation: ast.expr | None) -> bool:
    """Whether an annotation names an array."""
    return annotation is not None and "ndarray" in ast.unparse(annotation)


def tells_shape(text: str, name: str) -> bool:
    """Whether a text gives a shape for a parameter: behind its name, in the same sentence."""
    stem = name.removesuffix("_mm").removesuffix("_px")
    names = rf"(?:{re.escape(name)}|{re.escape(stem)})"
    return re.search(rf"\b{names}\b`?[^.]{{0,120}}?{_SHAPE}", text, re.S) is not None


def is_kernel(function: ast.FunctionDef) -> bool:
    """Whether the function is compiled."""
    return any(name in ast.unparse(d) for d in function.decorator_list for name in _KERNELS)


def faults_of(function: ast.FunctionDef, of_class: str) -> list[str]:
    """What the docstring of a function leaves out; `of_class` is the docstring of its class."""
    own = ast.get_docstring(function) or ""
    text = own + ("\n" + of_class if function.name == "__init__" else "")
    arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    arrays = [a.arg for a in arguments if takes_array(a.annotation)]
    faults = [f"shape of `{name}`" for name in arrays if not tells_shape(text, name)]
    if takes_array(function.returns):
        is_property = any("property" in ast.unparse(d) for d in function.decorator_list)
        if not re.search(_SHAPE, own + (of_class if is_property else "")):
            faults.append("shape of what it returns")
    return faults


def check_file(path: Path) -> list[str]:
    """One line a function of a file that leaves something out."""
    lines = []

    def visit(body: list[ast.stmt], of_class: str) -> None:
        for node in body:
            if isinstance(node, ast.ClassDef):
                visit(node.body, ast.get_docstring(node) or "")
            elif isinstance(node, ast.FunctionDef) and not is_kernel(node):
                public = not node.name.startswith("_") or node.name == "__init__"
                faults = faults_of(node, of_class) if public else []
                lines.extend(f"{path}:{node.lineno}: {node.name}: {fault}" for fault in faults)

    visit(ast.parse(path.read_text(encoding="utf-8")).body, "")
    return lines


def main(folders: list[str]) -> int:
    """Check every module below some folders; the number of faults decides the exit code."""
    files = [path for folder in folders for path in sorted(Path(folder).rglob("*.py"))]
    lines = [line for path in files for line in check_file(path)]
    for line in lines:
        print(line)
    print(f"{len(files)} modules, {len(lines)} arrays without a shape")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["src"]))
