"""Video files: exact frames in, H.264 that a browser plays out."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v")


class VideoReader:
    """Reads frame n in presentation order, exactly, also where the frame rate varies.

    The time stamps of all packets are listed once (no decoding); a frame is reached by a seek to
    the key frame before it. Sequential reading decodes each frame once.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        try:
            self._container = av.open(str(self.path))
            self._stream = self._container.streams.video[0]
            stamps = sorted(
                packet.pts
                for packet in self._container.demux(self._stream)
                if packet.pts is not None
            )
        except (OSError, IndexError, av.FFmpegError) as error:
            raise InputError(
                f"an unreadable video ({error})",
                "a video that FFmpeg decodes",
                "Convert it, for example to H.264 in MP4.",
                path=path,
            ) from error
        self._stream.thread_type = "AUTO"
        self._stamps = stamps
        self._decoder = None
        self._next = -1

    @property
    def n_frames(self) -> int:
        return len(self._stamps)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height)."""
        return self._stream.codec_context.width, self._stream.codec_context.height

    @property
    def fps(self) -> float:
        return float(self._stream.average_rate)

    def read(self, frame: int, **place) -> np.ndarray:
        """Frame `frame` as (h, w, 3) uint8, sRGB."""
        if not 0 <= frame < self.n_frames:
            raise InputError(
                f"a video of {self.n_frames} frames",
                f"frame {frame} to exist",
                "Correct `first` and `last` in the take sheet (frames count from 0).",
                path=self.path,
                frame=frame,
                **place,
            )
        # A few frames ahead are decoded rather than sought.
        if self._decoder is None or not self._next <= frame <= self._next + 32:
            self._container.seek(self._stamps[frame], stream=self._stream, backward=True)
            self._decoder = self._container.decode(self._stream)
        try:
            for decoded in self._decoder:
                if decoded.pts is not None and decoded.pts >= self._stamps[frame]:
                    self._next = frame + 1
                    return decoded.to_ndarray(format="rgb24")
        except av.FFmpegError as error:
            self._decoder = None
            raise self._damaged(frame, str(error), place) from error
        self._decoder = None
        raise self._damaged(frame, "the stream ends early", place)

    def _damaged(self, frame: int, what: str, place: dict) -> InputError:
        return InputError(
            f"a frame that cannot be decoded ({what})",
            "a whole video",
            "Export the video again.",
            path=self.path,
            frame=frame,
            **place,
        )


def write_video(path: str | Path, images: Iterable[np.ndarray], fps: float) -> None:
    """Write (h, w, 3) uint8 sRGB images as H.264 in MP4; odd sizes lose one row or column."""
    with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        # One thread and no macroblock tree, so that the same images give the same bytes: x264's
        # macroblock tree reads memory that it never wrote on processors with AVX-512.
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "20", "preset": "veryfast", "threads": "1", "mbtree": "0"}
        started = False
        for image in images:
            height, width = (size - size % 2 for size in image.shape[:2])
            if not started:
                stream.width, stream.height = width, height
                started = True
            frame = av.VideoFrame.from_ndarray(
                np.ascontiguousarray(image[:height, :width]), format="rgb24"
            )
            container.mux(stream.encode(frame))
        if started:
            container.mux(stream.encode(None))
