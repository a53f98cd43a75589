"""Opening an image file: what it is says its content, not its name; sizes that no camera has are refused."""

from __future__ import annotations

import os
from pathlib import Path

import OpenImageIO as oiio

from vermilion.storage.errors import ForbiddenInputError, InputError

#: An image with a longer side or more pixels is no frame of a camera: a damaged header, or a small
#: file that unpacks to gigabytes.
MOST_SIDE_PX, MOST_PIXELS = 50_000, 200_000_000
#: Formats whose values are linear light.
_LINEAR = ("openexr", "hdr")
#: Colours beside an alpha channel are not darkened by it.
_UNASSOCIATED = oiio.ImageSpec()
_UNASSOCIATED["oiio:UnassociatedAlpha"] = 1


def open_image(path: Path, **place) -> oiio.ImageInput:
    """Open an image file at its first part, alpha left apart.

    Raises InputError with the `place` (subject, take, camera, frame) where there is no such file, it
    is no image, or its header says a size over the limits; ForbiddenInputError where it may not be read.
    """
    if not path.is_file():
        raise InputError(
            "no such file",
            "an image",
            "Check the frame range of the take sheet.",
            path=path,
            **place,
        )
    if path.stat().st_size == 0:
        raise _unreadable(path, "it is empty", place)
    if not os.access(path, os.R_OK):
        raise ForbiddenInputError(
            "no permission to read",
            "an image that this user may read",
            f"Give the permission: `ls -l {path}` says who has it.",
            path=path,
            **place,
        )
    stream = oiio.ImageInput.open(str(path), _UNASSOCIATED)
    if not stream:
        raise _unreadable(path, _last_error(), place)
    check_size(stream, path, **place)
    return stream


def check_size(stream: oiio.ImageInput, path: Path, **place) -> None:
    """Raise InputError where the part that is open is larger than any camera's image."""
    spec = stream.spec()
    for width, height in ((spec.width, spec.height), (spec.full_width, spec.full_height)):
        if max(width, height) > MOST_SIDE_PX or width * height > MOST_PIXELS:
            stream.close()
            raise InputError(
                f"a header that says {width} x {height} pixels",
                f"at most {MOST_SIDE_PX} pixels a side and {MOST_PIXELS / 1e6:.0f} million in all",
                "Export the frame again.",
                path=path,
                **place,
            )


def is_exr(stream: oiio.ImageInput) -> bool:
    """Whether an open file is OpenEXR, whatever its name."""
    return stream.format_name() == "openexr"


def is_linear(stream: oiio.ImageInput) -> bool:
    """Whether the values of an open file are linear light."""
    return stream.format_name() in _LINEAR


def _last_error() -> str:
    try:
        return " ".join(oiio.geterror().split())
    except UnicodeDecodeError:  # it quotes the file
        return "damaged header"


def _unreadable(path: Path, why: str, place: dict) -> InputError:
    # OpenImageIO refuses by itself what would not fit into the machine's memory.
    why = why.partition(" If this is a valid file")[0]
    return InputError(
        f"an unreadable image ({why})",
        "PNG, JPEG, TIFF, EXR or DPX",
        "Export the frame again.",
        path=path,
        **place,
    )
