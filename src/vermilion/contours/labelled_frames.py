"""The frames of a take that a person drew contours on, and whether these lie on the border seen there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from vermilion.contours.curves import outward_normals
from vermilion.contours.labels import (
    ContourLabel,
    check_contour_label,
    label_paths,
    read_contour_label,
)
from vermilion.contours.ridges import blurred_colours
from vermilion.contours.track_ridge import TrackRidgeDetector
from vermilion.imaging.frames import FrameSource
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import interocular_px
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow

#: Labels that lie farther than this from the border of the lips' colour, on the median, are warned of
#: (per inter-ocular distance). Exact ones lie within 0.006.
FAR = 0.007


@dataclass(frozen=True)
class LabelledFrame:
    """An image (h, w, 3) linear RGB, its landmarks (66, 2), the contours drawn on it, its number."""

    linear_rgb: np.ndarray
    landmarks_px: np.ndarray
    label: ContourLabel
    number: int


def read_labelled(
    capture: str | Path,
    camera: str,
    source: FrameSource,
    landmarks: LandmarkTrack,
    required: bool,
    **place,
) -> tuple[list[LabelledFrame], list[QualityRow]]:
    """The labelled frames of a take's monocular camera that serve, and why others of the take do not.

    Args:
        capture: the capture folder, with `labels/contours/<camera>/`.
        camera: whose labels count.
        source: the images (inpainted, where the lips wear a tattoo).
        landmarks: of the whole take.
        required: whether there must be some.
        place: subject and take, for messages.

    Raises:
        InputError: a label is damaged, or none serves and some are required.
    """
    labelled, left_out = [], []
    for frame, path in label_paths(capture, camera).items():
        index = np.flatnonzero(landmarks.frames == frame)
        if len(index) == 0:  # of another take of the capture
            continue
        if not landmarks.valid[index[0]]:
            left_out.append(QualityRow(frame, reason="label left out: no landmarks"))
            continue
        drawn = read_contour_label(path, camera=camera, frame=frame, **place)
        try:
            image = source.read(camera, frame)
        except InputError as error:
            left_out.append(QualityRow(frame, reason=f"label left out: unreadable: {error}"))
            continue
        check_contour_label(drawn, image.shape[1::-1], path, camera=camera, frame=frame, **place)
        points = landmarks.points_px[index[0]]
        labelled.append(LabelledFrame(image, points, drawn, frame))
    if required and not labelled:
        raise InputError(
            "no usable contour labels",
            f"some frames of camera {camera} in labels/contours/{camera}/",
            "Label a few frames, or set contours.detector.kind to auto or landmarks.",
            path=capture,
            camera=camera,
            **place,
        )
    return labelled, left_out


def outer_offset(
    frame: LabelledFrame, detector: TrackRidgeDetector, lips_px: tuple[np.ndarray, np.ndarray]
) -> float:
    """How far a drawn outer contour lies outside the border of the lips' colour, on the mean.

    Args:
        frame: the image with what was drawn on it.
        detector: the take's.
        lips_px: outer and inner ring (n, 2) px of the tracked lips.

    Returns:
        the distance per inter-ocular distance; negative inside.
    """
    region = detector.region(frame.landmarks_px, lips_px)
    border, _ = detector.outer_border(blurred_colours(region.crop(frame.linear_rgb)), region)
    border = region.to_image(border)
    drawn = frame.label.outer.dense()
    away = drawn[cKDTree(drawn).query(border)[1]] - border
    outwards = (away * outward_normals(border)).sum(axis=1)
    return float(outwards.mean() / interocular_px(frame.landmarks_px))


def offset_rows(
    frames: Sequence[LabelledFrame],
    detector: TrackRidgeDetector,
    lips_px: Callable[[int], tuple[np.ndarray, np.ndarray] | None],
) -> list[QualityRow]:
    """`outer_offset` of each labelled frame of a take, with a warning where the median is over `FAR`.

    Args:
        frames: of one take.
        detector: the take's; it depends on no label.
        lips_px: frame number -> rings (n, 2) px of its tracked lips; None where it is not tracked.
    """
    rings = [lips_px(frame.number) for frame in frames]
    offsets = [
        np.nan if ring is None else outer_offset(frame, detector, ring)
        for frame, ring in zip(frames, rings, strict=True)
    ]
    middle = float(np.nanmedian(offsets)) if np.isfinite(offsets).any() else 0.0
    side = "outside" if middle > 0 else "inside"
    reason = (
        f"labels lie {abs(middle):.4f} inter-ocular distances {side} the border of the lips' colour: "
        "check them"
        if abs(middle) > FAR
        else ""
    )
    return [
        QualityRow(frame.number, reason=reason, figures={"outer_offset": offset})
        for frame, offset in zip(frames, offsets, strict=True)
    ]
