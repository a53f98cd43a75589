"""Video files that are damaged, or that name other files for FFmpeg to open."""

from __future__ import annotations

from functools import cache

import numpy as np

from tests.faults.case import Case, check, parametrized
from vermilion.capture.manifest import capture_manifest
from vermilion.config.load import check_source
from vermilion.config.takes import Take
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import VideoReader, write_video
from vermilion.storage.errors import InputError


@cache
def clip() -> bytes:
    """A good video of five frames."""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        write_video(path, iter(np.full((5, 32, 48, 3), 90, np.uint8)), 25.0)
        return path.read_bytes()


def content(data, name="clip.mp4"):
    def make(folder, rng):
        path = folder / name
        path.write_bytes(data() if callable(data) else data)
        return path

    return make


def truncated(folder, rng):
    path = folder / "clip.mp4"
    path.write_bytes(clip()[: int(len(clip()) * rng.uniform(0.2, 0.7))])
    return path


def without_index(folder, rng):
    """The pixels are there, the table that says where is overwritten."""
    path = folder / "clip.mp4"
    path.write_bytes(clip().replace(b"moov", b"junk"))
    return path


def playlist(kind: str):
    """Text in the form of a video's name that has FFmpeg open another file."""

    def make(folder, rng):
        (folder / "private.mp4").write_bytes(clip())
        texts = {
            "hls": "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nprivate.mp4\n#EXT-X-ENDLIST\n",
            "concat": "ffconcat version 1.0\nfile private.mp4\n",
        }
        path = folder / "clip.mp4"
        path.write_text(texts[kind])
        return path

    return make


def first_image(path):
    return VideoReader(path).read(0)


def read_take(path):
    """As the workflow does before a run: every problem of the source as a sentence."""
    problems = check_source(Take("s1", "phone", "video", str(path), 0, 9, 25.0, "none"))
    if problems:
        raise InputError("; ".join(problems), "a source with all frames", "Correct the sheet.")
    return problems


UNREADABLE = "unreadable video"
CASES = [
    Case("truncated", truncated, first_image, "unreadable video|cannot be decoded|cut off"),
    Case("without its index", without_index, first_image, UNREADABLE),
    Case("zero bytes", content(b""), first_image, UNREADABLE),
    Case("text", content(b"not a video\n" * 100), first_image, UNREADABLE),
    Case("a playlist of HLS", playlist("hls"), first_image, UNREADABLE),
    Case("a list of files to join", playlist("concat"), first_image, UNREADABLE),
    Case("fewer frames than the sheet says", content(clip), read_take, "5 frames"),
    Case("another container's name", content(clip, "clip.mov"), first_image,
         right=lambda image: image.shape == (32, 48, 3)),
]  # fmt: skip


@parametrized(CASES)
def test_video(case, seed, tmp_path):
    check(case, seed, tmp_path)


def test_images_that_cannot_be_used_are_flagged_and_the_take_goes_on(tmp_path):
    rng = np.random.default_rng(3)
    for frame, size in enumerate([(40, 60), (40, 60), (40, 60), (41, 60)]):
        write_srgb8(tmp_path / f"{frame:06d}.png", rng.integers(0, 255, (*size, 3), dtype=np.uint8))
    (tmp_path / "000001.png").write_bytes(b"")
    manifest = capture_manifest(tmp_path, "s1", "phone", range(5))
    assert manifest.bad["cam"] == {
        1: "empty file",
        3: "size 60x41, expected 60x40",
        4: "missing",
    }
