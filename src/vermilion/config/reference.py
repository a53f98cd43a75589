"""Generate what documents the configuration: JSON schemas and the reference page.

`python -m vermilion.config.reference` writes them; a test prints the difference where they drift.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

from vermilion.config.root import Configuration
from vermilion.config.sheet_cells import COLUMNS
from vermilion.config.sheet_numbers import EYE_DISTANCE_MM
from vermilion.config.takes import SPLIT
from vermilion.storage.files import atomic_path

ROLES = ("tattoo", "plain", "video", "tracked")


def generated_files() -> dict[str, str]:
    """Path relative to the project -> text, of every generated file."""
    return {
        "workflow/schemas/config.schema.json": _json(Configuration.model_json_schema()),
        "workflow/schemas/takes.schema.json": _json(take_sheet_schema()),
        "docs/configuration.md": reference_page(),
    }


def take_sheet_schema() -> dict[str, Any]:
    """JSON schema of one row of the take sheet."""
    name = {"type": "string", "pattern": "^[A-Za-z0-9_.]+$"}
    whole = {"anyOf": [{"type": "integer", "minimum": 0}, {"const": ""}]}
    properties = {
        "subject": {**name, "description": "Name of the person."},
        "take": {**name, "description": "Name of the take; unique for the subject."},
        "role": {"enum": list(ROLES), "description": "`plain`, `tattoo`, `video` or `tracked`."},
        "source": {
            "type": "string",
            "description": "Capture folder, frame folder, video or single image; `studio` for a synthetic one.",
        },
        "first": {
            **whole,
            "description": "First frame: the neutral, mouth slightly open. Empty: the first of the source.",
        },
        "last": {**whole, "description": "Last frame, included. Empty: the last of the source."},
        "fps": {"type": "number", "exclusiveMinimum": 0, "description": "Frames a second."},
        "split": {
            "type": "string",
            "pattern": f"^({SPLIT})$",
            "description": "train, test, none, or test:A-B,C-D (these stretches are held out).",
        },
        "face": {
            "type": "string",
            "description": "Which of several faces is followed: nothing (the largest), `x,y` (the nearest) "
            "or `left,top,right,bottom` (the largest in a box), pixels. The column may be left out.",
        },
        "focal": {
            "anyOf": [{"type": "number", "minimum": 0.3, "maximum": 10}, {"const": ""}],
            "description": "Known focal length of a single camera without calibration, over the length of the "
            "image's longer side (millimetres of a full-frame lens over 36). Empty: estimated. The column may "
            "be left out.",
        },
        "eye_distance_mm": {
            "anyOf": [
                {"type": "number", "minimum": EYE_DISTANCE_MM[0], "maximum": EYE_DISTANCE_MM[1]},
                {"const": ""},
            ],
            "description": "Measured distance of the subject's pupils, looking far ahead (mm), in one row of "
            "theirs: one camera does not tell how large a head is. Empty: the size is the face model's. The "
            "column may be left out.",
        },
        "of": {
            "type": "string",
            "description": "Of a `tracked` row: the take of the same subject whose images the sequence was "
            "tracked in, and whose base it is. Empty: none. The column may be left out.",
        },
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A row of the take sheet",
        "type": "object",
        "properties": properties,
        "required": list(COLUMNS),
        "additionalProperties": False,
    }


def reference_page() -> str:
    """The reference of all keys, in Markdown."""
    lines = [
        "# Configuration reference",
        "",
        "Generated from the code by `make docs`. Unknown keys are errors; every problem of the",
        "configuration and of the take sheet is reported at once, before any job runs.",
        "",
    ]
    lines += _section(Configuration, "")
    lines += ["## The take sheet", "", "| column | meaning |", "|---|---|"]
    for name, entry in take_sheet_schema()["properties"].items():
        lines.append(f"| `{name}` | {entry['description']} |")
    return "\n".join(lines) + "\n"


def _section(model: type[BaseModel], prefix: str) -> list[str]:
    rows, nested = [], []
    for name, field in model.model_fields.items():
        key = f"{prefix}{name}"
        description = (field.description or "").replace("|", "\\|").replace("\n", " ")
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            nested += [f"## `{key}`", "", description, "", *_section(inner, f"{key}.")]
            continue
        default = field.get_default(call_default_factory=True)
        shown = json.dumps(_plain(default)) if not field.is_required() else "(needed)"
        limits = ", ".join(_limit(m) for m in field.metadata if _limit(m))
        rows.append(f"| `{key}` | `{shown}` | {limits} | {description} |")
        for named in get_args(inner):
            if isinstance(named, type) and issubclass(named, BaseModel):
                of_each = f"{key}.<name>"
                nested += [f"## `{of_each}`", "", f"Of each in `{key}`.", ""]
                nested += _section(named, f"{of_each}.")
    table = ["| key | default | range | meaning |", "|---|---|---|---|", *rows, ""] if rows else []
    return table + nested


def _limit(constraint: Any) -> str:
    signs = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<", "min_length": "length >="}
    return ", ".join(
        f"{sign} {getattr(constraint, name)}"
        for name, sign in signs.items()
        if getattr(constraint, name, None) is not None
    )


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _json(schema: dict[str, Any]) -> str:
    return json.dumps(schema, indent=2) + "\n"


def write_all(root: Path) -> None:
    """Write every generated file below the project's root."""
    for name, text in generated_files().items():
        with atomic_path(root / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_all(Path(__file__).resolve().parents[3])
