"""Does an image open, decode to its last row, and have the size it should?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vermilion.imaging.image_file import open_image
from vermilion.imaging.images import AS_TAGGED, ImageReading, image_size, shown_size
from vermilion.storage.errors import InputError
from vermilion.storage.files import sha256_of


@dataclass(frozen=True)
class ImageFacts:
    """What a file holds.

    Attributes:
        file: path relative to the capture.
        size_bytes, sha256: of the file.
        width_px, height_px: of the image as it is read: upright, square pixels, display window.
        channels: number of channels.
        bits: bits a channel.
    """

    file: str
    size_bytes: int
    sha256: str
    width_px: int
    height_px: int
    channels: int
    bits: int


def check_image(
    path: Path,
    root: Path,
    expected_size: tuple[int, int] | None,
    reading: ImageReading = AS_TAGGED,
) -> tuple[ImageFacts | None, str]:
    """Read an image whole.

    Args:
        path: the file.
        root: the capture, or the image itself; `ImageFacts.file` is relative to it.
        expected_size: (width, height), None for any.
        reading: what the file does not say of itself.

    Returns:
        (facts, "") or (facts or None, reason why the image cannot be used).
    """
    if not path.is_file():
        return None, "missing"
    if path.stat().st_size == 0:
        return None, "empty file"
    try:
        stream = open_image(path)
        width, height = shown_size(stream, path, reading)
    except InputError as error:
        return None, error.brief
    spec = stream.spec()
    pixels = stream.read_image(spec.format)
    failed = stream.has_error
    message = _one_line(stream.geterror())
    stream.close()
    if pixels is None or failed:
        return None, f"truncated or damaged{': ' + message if message else ''}"
    facts = ImageFacts(
        file=path.relative_to(root).as_posix() if root in path.parents else path.name,
        size_bytes=path.stat().st_size,
        sha256=sha256_of(path),
        width_px=width,
        height_px=height,
        channels=spec.nchannels,
        bits=8 * spec.format.size(),
    )
    if expected_size is not None and (width, height) != tuple(expected_size):
        wanted = "{}x{}".format(*expected_size)
        return facts, f"size {width}x{height}, expected {wanted}"
    return facts, ""


def header_size(path: Path, reading: ImageReading = AS_TAGGED) -> tuple[int, int] | None:
    """(width, height) from the header alone; None where it cannot be read."""
    try:
        return image_size(path, reading)
    except InputError:
        return None


def _one_line(message: str) -> str:
    return " ".join(message.split())
