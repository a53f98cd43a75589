"""The face model of `vermilion lips`: the user's copy, the cache, a download, or the embedded one."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from vermilion.config.face_model import ICT_VARIABLE, TITLES
from vermilion.faces.ict_cache import LICENCE, cached_archive, fetch
from vermilion.storage.errors import InputError, VermilionError

#: Folder or archive of ICT-FaceKit; `procedural` asks for the embedded model.
VARIABLE = ICT_VARIABLE
EMBEDDED = "procedural"
ICT = "ict"
REMEDY = (
    f"`export {VARIABLE}=/path/to/FaceXModel.tar.xz` (the archive, or the folder) and run again"
)


@dataclass(frozen=True)
class ModelChoice:
    """A face model: the section of a configuration, its name for people, a sentence that says where it is from."""

    section: dict[str, str]
    name: str
    said: str


def cache_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Where files that were fetched are kept: VERMILION_CACHE, or the user's cache folder."""
    if given := environment.get("VERMILION_CACHE"):
        return Path(given)
    base = (
        environment.get("XDG_CACHE_HOME")
        or Path(environment.get("HOME", "~")).expanduser() / ".cache"
    )
    return Path(base) / "vermilion"


def face_model(
    environment: Mapping[str, str] = os.environ,
    before: Mapping[str, str] | None = None,
    results: str = "",
) -> ModelChoice:
    """The face model of a clip: the user's copy, that of the result before, the cache, a download, the embedded one.

    Args:
        environment: variables of the user.
        before: the section `face_model` of the configuration that is in the results already: where the user's
            variable names nothing, ICT-FaceKit of this section is used again.
        results: the folder that `before` is of, for messages.

    Raises:
        InputError: the user's variable names no file or folder.
        VermilionError: `before` names ICT-FaceKit, which is not there any more and cannot be fetched.
    """
    named = environment.get(VARIABLE, "")
    if named == EMBEDDED:
        asked = f"{TITLES[EMBEDDED]} ({VARIABLE}={EMBEDDED})"
        return ModelChoice({"name": EMBEDDED}, asked, f"Face model: {asked}.")
    if named:
        path = Path(named).expanduser().resolve()
        if not path.exists():
            raise InputError(
                f"{VARIABLE}={named}, which is not there",
                "the folder FaceXModel of ICT-FaceKit or an archive of it, or `procedural`",
                "Correct the variable or unset it.",
            )
        return _ict(path, f"{VARIABLE}={named}")
    old = (
        Path(before["path"]) if before and before.get("name") == ICT and "path" in before else None
    )
    if old is not None and os.access(old, os.R_OK):
        return _ict(old, f"{old}, with which {results} was made")
    folder = cache_folder(environment)
    kept = cached_archive(folder)
    if kept.is_file():
        return _ict(kept.resolve(), str(kept))
    try:
        print(f"Fetching the face model once: {LICENCE}.", file=sys.stderr, flush=True)
        path = fetch(folder, tell=_tell)
    except (InputError, OSError) as error:
        if old is not None:
            raise VermilionError(
                f"{results} was made with ICT-FaceKit, which is not at {old} any more and could not be fetched "
                f"({_brief(error)}). {REMEDY}, or give OUT= for a result of its own."
            ) from error
        return ModelChoice(
            {"name": EMBEDDED},
            f"{TITLES[EMBEDDED]} ({TITLES[ICT]} was not found; see {VARIABLE} in README)",
            f"Face model: {TITLES[EMBEDDED]}, which knows fewer people than {TITLES[ICT]}: {_brief(error)}. "
            f"For {TITLES[ICT]}: {REMEDY}.",
        )
    return _ict(path.resolve(), f"{path}; {LICENCE}")


def face_model_before(configuration: Path) -> dict[str, str] | None:
    """The section `face_model` of a configuration that is there already; None where it tells none."""
    try:
        section = yaml.safe_load(configuration.read_text(encoding="utf-8"))["face_model"]
        return {str(key): str(value) for key, value in section.items()}
    except (OSError, ValueError, TypeError, KeyError, AttributeError, yaml.YAMLError):
        return None


def _ict(path: Path, whence: str) -> ModelChoice:
    section = {"name": ICT, "path": str(path)}
    return ModelChoice(section, TITLES[ICT], f"Face model: {TITLES[ICT]} ({whence}).")


def _brief(error: Exception) -> str:
    return error.brief if isinstance(error, InputError) else str(error)


def _tell(count: int) -> None:
    if sys.stderr.isatty():
        print(f"\r\033[K{count / 1e6:.0f} MB", end="", file=sys.stderr, flush=True)
