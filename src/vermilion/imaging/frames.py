"""One way to read a take's images, wherever they lie: capture folder, frame folder, video or one image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from vermilion.imaging.images import (
    AS_TAGGED,
    ImageReading,
    image_size,
    read_image,
    srgb_to_linear,
)
from vermilion.imaging.numbering import numbered_files
from vermilion.imaging.source import (
    IMAGE_SUFFIXES,
    VIDEO_SUFFIXES,
    Source,
    is_image,
    is_video,
    source_path,
)
from vermilion.storage.errors import InputError


class FrameSource(Protocol):
    """The images of a take."""

    def read(self, camera: str, frame: int) -> np.ndarray:
        """Linear RGB, (h, w, 3) float32. Raises InputError naming the place."""

    def size(self, camera: str) -> tuple[int, int]:
        """(width, height) of a camera's images."""


class FolderFrames:
    """`<folder>/<frame>.<suffix>`, in one folder or several chunks, or one image; the camera is ignored."""

    def __init__(
        self,
        folders: Sequence[str | Path],
        subject: str = "",
        take: str = "",
        reading: ImageReading = AS_TAGGED,
    ):
        self.subject, self.take, self.reading = subject, take, reading
        self._paths: dict[int, Path] = {}
        self.folders = [Path(folder) for folder in folders]
        for folder in self.folders:
            self._paths.update(list_frames(folder))

    def read(self, camera: str, frame: int) -> np.ndarray:
        """Linear RGB (h, w, 3) float32; see `FrameSource`."""
        place = {"subject": self.subject, "take": self.take, "camera": camera, "frame": frame}
        if frame not in self._paths:
            raise InputError(
                "no image of this frame",
                f"a file such as {frame:06d}.png",
                "Check the frame range of the take sheet, or export the frame.",
                path=self.folders[0],
                **place,
            )
        return read_image(self._paths[frame], self.reading, **place)

    def size(self, camera: str) -> tuple[int, int]:
        if not self._paths:
            raise InputError(
                "no images", "numbered images", "Check the folder.", path=self.folders[0]
            )
        return image_size(self._paths[min(self._paths)], self.reading, camera=camera)


class CaptureFrames:
    """`<capture>/frames/<camera>/<frame>.<suffix>`."""

    def __init__(
        self,
        capture: str | Path,
        subject: str = "",
        take: str = "",
        reading: ImageReading = AS_TAGGED,
    ):
        self.capture, self.subject, self.take = Path(capture), subject, take
        self.reading = reading
        self._cameras: dict[str, FolderFrames] = {}

    def _camera(self, camera: str) -> FolderFrames:
        if camera not in self._cameras:
            folder = self.capture / "frames" / camera
            if not folder.is_dir():
                raise InputError(
                    "no such folder",
                    "a folder of frames a camera",
                    "Add the camera's frames or remove it from the rig.",
                    subject=self.subject,
                    take=self.take,
                    camera=camera,
                    path=folder,
                )
            self._cameras[camera] = FolderFrames([folder], self.subject, self.take, self.reading)
        return self._cameras[camera]

    def read(self, camera: str, frame: int) -> np.ndarray:
        """Linear RGB (h, w, 3) float32; see `FrameSource`."""
        return self._camera(camera).read(camera, frame)

    def size(self, camera: str) -> tuple[int, int]:
        return self._camera(camera).size(camera)


#: Linear value of each byte: a look-up costs a fifth of the curve.
_LINEAR = srgb_to_linear(np.arange(256, dtype=np.float32) / 255.0)


class VideoFrames:
    """A video file: one camera, frames counted from 0 in presentation order."""

    def __init__(self, path: str | Path, subject: str = "", take: str = ""):
        from vermilion.imaging.video import VideoReader  # FFmpeg: slow to load

        self.subject, self.take = subject, take
        self._reader = VideoReader(path)

    def read(self, camera: str, frame: int) -> np.ndarray:
        """Linear RGB (h, w, 3) float32; see `FrameSource`."""
        pixels = self._reader.read(frame, subject=self.subject, take=self.take, camera=camera)
        return _LINEAR[pixels]

    def size(self, camera: str) -> tuple[int, int]:
        return self._reader.size


def open_frames(
    source: Source | Sequence[str | Path], subject: str = "", take: str = ""
) -> FrameSource:
    """Open a capture folder, a folder (or several) of numbered frames, a video file, or a single image.

    A mapping (see `imaging.source`) also says how image files are read.
    """
    if not isinstance(source, str | Path | Mapping):
        return FolderFrames(source, subject, take)
    path, reading = source_path(source), reading_of(source)
    if is_video(path):
        return VideoFrames(path, subject, take)
    if (path / "frames").is_dir():
        return CaptureFrames(path, subject, take, reading)
    if path.is_dir() or (is_image(path) and path.exists()):
        return FolderFrames([path], subject, take, reading)
    raise InputError(
        "neither a folder nor a video or image",
        f"a capture folder, a folder of frames, or one of {', '.join(VIDEO_SUFFIXES + IMAGE_SUFFIXES)}",
        "Correct the `source` of the take sheet.",
        subject=subject,
        take=take,
        path=path,
    )


def read_or_none(source: FrameSource, camera: str, frame: int) -> np.ndarray | None:
    """Linear RGB (h, w, 3) of a frame, None where it cannot be read."""
    try:
        return source.read(camera, frame)
    except InputError:
        return None


def reading_of(source: Source) -> ImageReading:
    """How the image files of a source are read."""
    if not isinstance(source, Mapping):
        return AS_TAGGED
    return ImageReading(source.get("exr_layer", ""), source.get("colour_space", ""))


def list_frames(folder: str | Path) -> dict[int, Path]:
    """Frame number -> file of a folder of numbered images, in order of number; a single image is frame 0.

    Raises InputError where the folder holds two sequences, or two files of one number.
    """
    path = Path(folder)
    if is_image(path):
        return {0: path} if path.exists() else {}
    return numbered_files(path, IMAGE_SUFFIXES)
