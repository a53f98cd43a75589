"""The configuration and the take sheet of one video, written so that one can go on with the full tool."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from math import ceil
from pathlib import Path

import yaml

from vermilion.config.frame_range import frame_range
from vermilion.imaging.frames import list_frames
from vermilion.imaging.images import image_size
from vermilion.imaging.source import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_single_file, is_video
from vermilion.imaging.video import VideoReader
from vermilion.storage.errors import InputError
from vermilion.storage.files import write_text

SUBJECT = "face"
#: Frames of a job: fewer keep all cores busy, but a job needs about two seconds to start.
LEAST_CHUNK, MOST_CHUNK = 50, 300
#: Rate of images, which do not tell one.
IMAGES_FPS = 25.0
#: Two dots over a letter, as a character of its own.
_DIAERESIS = "\u0308"


@dataclass(frozen=True)
class LipShot:
    """What a user asks for.

    Attributes:
        video: a video file, a single image, or a folder of numbered images.
        results: folder of all results.
        face_model: lines of the section `face_model`, as a mapping.
        model: file of a trained regressor; None: contours alone.
        scan: a scan of the person; None where there is none.
        first, last: frames; None: from the first, to the last one.
        eye_distance_mm: measured distance of the person's pupils; None: nobody measured it.
    """

    video: Path
    results: str
    face_model: dict[str, str]
    model: Path | None = None
    scan: Path | None = None
    first: int | None = None
    last: int | None = None
    eye_distance_mm: float | None = None

    @property
    def take(self) -> str:
        """Name of the take: the file's, in the letters that a take may have."""
        return take_name(self.video.stem if self.video.is_file() else self.video.name)

    @property
    def configuration(self) -> Path:
        """The file that is written: `config.yaml` in the results."""
        return Path(self.results) / "config.yaml"


def take_name(text: str) -> str:
    """A name in letters, digits, `_` and `.`: umlauts are spelt out, accents go, the rest is `_`.

    A name of other alphabets alone becomes `clip`.
    """
    plain = unicodedata.normalize("NFKD", text.casefold()).replace(_DIAERESIS, "e")
    plain = plain.encode("ascii", "ignore").decode()
    plain = re.sub(r"[^a-z0-9]+", "_", plain).strip("_")
    return plain or "clip"


def write_shot(shot: LipShot, cores: int = 1) -> tuple[int, int]:
    """Write `config.yaml` and `takes.tsv`; files that are the same already stay as they are.

    A `config.yaml` that somebody changed is kept beside, as `config.yaml.before`.

    Args:
        cores: jobs that run side by side.

    Returns:
        (number of frames, frames of a job).

    Raises:
        InputError: the source is no video, image or folder of images, or has no frames.
    """
    first, last = frames_of_shot(shot)
    fps = VideoReader(shot.video).fps if is_video(shot.video) else IMAGES_FPS
    if "\t" in str(shot.video) or "\n" in str(shot.video):
        raise InputError("a tab in the path", "a path without tabs", "Rename it.", path=shot.video)
    sheet = Path(shot.results) / "takes.tsv"
    columns = ["subject", "take", "role", "source", "first", "last", "fps", "split"]
    row = [
        SUBJECT,
        shot.take,
        "video",
        str(shot.video),
        str(first),
        str(last),
        f"{fps:.6g}",
        "none",
    ]
    if shot.eye_distance_mm is not None:
        columns, row = [*columns, "eye_distance_mm"], [*row, f"{shot.eye_distance_mm:g}"]
    _write_changed(sheet, "\t".join(columns) + "\n" + "\t".join(row) + "\n")
    n_frames = last - first + 1
    chunk = min(max(ceil(n_frames / cores), LEAST_CHUNK), MOST_CHUNK)
    _write_changed(shot.configuration, _configuration(shot, sheet, chunk))
    return n_frames, chunk


def frames_of_shot(shot: LipShot) -> tuple[int, int]:
    """First and last frame that the user asks for.

    Raises:
        InputError: the source is no video, image or folder of images that can be read, or has not these frames.
    """
    if shot.video.is_file() and not is_single_file(shot.video):
        raise InputError(
            "a file that is no video and no image",
            f"a video ({', '.join(VIDEO_SUFFIXES)}), an image ({', '.join(sorted(IMAGE_SUFFIXES))}) or a folder of "
            "numbered images",
            "Correct VIDEO, or convert it, for example to H.264 in MP4 or to JPEG.",
            path=shot.video,
        )
    if shot.video.is_file() and not is_video(shot.video):
        image_size(shot.video)  # one that cannot be read stops here
    is_capture = (shot.video / "frames").is_dir()
    if shot.video.is_dir() and not is_capture and not list_frames(shot.video):
        raise InputError(
            "a folder without numbered images that can be read",
            f"a video or files such as 000001.png ({', '.join(sorted(IMAGE_SUFFIXES))})",
            "Correct VIDEO.",
            path=shot.video,
        )
    first, last = frame_range(shot.video, "video")
    asked_first = first if shot.first is None else shot.first
    asked_last = last if shot.last is None else shot.last
    if not first <= asked_first <= asked_last <= last:
        raise InputError(
            f"frames {first} to {last}",
            f"frames {asked_first} to {asked_last}",
            "Correct FIRST and LAST.",
            path=shot.video,
        )
    return asked_first, asked_last


def _write_changed(path: Path, text: str) -> None:
    if path.is_file():
        before = path.read_text(encoding="utf-8")
        if before == text:
            return
        if path.suffix == ".yaml":
            write_text(Path(f"{path}.before"), before)
    write_text(path, text)


def _configuration(shot: LipShot, sheet: Path, chunk: int) -> str:
    """The text of the configuration, with a comment at each key."""
    apply = "regressor: none"
    if shot.model is not None:
        apply = f"model: {_scalar(shot.model)}"
    person = ""
    if shot.scan is not None:
        person = f"""
  # The person's scan, from which their face model is made (docs/scan.md).
  scans:
    {SUBJECT}: {{path: {_scalar(shot.scan)}}}"""
    face = "\n".join(f"  {key}: {_scalar(value)}" for key, value in shot.face_model.items())
    return f"""\
# Written by `vermilion lips`. Change what you like (docs/configuration.md has all keys), then go on with
#     make run CONFIG={shot.configuration}
# Only what depends on the change runs again.
results: {_scalar(shot.results)}
takes: {_scalar(sheet)}
# Frames of a job; it changes no result.
chunk_frames: {chunk}

face_model:
{face}

landmarks:
  # 478 landmarks of a network that is trained on real faces.
  detector: mediapipe

tracking:{person}
  image_fit:
    # One clip has one light: fewer frames than for a whole study tell it.
    appearance: {{frames: 10, rounds: 3}}

correction:
  # Contours that start from these landmarks are good: the lips follow them closely.
  image: {{contour_weight: 10.0}}

apply:
  # `regressor: none` lets the lips follow the contours in the image; `model: FILE.h5` names a trained
  # regressor, which corrects them before.
  {apply}
"""


def _scalar(value: object) -> str:
    """A value as YAML writes it on one line."""
    return yaml.safe_dump(str(value), allow_unicode=True, width=10_000).partition("\n")[0]
