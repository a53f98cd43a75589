"""Video files: exact frames in, H.264 that a browser plays out."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path

import av
import av.container
import numpy as np
from av.stream import Disposition
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

from vermilion.imaging.interlace import deinterlace
from vermilion.imaging.presentation import Presentation, presentation_of
from vermilion.storage.errors import InputError, RefusedInputError
from vermilion.storage.files import atomic_path

#: Decoded frames that are kept: an interlaced one needs its neighbours.
_KEPT = 3
#: Containers that hold their frames. Playlists and lists of files, which FFmpeg would follow to other files
#: and hosts whatever the file is called, are not among them.
_CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,flv,asf,ogg,mxf,ivf,nut,dv,"
    "yuv4mpegpipe,h264,hevc,m4v,obu,av1"
)
_OPENING = {"format_whitelist": _CONTAINERS, "protocol_whitelist": "file"}
#: BT.709 among the matrices of H.273.
_TAG_709 = 1


@dataclass(frozen=True)
class VideoIndex:
    """Where the frames of a video lie in time.

    Attributes:
        stamps: time stamp of each frame, in presentation order (units of the stream's time base).
        keys: time stamps of key frames, in order.
    """

    stamps: tuple[int, ...]
    keys: tuple[int, ...]


class VideoReader:
    """Reads frame n in presentation order, exactly, also where the frame rate varies.

    Images are as a player shows them: upright, square pixels, progressive, sRGB. The time stamps of
    all packets are listed once (no decoding), or given; a frame is reached by a seek to the key
    frame before it. Sequential reading decodes each frame once.

    Args:
        index: of this file, where it was listed before.

    Raises:
        InputError: no video that FFmpeg decodes, or one without time stamps.
    """

    def __init__(self, path: str | Path, index: VideoIndex | None = None):
        self.path = Path(path)
        try:
            self._container = av.open(str(self.path), options=_OPENING, metadata_errors="replace")
            self._stream = _main_stream(self._container)
            self.index = index or _list_packets(self._container, self._stream)
        except (OSError, IndexError, av.FFmpegError) as error:
            raise InputError(
                f"an unreadable video ({error})",
                "a video that FFmpeg decodes",
                "Convert it, for example to H.264 in MP4.",
                path=path,
            ) from error
        if not self.index.stamps:
            raise InputError(
                "a video without time stamps",
                "frames that say when they are shown",
                "Copy it again where it was cut off, or convert it: "
                f"`ffmpeg -fflags +genpts -i {self.path.name} -crf 12 converted.mp4`.",
                path=path,
            )
        self._stream.thread_type = "AUTO"
        self._decoder: Iterator[av.VideoFrame] = iter(())
        self._next = -1
        self._kept: dict[int, av.VideoFrame] = {}
        self._presentation: Presentation | None = None
        self.interlaced = False

    @property
    def n_frames(self) -> int:
        return len(self.index.stamps)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the images."""
        context = self._stream.codec_context
        return self._presented(0).size(context.width, context.height)

    @property
    def fps(self) -> float:
        """Frames a second, on average."""
        rate = self._stream.average_rate
        if rate:
            return float(rate)
        times = self.times_s
        return float((len(times) - 1) / times[-1]) if times[-1] > 0 else 0.0

    @property
    def times_s(self) -> np.ndarray:
        """Time of each frame after the first, (n_frames,) seconds."""
        stamps = np.asarray(self.index.stamps, dtype=np.int64)
        return (stamps - stamps[0]) * self.seconds_per_tick

    @property
    def seconds_per_tick(self) -> float:
        """Unit of the time stamps of the index."""
        assert self._stream.time_base is not None  # FFmpeg gives every stream one
        return float(self._stream.time_base)

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
        presentation = self._presented(frame)
        if self.interlaced and frame > 0:  # read in order, so that nothing is decoded twice
            self._neighbour(frame - 1)
        decoded = self._decoded(frame, place)
        self.interlaced = decoded.interlaced_frame
        if decoded.interlaced_frame:
            decoded = deinterlace(self._neighbour(frame - 1), decoded, self._neighbour(frame + 1))
        return presentation.image(decoded)

    def _neighbour(self, frame: int) -> av.VideoFrame | None:
        """A frame beside the one that is read, None where there is none or it is damaged."""
        if not 0 <= frame < self.n_frames:
            return None
        try:
            return self._decoded(frame, {})
        except InputError:
            return None

    def _presented(self, frame: int) -> Presentation:
        """What the tags say: of frame 0, or of another one where that is damaged."""
        if self._presentation is None:
            others = (self._neighbour(n) for n in (0, *self._key_frames()[:4]))
            tagged = next((f for f in others if f is not None), None)
            if tagged is None:
                tagged = self._decoded(frame, {})
            aspect = float(self._stream.sample_aspect_ratio or 0.0)
            presentation = presentation_of(tagged, aspect, self.path)
            if presentation.colour.is_hdr:
                presentation = presentation.with_white_of(self._samples() or [tagged])
            self._presentation = presentation
        return self._presentation

    def _samples(self, count: int = 8) -> list[av.VideoFrame]:
        """Some frames at or soon after key frames; those that are damaged are left out."""
        numbers = self._key_frames()
        if len(numbers) < count:
            near = {number + step for number in numbers for step in range(0, 33, 8)}
            numbers = sorted(number for number in near if number < self.n_frames)
        chosen = np.unique(np.linspace(0, len(numbers) - 1, count).round().astype(int))
        return [f for f in (self._neighbour(numbers[n]) for n in chosen) if f is not None]

    def _key_frames(self) -> list[int]:
        """Numbers of the key frames, 0 where the file names none."""
        return np.searchsorted(self.index.stamps, self.index.keys).tolist() or [0]

    def _decoded(self, frame: int, place: dict) -> av.VideoFrame:
        """The frame as the decoder gives it."""
        if frame in self._kept:
            return self._kept[frame]
        stamp, keys = self.index.stamps[frame], self.index.keys
        before = bisect_left(keys, stamp)
        # Where a key frame is shown after frames that follow it in the file, the seek comes too
        # late: then an earlier one serves.
        starts: list[int | None] = [stamp, keys[max(before - 2, 0)] if keys else stamp]
        # A few frames ahead are decoded rather than sought.
        if self._next <= frame <= self._next + 32:
            starts.insert(0, None)
        try:
            for start in starts:
                if start is not None:
                    self._container.seek(start, stream=self._stream, backward=True)
                    self._decoder = self._container.decode(self._stream)
                decoded = self._decode_until(frame, stamp)
                if decoded is not None:
                    return decoded
            misplaced = any(later.pts == stamp for later in islice(self._decoder, 16))
        except av.FFmpegError as error:
            self._decoder = iter(())
            raise self._damaged(frame, str(error), place) from error
        self._decoder = iter(())
        if misplaced:
            raise self._out_of_order(frame, place)
        raise self._damaged(frame, "the stream has no such frame or ends early", place)

    def _decode_until(self, frame: int, stamp: int) -> av.VideoFrame | None:
        """Decode on to a frame; None where the decoder goes past it or ends."""
        for decoded in self._decoder:
            if decoded.pts is None or decoded.pts < stamp:
                continue
            if decoded.pts > stamp:
                return None
            self._next = frame + 1
            self._kept[frame] = decoded
            while len(self._kept) > _KEPT:
                del self._kept[next(iter(self._kept))]
            return decoded
        return None

    def _damaged(self, frame: int, what: str, place: dict) -> InputError:
        return InputError(
            f"a frame that cannot be decoded ({what})",
            "a whole video",
            "Export the video again.",
            path=self.path,
            frame=frame,
            **place,
        )

    def _out_of_order(self, frame: int, place: dict) -> RefusedInputError:
        return RefusedInputError(
            "time stamps that do not follow the order of display, as AVI has them for B-frames",
            "frames that say when they are shown",
            f"Convert it: `ffmpeg -i {self.path.name} -crf 12 converted.mp4`.",
            path=self.path,
            frame=frame,
            **place,
        )


def _main_stream(container: av.container.InputContainer) -> av.VideoStream:
    """The first stream of moving images; covers are left out."""
    streams = container.streams.video
    moving = [s for s in streams if not s.disposition & Disposition.attached_pic]
    return (moving or streams)[0]


def _list_packets(container: av.container.InputContainer, stream: av.VideoStream) -> VideoIndex:
    """Time stamps of what is shown: packets that an edit list cuts away are left out."""
    stamps, keys = [], []
    for packet in container.demux(stream):
        if packet.pts is None or packet.is_discard:
            continue
        stamps.append(packet.pts)
        if packet.is_keyframe:
            keys.append(packet.pts)
    return VideoIndex(tuple(sorted(stamps)), tuple(sorted(keys)))


def write_video(
    path: str | Path,
    images: Iterable[np.ndarray],
    fps: float,
    most_kbits: float | None = None,
) -> None:
    """Write `images` (h, w, 3) uint8 sRGB as H.264 in MP4, tagged as BT.709.

    Odd sizes lose one row or column. `most_kbits` a second bound the size of the file.
    """
    with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mp4") as container:
        # One thread and no macroblock tree, so that the same images give the same bytes: x264's
        # macroblock tree reads memory that it never wrote on processors with AVX-512.
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "20", "preset": "veryfast", "threads": "1", "mbtree": "0"}
        if most_kbits is not None:
            bound = {"maxrate": f"{most_kbits:.0f}k", "bufsize": f"{2 * most_kbits:.0f}k"}
            stream.options = {**stream.options, **bound, "crf": "23"}
        context = stream.codec_context
        context.colorspace, context.color_range = _TAG_709, ColorRange.MPEG
        context.color_trc, context.color_primaries = ColorTrc.BT709, ColorPrimaries.BT709
        started = False
        for image in images:
            height, width = (size - size % 2 for size in image.shape[:2])
            if not started:
                stream.width, stream.height = width, height
                started = True
            frame = av.VideoFrame.from_ndarray(
                np.ascontiguousarray(image[:height, :width]), format="rgb24"
            ).reformat(
                format="yuv420p",
                dst_colorspace=Colorspace.ITU709,
                dst_color_range=ColorRange.MPEG,
            )
            frame.color_trc, frame.color_primaries = ColorTrc.BT709, ColorPrimaries.BT709
            container.mux(stream.encode(frame))
        if started:
            container.mux(stream.encode(None))
