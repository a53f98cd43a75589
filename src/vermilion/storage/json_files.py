"""JSON files of other programs: with a byte order mark or without, never so deep that reading fails."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def load_json(path: str | Path) -> Any:
    """The content of a JSON file in UTF-8.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no JSON, no UTF-8, or nested too deeply.
    """
    text = Path(path).read_text(encoding="utf-8-sig")
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
