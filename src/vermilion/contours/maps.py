"""Likelihood maps of the frames of a take: files, quality and overlay."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.contours.detector import ContourDetector
from vermilion.contours.labels import ContourLabel
from vermilion.contours.region import mouth_region, usable
from vermilion.imaging.draw import draw_points, draw_polyline, label, to_display
from vermilion.imaging.frames import FrameSource
from vermilion.imaging.images import read_channels, write_channels
from vermilion.landmarks.scheme import interocular_px
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow

INNER_COLOUR, OUTER_COLOUR = (255, 70, 60), (70, 255, 90)
LABEL_COLOUR = (255, 230, 60)


def write_maps(path: str | Path, inner: np.ndarray, outer: np.ndarray) -> None:
    """Write the maps of a frame, `inner` and `outer` (h, w), as half EXR with channels of those names."""
    write_channels(path, {"inner": inner, "outer": outer})


def read_maps(path: str | Path, **place) -> tuple[np.ndarray, np.ndarray]:
    """(inner, outer) maps (h, w) float32 of a frame. Raises InputError where they are not so."""
    channels = read_channels(path, **place)
    if not {"inner", "outer"} <= channels.keys():
        raise InputError(
            f"channels {sorted(channels)}",
            "`inner` and `outer`",
            "Remove the file and run again.",
            path=path,
            **place,
        )
    return channels["inner"], channels["outer"]


def frame_maps(
    source: FrameSource,
    camera: str,
    frame: int,
    landmarks_px: np.ndarray,
    landmarks_valid: bool,
    detector: ContourDetector,
    least_peak: float,
    lips_px: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[tuple[np.ndarray, np.ndarray] | None, np.ndarray | None, QualityRow]:
    """Maps (h, w) of one frame: ((inner, outer) or None, the image or None, its quality row).

    A frame that cannot be read, or has no face, has no maps and an invalid row. `landmarks_px` (66, 2);
    `lips_px`: rings (n, 2), outer and inner, of the tracked lips, for a detector that starts from them.
    """
    try:
        image = source.read(camera, frame)
    except InputError as error:
        return None, None, QualityRow(frame, False, f"unreadable: {error}")
    reason = usable(landmarks_px, image.shape) if landmarks_valid else "no landmarks"
    if reason:
        return None, image, QualityRow(frame, False, reason)
    inner, outer = detector.likelihood(image, landmarks_px, lips_px)
    figures = {
        "inner_peak": peak(inner),
        "outer_peak": peak(outer),
        "interocular_px": float(interocular_px(landmarks_px)),
    }
    if figures["outer_peak"] < least_peak:
        row = QualityRow(frame, False, "no outer contour found", figures)
    else:
        row = QualityRow(frame, figures=figures)
    return (inner, outer), image, row


def peak(likelihood: np.ndarray) -> float:
    """What the 200 strongest pixels of a map `likelihood` (h, w) exceed: a single speck does not count."""
    values = np.partition(likelihood.ravel(), -200)
    return float(values[-200])


def maps_overlay(
    image: np.ndarray,
    maps: tuple[np.ndarray, np.ndarray],
    landmarks_px: np.ndarray,
    frame: int,
    drawn: ContourLabel | None = None,
    side_px: int = 320,
) -> np.ndarray:
    """The mouth's region beside itself with the maps over it, (side, 2 side, 3) uint8.

    Inner contour red, outer green; contours that a person drew are yellow.

    Args:
        image: (h, w, 3) linear RGB; maps: inner and outer (h, w); landmarks_px: (66, 2).
    """
    region = mouth_region(landmarks_px, side_px / 1.1, 0.16)
    crop = to_display(region.crop(image))
    inner, outer = (np.clip(region.crop(plane), 0, 1)[..., None] for plane in maps)
    mixed = crop * (1 - 0.8 * np.maximum(inner, outer))
    mixed = mixed + 0.8 * (inner * INNER_COLOUR + outer * OUTER_COLOUR)
    mixed = np.clip(mixed, 0, 255).astype(np.uint8)
    crop = draw_points(crop, np.concatenate([region.outer_px, region.inner_px]), (90, 160, 255), 1)
    if drawn is not None:
        for line in (drawn.inner, drawn.outer):
            mixed = draw_polyline(
                mixed, region.to_region(line.points_px), LABEL_COLOUR, line.closed
            )
    return label(np.hstack([crop, mixed]), f"frame {frame}")
