"""First and last frame of a source on disk, for rows of the take sheet that leave them empty."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vermilion.geometry.mesh_files import MESH_SUFFIXES
from vermilion.imaging.frames import list_frames
from vermilion.imaging.numbering import numbered_files
from vermilion.imaging.source import is_image, is_video
from vermilion.storage.arrays import read_arrays
from vermilion.storage.errors import InputError


def frame_range(source: str | Path, role: str) -> tuple[int, int]:
    """First and last frame that every camera of a source has.

    Raises:
        InputError: the source does not tell, or is not there.
    """
    source = Path(source)
    if not source.exists():
        raise InputError(
            "no such file or folder",
            "a source that tells its frames",
            "Correct the `source`, or give `first` and `last`.",
            path=source,
        )
    if role == "tracked":
        return _mesh_range(source)
    if source.is_file() and not is_image(source):
        if not is_video(source):
            raise _silent(source)
        from vermilion.imaging.video import VideoReader

        return 0, VideoReader(source).n_frames - 1
    cameras = sorted(p for p in (source / "frames").glob("*") if p.is_dir()) or [source]
    frames = [list_frames(camera) for camera in cameras]
    if not all(frames):
        raise _silent(source)
    first, last = max(min(present) for present in frames), min(max(present) for present in frames)
    if first > last:
        raise InputError(
            "cameras without a frame in common",
            "frames that all cameras have",
            "Export them with the numbers of one clock, or give `first` and `last`.",
            path=source,
        )
    return first, last


def _mesh_range(source: Path) -> tuple[int, int]:
    """Frames of a folder of meshes or of an `.npz`."""
    if source.is_dir():
        numbers: Sequence[int] = list(numbered_files(source, MESH_SUFFIXES))
    elif source.suffix.lower() == ".npz":
        data = read_arrays(source, "mesh sequence", remedy="Export it again.")
        named = data.get("frames", np.arange(len(np.atleast_1d(data["vertices_mm"]))))
        if named.ndim != 1 or named.dtype.kind not in "iuf" or not np.isfinite(named).all():
            raise _silent(source)
        numbers = named.tolist()
    else:
        raise _silent(source)
    if not len(numbers):
        raise _silent(source)
    return int(min(numbers)), int(max(numbers))


def _silent(source: Path) -> InputError:
    return InputError(
        "a source that does not tell its frames",
        "numbered images or meshes, or a video",
        "Give `first` and `last`, or correct the `source`.",
        path=source,
    )
