"""From a decoded video frame to the sRGB image that a player shows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import numpy as np

from vermilion.imaging.colour import VideoColour, colour_of_frame
from vermilion.imaging.orientation import UPRIGHT, Orientation, orientation_of_matrix
from vermilion.imaging.pixel_aspect import resample, square_size
from vermilion.imaging.tone_mapping import reference_white
from vermilion.storage.errors import RefusedInputError


@dataclass(frozen=True)
class Presentation:
    """What the tags of a video say about its display.

    Attributes:
        orientation: of the display matrix.
        pixel_aspect: width of a pixel over its height, 0 where unknown.
        colour: how code values become sRGB.
        white_nits: white of the clip, for HDR.
        peak_nits: brightest value of the clip, for HDR.
    """

    orientation: Orientation = UPRIGHT
    pixel_aspect: float = 1.0
    colour: VideoColour = VideoColour()  # noqa: RUF009 - frozen
    white_nits: float = 1.0
    peak_nits: float = 1.0

    def size(self, width: int, height: int) -> tuple[int, int]:
        """(width, height) as shown of a stored frame."""
        return self.orientation.size(*square_size(width, height, self.pixel_aspect))

    def image(self, frame: av.VideoFrame) -> np.ndarray:
        """A progressive frame as (h, w, 3) uint8 sRGB: upright, with square pixels."""
        image = self.colour.srgb8(frame, self.white_nits, self.peak_nits)
        stored = square_size(frame.width, frame.height, self.pixel_aspect)
        return self.orientation.apply(resample(image, stored))

    def with_white_of(self, frames: list[av.VideoFrame]) -> Presentation:
        """White and peak of an HDR clip, from some of its frames."""
        light = np.concatenate([self.colour.light(f)[::4, ::4].reshape(-1, 3) for f in frames])
        white, peak = reference_white(light)
        return replace(self, white_nits=white, peak_nits=peak)


def presentation_of(
    frame: av.VideoFrame, pixel_aspect: float, path: str | Path | None = None
) -> Presentation:
    """Display of a video by the tags of its first frame.

    Args:
        pixel_aspect: of container or stream, 0 where unknown.

    Raises:
        RefusedInputError: a tag asks for what is not done here; it names the command that converts.
    """
    try:
        square_size(frame.width, frame.height, pixel_aspect)
        orientation = _orientation(frame)
    except ValueError as error:
        raise RefusedInputError(
            f"a video whose tags ask for {error}",
            "turns by quarters, and pixels up to 4 times as wide as high or the reverse",
            "Bake the tags into the images: `ffmpeg -i in.mp4 -crf 12 out.mp4`, or correct them.",
            path=path,
        ) from error
    return Presentation(orientation, float(pixel_aspect), colour_of_frame(frame, path=path))


def _orientation(frame: av.VideoFrame) -> Orientation:
    data: Any  # the stub lists the keys
    for data in frame.side_data:
        if data.type.name == "DISPLAYMATRIX":
            return orientation_of_matrix(np.frombuffer(bytes(data), dtype="<i4")[:9])
    return UPRIGHT
