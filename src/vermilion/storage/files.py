"""Writing files and folders whole or not at all."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vermilion.storage.unwritable import explain, refuse_if_full

#: In the name of a file or folder that is being written; it begins with a dot.
_PART = ".part-"


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name in the same folder, with the same suffix; rename on success.

    A killed or failing writer leaves nothing under the final name.

    Raises:
        UnwritableError: the disk is full, also where the library that wrote did not say so, or the
            folder cannot be written to.
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(f"{path.suffix}", f".{path.stem}{_PART}", path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        refuse_if_full(path)
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except Exception as error:
        told = explain(error, path)
        if told is error:
            raise
        raise told from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; it takes the final name on success.

    What stood under the final name is replaced.

    Raises:
        UnwritableError: see `atomic_path`.
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}{_PART}", dir=path.parent))
        yield temporary
        refuse_if_full(path)
        temporary.chmod(0o777 & ~_umask())
        remove_result(path)
        temporary.replace(path)
    except Exception as error:
        told = explain(error, path)
        if told is error:
            raise
        raise told from error
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)


def remove_result(path: str | Path) -> None:
    """Remove a file or a folder, if there is one; a killed process leaves no part of a folder."""
    path = Path(path)
    if path.is_dir() and not path.is_symlink():
        aside = Path(tempfile.mkdtemp(prefix=f".{path.name}{_PART}", dir=path.parent))
        path.replace(aside)
        shutil.rmtree(aside)
    else:
        path.unlink(missing_ok=True)


def remove_unfinished(folder: str | Path, older_than_s: float = 0.0) -> list[Path]:
    """Remove the temporary files and folders that killed writers left anywhere below a folder.

    Args:
        folder: where nobody writes now, or nobody did for `older_than_s`.
        older_than_s: younger ones are kept, as their writer may be at work.

    Returns:
        what was removed.
    """
    removed = []
    latest = time.time() - older_than_s
    for place, folders, files in os.walk(folder):
        for name in [n for n in (*folders, *files) if n.startswith(".") and _PART in n]:
            path = Path(place, name)
            if path.lstat().st_mtime > latest:
                continue
            if name in folders:
                shutil.rmtree(path)
                folders.remove(name)
            else:
                path.unlink()
            removed.append(path)
    return removed


def sha256_of(path: str | Path) -> str:
    """Hexadecimal SHA-256 of a file, read in blocks."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
