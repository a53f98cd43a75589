"""Image files in a colour space that is given by name (OpenColorIO)."""

from __future__ import annotations

import difflib
from functools import cache

import numpy as np
import OpenImageIO as oiio

#: The studio configuration that is built into OpenColorIO, pinned: the same name, the same values.
CONFIGURATION = "ocio://studio-config-v2.1.0_aces-v1.3_ocio-v2.3"
#: Linear light of sRGB's primaries, what images are processed in.
WORKING = "Linear Rec.709 (sRGB)"


@cache
def colour_spaces() -> tuple[str, ...]:
    """Names of the colour spaces."""
    return tuple(oiio.ColorConfig(CONFIGURATION).getColorSpaceNames())


def check_colour_space(name: str) -> None:
    """Raise ValueError, with the nearest names, where there is no such colour space."""
    if name not in colour_spaces():
        near = difflib.get_close_matches(name, colour_spaces(), n=4, cutoff=0.3)
        near = near or ["ACEScg", "ARRI LogC3 (EI800)", "sRGB - Texture"]
        raise ValueError(f"'{name}' is no colour space of {CONFIGURATION}; near: {', '.join(near)}")


def to_linear(pixels: np.ndarray, name: str) -> np.ndarray:
    """Linear sRGB light of pixels (h, w, 3) in a colour space, float32; colours outside are cut at 0."""
    check_colour_space(name)
    converted = oiio.ImageBufAlgo.colorconvert(
        oiio.ImageBuf(np.ascontiguousarray(pixels, dtype=np.float32)),
        name,
        WORKING,
        False,
        "",
        "",
        CONFIGURATION,
    )
    if converted.has_error:
        raise ValueError(f"'{name}' cannot be converted ({converted.geterror()})")
    return np.maximum(np.asarray(converted.get_pixels(oiio.FLOAT), dtype=np.float32), 0.0)
