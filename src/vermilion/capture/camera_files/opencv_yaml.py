"""The YAML that OpenCV's FileStorage writes, read without OpenCV: its reader ends the process on some damage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

#: A rig has some numbers a camera (bytes).
_MOST_BYTES = 2_000_000
_MATRICES = ("tag:yaml.org,2002:opencv-matrix", "tag:yaml.org,2002:opencv-nd-matrix")
_NOT_FINITE = {".nan": np.nan, ".inf": np.inf, "+.inf": np.inf, "-.inf": -np.inf}


class _Loader(yaml.SafeLoader):
    """SafeLoader with OpenCV's matrices."""


def _matrix(loader: yaml.SafeLoader, node: yaml.Node) -> np.ndarray:
    entry = loader.construct_mapping(node, deep=True)
    numbers = [_number(value) for value in entry["data"]]
    shape = [int(side) for side in entry.get("sizes") or (entry["rows"], entry["cols"])]
    return np.array(numbers, dtype=float).reshape(*shape, -1)[..., 0]


for _tag in _MATRICES:
    _Loader.add_constructor(_tag, _matrix)


def load_opencv_yaml(path: Path) -> dict[str, Any]:
    """Name -> value of a file; matrices are (rows, columns) float.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is none of OpenCV's YAML, or damaged.
    """
    if path.stat().st_size > _MOST_BYTES:
        raise ValueError(f"more than {_MOST_BYTES} bytes")
    text = path.read_text(encoding="utf-8-sig")
    if text.startswith("%YAML"):  # written as `%YAML:1.0`, which YAML has otherwise
        text = text.partition("\n")[2]
    try:
        content = _Loader(text).get_single_data()
    except (
        yaml.YAMLError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
    ) as error:
        raise ValueError(_reason(error)) from error
    if not isinstance(content, dict):
        raise ValueError("empty, or no names and values")
    return {str(name): value for name, value in content.items()}


def _number(value: object) -> float:
    if isinstance(value, str):
        return _NOT_FINITE[value.lower()] if value.lower() in _NOT_FINITE else float(value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    raise ValueError(f"{value!r:.30} in a matrix")


def _reason(error: Exception) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        return f"line {error.problem_mark.line + 2}: {error.problem!s:.100}"
    return f"damaged: {error!s:.100}"
