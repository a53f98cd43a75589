"""The face model of `vermilion lips`: the user's copy, the cache, a download, or the embedded one."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from vermilion.faces.ict_cache import LICENCE, cached_archive, fetch
from vermilion.storage.errors import InputError

#: Folder or archive of ICT-FaceKit; `procedural` asks for the embedded model.
VARIABLE = "VERMILION_ICT_FACEKIT"
EMBEDDED = "procedural"


def cache_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Where files that were fetched are kept: VERMILION_CACHE, or the user's cache folder."""
    if given := environment.get("VERMILION_CACHE"):
        return Path(given)
    base = (
        environment.get("XDG_CACHE_HOME")
        or Path(environment.get("HOME", "~")).expanduser() / ".cache"
    )
    return Path(base) / "vermilion"


def face_model(environment: Mapping[str, str] = os.environ) -> tuple[dict[str, str], list[str]]:
    """The section `face_model` of a configuration, and sentences for the user.

    Raises:
        InputError: the user's variable names no file or folder.
    """
    named = environment.get(VARIABLE, "")
    if named == EMBEDDED:
        return {"name": EMBEDDED}, []
    if named:
        path = Path(named).expanduser().resolve()
        if not path.exists():
            raise InputError(
                f"{VARIABLE}={named}, which is not there",
                "the folder FaceXModel of ICT-FaceKit or an archive of it, or `procedural`",
                "Correct the variable or unset it.",
            )
        return {"name": "ict", "path": str(path)}, []
    folder = cache_folder(environment)
    kept = cached_archive(folder)
    if kept.is_file():
        return {"name": "ict", "path": str(kept.resolve())}, []
    try:
        print(f"Fetching the face model once: {LICENCE}.", file=sys.stderr, flush=True)
        path = fetch(folder, tell=_tell)
    except (InputError, OSError) as error:
        return {"name": EMBEDDED}, [
            f"The embedded face model is used, which knows fewer people than ICT-FaceKit: {error}"
        ]
    return {"name": "ict", "path": str(path.resolve())}, [f"Face model: {LICENCE}; kept in {path}."]


def _tell(count: int) -> None:
    if sys.stderr.isatty():
        print(f"\r\033[K{count / 1e6:.0f} MB", end="", file=sys.stderr, flush=True)
