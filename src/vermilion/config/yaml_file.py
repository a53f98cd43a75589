"""YAML as a configuration needs it: no key twice, no anchors that multiply, nothing that runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from vermilion.storage.errors import InputError

#: A configuration has some hundred lines (bytes).
_MOST_BYTES = 1_000_000
#: Values that a file may have once its aliases are written out.
_MOST_VALUES = 100_000


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """SafeLoader that refuses a key which stands twice in one section."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: dict[str, int] = {}
        for key, _ in node.value:
            line = key.start_mark.line + 1
            if isinstance(key, yaml.ScalarNode) and key.value != "<<":
                if key.value in seen:
                    raise ValueError(
                        f"line {line}: the key '{key.value:.60}' a second time, after line {seen[key.value]}"
                    )
                seen[key.value] = line
        return super().construct_mapping(node, deep)


def read_yaml(path: str | Path) -> Any:
    """The content of a YAML file in UTF-8.

    Raises:
        InputError: the file cannot be read, is no YAML, has a key twice, tags that would make Python
            objects, or aliases that multiply.
    """
    try:
        size = Path(path).stat().st_size
        if size > _MOST_BYTES:
            raise ValueError(f"{size} bytes, which is more than {_MOST_BYTES}")
        loader = _Loader(Path(path).read_text(encoding="utf-8-sig"))
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _count(node, {})
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except (OSError, ValueError, TypeError, yaml.YAMLError, RecursionError) as error:
        raise InputError(
            f"no readable configuration ({_reason(error)})",
            "a YAML file in UTF-8, indented by blanks, each key once",
            "Correct the path (CONFIG=config/yours.yaml) or the file.",
            path=path,
        ) from error


def _count(node: yaml.Node, known: dict[int, int]) -> int:
    """Number of values of a node with its aliases written out."""
    if id(node) in known:
        return known[id(node)]
    total = 1
    if isinstance(node, yaml.MappingNode):
        total += sum(_count(value, known) for pair in node.value for value in pair)
    elif isinstance(node, yaml.SequenceNode):
        total += sum(_count(value, known) for value in node.value)
    if total > _MOST_VALUES:
        raise ValueError(f"anchors and aliases that stand for more than {_MOST_VALUES} values")
    known[id(node)] = total
    return total


def _reason(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "nested too deeply, or an anchor within itself"
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        hint = "; indent by blanks, not by tabs" if "\\t" in str(error.problem) else ""
        return f"line {error.problem_mark.line + 1}: {error.problem}{hint}"
    return " ".join(str(error).split())[:200]
