"""What all labels that a person drew on an image share: JSON, pixels, the image that they are of."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from vermilion.storage.errors import InputError
from vermilion.storage.json_files import load_json

#: How far outside of its image a contour may be drawn (of the image's longer side).
_OUTSIDE = 0.01
#: Part of a face's landmarks that lies in the image, where the image cuts the face.
_LEAST_INSIDE = 0.5


def load_label(path: Path) -> dict[str, Any]:
    """The content of `labels/<kind>/<camera>/<frame>.json`.

    Raises:
        OSError: the file cannot be read.
        ValueError: no JSON object, a unit other than pixels, or an `image` of another camera or frame than
            the file is named after.
    """
    content = load_json(path)
    if not isinstance(content, dict):
        raise ValueError(f"a {type(content).__name__}, not an object")
    if content.get("unit", "px") != "px":
        raise ValueError(f"the unit {content['unit']!r:.20}")
    _check_image(content.get("image"), path)
    return content


def points_of(values: object) -> np.ndarray:
    """Points (n, 2) px of a list of pairs of numbers.

    Raises:
        ValueError: it is none, or a number is not finite.
    """
    if not isinstance(values, list):
        raise ValueError(f"points that are a {type(values).__name__}, not a list")
    numbers = [number for pair in values for number in (pair if isinstance(pair, list) else [None])]
    if not all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers):
        raise ValueError("a point that is no pair of numbers")
    points = np.array(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points of shape {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError("a point that is not finite")
    return points


def check_in_image(
    points_px: np.ndarray,
    size_px: tuple[int, int],
    whole: bool,
    path: str | Path | None,
    **place: Any,
) -> None:
    """Raise InputError where points (n, 2) do not lie in an image of `size_px` (width, height).

    `whole`: all of them have to; else half of them, as an image may cut a face.
    """
    reach = _OUTSIDE * max(size_px)
    inside = ((points_px >= -reach) & (points_px <= np.array(size_px) + reach)).all(axis=1)
    if inside.mean() >= (1.0 if whole else _LEAST_INSIDE):
        return
    x, y = points_px[~inside][0]
    raise InputError(
        f"{(~inside).sum()} of {len(points_px)} points outside of the image, one at ({x:.6g}, {y:.6g})",
        f"pixels of an image of {size_px[0]} x {size_px[1]}",
        "Draw on this image, at this size, or scale the points.",
        path=path,
        **place,
    )


def _check_image(image: object, path: Path) -> None:
    if image is None:
        return
    if not isinstance(image, str):
        raise ValueError(f"an image that is a {type(image).__name__}, not a name")
    named = PurePosixPath(image.replace("\\", "/"))
    number = re.search(r"[0-9]+$", named.stem)
    if number and path.stem.isdigit() and int(number.group()) != int(path.stem):
        raise ValueError(
            f"drawn on the image '{image:.80}', and the file is named after frame {path.stem}"
        )
    if (
        named.parts[:1] == ("frames",)
        and len(named.parts) == 3
        and named.parts[1] != path.parent.name
    ):
        raise ValueError(
            f"drawn on the image '{image:.80}', and its folder is of camera {path.parent.name}"
        )
