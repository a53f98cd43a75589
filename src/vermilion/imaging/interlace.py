"""Interlaced video: two moments in the lines of one frame become one image of the first."""

from __future__ import annotations

from typing import cast

import av
import av.filter


def deinterlace(
    before: av.VideoFrame | None, frame: av.VideoFrame, after: av.VideoFrame | None
) -> av.VideoFrame:
    """The progressive image of an interlaced frame at the moment of its first field.

    The lines of the first field are kept, the others interpolated over space and time (FFmpeg's
    `bwdif`). It depends on the two neighbours alone, not on where reading began.

    Args:
        before, after: neighbours in presentation order, None at the ends of the video.
    """
    graph = av.filter.Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format, time_base=frame.time_base
    )
    filtered = graph.add("bwdif", "mode=send_frame:parity=auto:deint=interlaced")
    sink = graph.add("buffersink")
    source.link_to(filtered)
    filtered.link_to(sink)
    graph.configure()
    for neighbour in (before, frame, after):
        if neighbour is not None:
            source.push(neighbour)
    source.push(None)
    images = [sink.pull() for _ in range(1 if before is None else 2)]
    return cast(av.VideoFrame, images[-1])
