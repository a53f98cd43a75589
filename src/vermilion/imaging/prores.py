"""ProRes 422 HQ in a QuickTime file: what editing and tracking programs read without loss that shows."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

from vermilion.storage.files import atomic_path


def write_prores(path: str | Path, images: Iterable[np.ndarray], fps: float) -> None:
    """Write `images` (h, w, 3) uint8 sRGB as ProRes 422 HQ, 10 bits, tagged as BT.709.

    An odd width loses a column.
    """
    with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mov") as container:
        stream = container.add_stream("prores_ks", rate=Fraction(fps).limit_denominator(1001))
        stream.pix_fmt, stream.options = "yuv422p10le", {"profile": "3", "threads": "1"}
        context = stream.codec_context
        context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
        context.color_trc, context.color_primaries = ColorTrc.BT709, ColorPrimaries.BT709
        started = False
        for image in images:
            image = image[:, : image.shape[1] - image.shape[1] % 2]
            if not started:
                stream.height, stream.width = image.shape[:2]
                started = True
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame = frame.reformat(
                format="yuv422p10le",
                dst_colorspace=Colorspace.ITU709,
                dst_color_range=ColorRange.MPEG,
            )
            container.mux(stream.encode(frame))
        if started:
            container.mux(stream.encode(None))
