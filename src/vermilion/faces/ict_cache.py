"""ICT-FaceKit in the user's cache: fetched once, checked file by file, found again.

Archives of one commit may differ from day to day in how they are packed. What is pinned is therefore the
content: the SHA-256 of a list of all files of `FaceXModel/` that are read, each with its own SHA-256.
"""

from __future__ import annotations

import hashlib
import urllib.request
from collections.abc import Callable, Mapping
from pathlib import Path

from vermilion.faces.ict_archive import archive_contents
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path

COMMIT = "da5f95a607f5e6b37755b38d3385d7f2853732e5"
CONTENT_SHA256 = "e6e2f042e03901ec3a622b7a09fbe083f42c8918730a58106d0f0d1da7fa01c1"
URL = f"https://github.com/ICT-VGL/ICT-FaceKit/archive/{COMMIT}.zip"
LICENCE = "ICT-FaceKit, (c) USC Institute for Creative Technologies, MIT licence"
_TIMEOUT_S = 30
_BLOCK = 1 << 20


def cached_archive(folder: Path) -> Path:
    """Where the archive lies in a cache folder."""
    return folder / f"ict-facekit-{COMMIT[:12]}.zip"


def content_sha256(files: Mapping[str, bytes]) -> str:
    """SHA-256 of the model's files: names in order, each with the SHA-256 of its bytes."""
    digest = hashlib.sha256()
    for name in sorted(files):
        if name.endswith((".obj", ".json")):
            digest.update(f"{name}\0{hashlib.sha256(files[name]).hexdigest()}\n".encode())
    return digest.hexdigest()


def fetch(
    folder: Path,
    url: str = URL,
    content: str = CONTENT_SHA256,
    tell: Callable[[int], None] = lambda count: None,
) -> Path:
    """The archive in the cache folder; downloaded where it is not there yet.

    Args:
        folder: of the cache.
        url: address of the archive; content: `content_sha256` that it must have.
        tell: is called with the number of bytes that have come.

    Raises:
        InputError: no answer, or another content; nothing is kept then.
    """
    path = cached_archive(folder)
    if path.is_file():
        return path
    with atomic_path(path) as temporary:
        try:
            _download(url, temporary, tell)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no answer from {url} ({error})",
                "the archive of ICT-FaceKit",
                "Fetch it by hand (or clone the repository), then `export VERMILION_ICT_FACEKIT="
                "/path/to/FaceXModel.tar.xz` (the archive, or the folder) and run again.",
            ) from error
        found = content_sha256(archive_contents(temporary))
        if found != content:
            raise InputError(
                f"an archive at {url} whose files have the SHA-256 {found}",
                content,
                "Try again later, or name your own copy in VERMILION_ICT_FACEKIT.",
            )
    return path


def _download(url: str, path: Path, tell: Callable[[int], None]) -> None:
    with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as answer, open(path, "wb") as out:
        count = 0
        while block := answer.read(_BLOCK):
            out.write(block)
            count += len(block)
            tell(count)
