"""The source of a take: a path, alone or with how its image files are to be read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

#: A path, or {"path": ..., "exr_layer": ..., "colour_space": ...}, as parameters of rules carry it.
Source = str | Path | Mapping[str, str]

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v")
IMAGE_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr"),
    *(".dpx", ".bmp", ".tga", ".webp"),
)


def source_path(source: Source) -> Path:
    """The path of a source."""
    return Path(source["path"] if isinstance(source, Mapping) else source)


def is_video(source: Source) -> bool:
    """Whether a source is named as a video file."""
    return source_path(source).suffix.lower() in VIDEO_SUFFIXES


def is_image(source: Source) -> bool:
    """Whether a source is a single image: a take of one frame."""
    path = source_path(source)
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.is_dir()


def is_single_file(source: Source) -> bool:
    """Whether a source is a file, a video or a single image: of one camera, which has no name."""
    return is_video(source) or is_image(source)


def folder_of(source: Source, name: str) -> Path:
    """Folder `name` (`cameras`, `labels`, `calibration`) of a source.

    `<capture>/labels` of a folder, `clip.mp4.labels` beside a file.
    """
    path = source_path(source)
    return path.with_name(f"{path.name}.{name}") if is_single_file(source) else path / name
