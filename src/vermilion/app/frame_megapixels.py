"""How many pixels a frame of a take has, from headers alone: what its jobs ask for grows with them."""

from __future__ import annotations

from pathlib import Path

from vermilion.config.studio import StudioConfig
from vermilion.config.takes import STUDIO, Take
from vermilion.imaging.frames import list_frames
from vermilion.imaging.images import AS_TAGGED, ImageReading, image_size
from vermilion.imaging.source import is_image, is_video
from vermilion.imaging.video import VideoReader
from vermilion.storage.errors import VermilionError
from vermilion.studio.rig import FACE_ANGLES_DEG, LIP_ANGLES_DEG, VIDEO_CAMERAS, camera_names


def frame_megapixels(
    take: Take, studio: StudioConfig, reading: ImageReading = AS_TAGGED
) -> list[float]:
    """Megapixels of one frame, of each camera of the take.

    None where no header can be read, which other checks name; and for meshes of another tracker.
    """
    if take.role == "tracked":
        return []
    if take.source == STUDIO:
        sizes = _studio_sizes(take, studio)
    else:
        try:
            sizes = _sizes(Path(take.source), reading)
        except (VermilionError, OSError):
            return []
    return [width * height / 1e6 for width, height in sizes]


def _studio_sizes(take: Take, studio: StudioConfig) -> list[tuple[int, int]]:
    """(width, height) of each camera of a synthetic take."""
    video = studio.take_of(take.subject, take.take).video_size_px or studio.video_size_px
    of_group = {
        **dict.fromkeys(FACE_ANGLES_DEG, studio.face_size_px),
        **dict.fromkeys(LIP_ANGLES_DEG, studio.lip_size_px),
        **dict.fromkeys(VIDEO_CAMERAS, video),
    }
    return [of_group[name] for name in camera_names(take.role, studio.cameras)]


def _sizes(source: Path, reading: ImageReading) -> list[tuple[int, int]]:
    """(width, height) of each camera of a capture folder, a frame folder, a video or an image."""
    if source.is_file() and not is_image(source):
        return [VideoReader(source).size] if is_video(source) else []
    folders = sorted(p for p in (source / "frames").glob("*") if p.is_dir()) or [source]
    firsts = [next(iter(list_frames(folder).values()), None) for folder in folders]
    return [image_size(path, reading) for path in firsts if path is not None]
