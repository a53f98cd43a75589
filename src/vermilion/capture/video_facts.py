"""What a video file is: its hash, its frames and their times; found once a take."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vermilion.storage.errors import InputError
from vermilion.storage.files import sha256_of, write_text
from vermilion.storage.json_files import load_json

if TYPE_CHECKING:
    from vermilion.imaging.video import VideoIndex, VideoReader

FORMAT_VERSION = 1
#: Part of the median interval by which intervals of an even video may differ (rounded time stamps).
_EVEN = 0.1
#: Part by which the sheet's rate may differ from the file's (25 for 24.975, not 30 for 29).
_SAME_RATE = 0.01


@dataclass(frozen=True)
class VideoFacts:
    """A video file.

    Attributes:
        file: its name.
        size_bytes, sha256: of the file.
        fps: frames a second, on average.
        seconds_per_tick: of the time stamps.
        stamps, keys: see `VideoIndex`.
        interlaced: whether two moments stand in the lines of a frame.
    """

    file: str
    size_bytes: int
    sha256: str
    fps: float
    seconds_per_tick: float
    stamps: tuple[int, ...]
    keys: tuple[int, ...]
    interlaced: bool = False

    @property
    def index(self) -> VideoIndex:
        from vermilion.imaging.video import VideoIndex

        return VideoIndex(self.stamps, self.keys)

    @property
    def times_s(self) -> np.ndarray:
        """Time of each frame after the first, (F,) seconds."""
        stamps = np.asarray(self.stamps, dtype=np.int64)
        return (stamps - stamps[0]) * self.seconds_per_tick

    def summary(self) -> dict:
        """What the manifests of the take say of the file."""
        return {
            "file": self.file,
            "size_bytes": self.size_bytes,
            "sha256": self.sha256,
            "frames": len(self.stamps),
            "fps": self.fps,
            "even": _is_even(self.times_s),
            "interlaced": self.interlaced,
        }

    def save(self, path: str | Path) -> None:
        """Write as JSON, whole or not at all."""
        content = {"format_version": FORMAT_VERSION, **asdict(self)}
        write_text(path, json.dumps(content, sort_keys=True) + "\n")


def video_facts(path: str | Path) -> VideoFacts:
    """Read a video file once: hash it and list its frames."""
    from vermilion.imaging.video import VideoReader

    path = Path(path)
    reader = VideoReader(path)
    return VideoFacts(
        path.name,
        path.stat().st_size,
        sha256_of(path),
        reader.fps,
        reader.seconds_per_tick,
        reader.index.stamps,
        reader.index.keys,
        _is_interlaced(reader),
    )


def load_video_facts(path: str | Path) -> VideoFacts:
    """Read what `VideoFacts.save` wrote. Raises InputError on another or damaged file."""
    try:
        content = load_json(path)
        version = content.pop("format_version")
        if version != FORMAT_VERSION:
            raise ValueError(f"format {version}")
        for name in ("stamps", "keys"):
            content[name] = tuple(int(stamp) for stamp in content[name])
        return VideoFacts(**content)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"unreadable facts of a video ({error})",
            f"a file of format {FORMAT_VERSION}",
            "Remove the file and run again.",
            path=path,
        ) from error


def uneven_times(path: str | Path | None, frames: np.ndarray) -> np.ndarray | None:
    """Times (F,) in seconds of `frames` (F,) of a video whose rate varies.

    None where there are no facts of a video at `path`, or its frames are evenly spaced: then the take sheet's
    rate holds.
    """
    if not path:
        return None
    times = load_video_facts(path).times_s
    return None if _is_even(times) else times[np.asarray(frames, dtype=np.int64)]


def field_warning(facts: VideoFacts) -> str:
    """What becomes of interlaced frames; empty where there are none."""
    if not facts.interlaced:
        return ""
    return (
        "interlaced, two moments in the lines of each frame: a frame becomes the image of its first field, which has "
        "half the lines, so that small lips are less exact; where both moments are wanted, convert with "
        f"`ffmpeg -i {facts.file} -vf bwdif=mode=send_field -crf 12 progressive.mp4` and set twice the rate"
    )


def rate_warning(facts: VideoFacts, sheet_fps: float) -> str:
    """What differs between the file's rate and the take sheet's; empty where nothing does."""
    steps, sheet = np.diff(facts.times_s), f"the take sheet says {sheet_fps:g}"
    if not len(steps):
        return ""
    if not _is_even(facts.times_s):
        return (
            f"frames are {steps.min():.3f} to {steps.max():.3f} s apart ({facts.fps:.4g} a second on "
            f"average), {sheet}: the track is smoothed over these times, but exports and overlays show the "
            f"frames at the sheet's rate; convert with `ffmpeg -i {facts.file} -vf fps={sheet_fps:g} -crf 12 "
            "even.mp4` where their timing matters"
        )
    if abs(facts.fps - sheet_fps) > _SAME_RATE * sheet_fps:
        return f"the file has {facts.fps:.4g} frames a second, {sheet}: correct `fps`"
    return ""


def _is_interlaced(reader: VideoReader) -> bool:
    """Of the first frame that can be read among some; a take that has none is refused where it is read."""
    for frame in range(0, reader.n_frames, max(reader.n_frames // 4, 1)):
        try:
            reader.read(frame)
        except InputError:
            continue
        return reader.interlaced
    return False


def _is_even(times_s: np.ndarray) -> bool:
    steps = np.diff(times_s)
    return not len(steps) or float(np.ptp(steps)) <= _EVEN * float(np.median(steps))
