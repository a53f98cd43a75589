"""Small videos as cameras and phones write them, made for a test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.reformatter import ColorRange, Colorspace

#: Size of the images (width, height); no symmetry of the square maps one onto itself.
WIDTH, HEIGHT = 96, 64


def scene(moment: float, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """A smooth coloured image (h, w, 3) uint8 with a bright bar that moves by 2 px a moment."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    image = np.stack([60 + 120 * x / width, 50 + 100 * y / height, 170 - 90 * x / width], axis=-1)
    inside = np.clip(6.5 - np.abs(x - 0.25 * width - 2 * moment), 0, 1)
    image += (np.array([200, 190, 180]) - image) * (inside * (y < 0.6 * height))[..., None]
    return np.rint(image).astype(np.uint8)


def write_clip(
    path: Path,
    images: Sequence[np.ndarray],
    *,
    pix_fmt: str = "yuv444p",
    matrix: Colorspace = Colorspace.ITU709,
    tags: dict[str, int] | None = None,
    options: dict[str, str] | None = None,
    container: dict[str, str] | None = None,
    stamps: Sequence[int] | None = None,
    prepare: Callable[[av.VideoStream], None] | None = None,
) -> Path:
    """Write (h, w, 3) uint8 R'G'B' (or uint16) images at 25 frames a second, nearly without loss.

    Args:
        matrix: of the conversion; nothing is tagged but what `tags` say.
        tags: attributes of the codec: `colorspace`, `color_range` (2: full, and converted so),
            `color_trc`, `color_primaries`.
        stamps: time stamp of each frame (1/25 s); by default 0, 1, 2, ...
        prepare: called with the stream before anything is encoded.
    """
    full = (tags or {}).get("color_range") == 2
    with av.open(str(path), "w", options=container or {}) as out:
        stream = out.add_stream("libx264", rate=Fraction(25))
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = pix_fmt
        stream.codec_context.time_base = Fraction(1, 25)
        stream.options = {"crf": "4", "preset": "veryfast", **(options or {})}
        for name, value in (tags or {}).items():
            setattr(stream.codec_context, name, value)
        if prepare:
            prepare(stream)
        for number, image in enumerate(images):
            kind = "rgb24" if image.dtype == np.uint8 else "rgb48le"
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format=kind).reformat(
                format=pix_fmt,
                dst_colorspace=matrix,
                dst_color_range=ColorRange.JPEG if full else ColorRange.MPEG,
            )
            for name in ("colorspace", "color_range", "color_trc", "color_primaries"):
                setattr(frame, name, (tags or {}).get(name, 0 if name == "color_range" else 2))
            frame.pts = number if stamps is None else stamps[number]
            frame.time_base = Fraction(1, 25)
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return path


def mean_difference(one: np.ndarray, other: np.ndarray) -> float:
    """Mean absolute difference of two images of one shape, display values."""
    assert one.shape == other.shape, (one.shape, other.shape)
    return float(np.abs(one.astype(float) - other).mean())
