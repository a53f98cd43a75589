"""A sketch: what a person draws on one image, and its file.

`labels/sketches/<camera>/<frame:06d>.json`:

    {"format": "vermilion sketch", "version": 1, "unit": "px", "camera": "face2", "frame": 120,
     "image_size_px": [512, 640],
     "curves": {"upper_inner": {"kind": "sure", "points": [[210.5, 331.0], ...]},
                "lower_inner": {"kind": "near", "points": [...], "handles": [...]}}}

Pixels as everywhere: the centre of the top-left pixel is (0.5, 0.5). Curves run along the mouth in
either direction and are open. Handles are what the page drags; a refinement reads the points alone.
"""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.guided.curves import first_self_crossing
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path
from vermilion.storage.json_files import load_json

FORMAT, VERSION = "vermilion sketch", 1
#: Curves a sketch may have. The inner ones are what hides the mouth, the outer ones the border of
#: the red.
CURVE_NAMES = ("upper_inner", "lower_inner", "upper_outer", "lower_outer")
#: "sure": the contour runs here. "near": it runs about here.
KINDS = ("sure", "near")
#: More points than a hand draws; a page that sends more is broken.
MOST_POINTS = 2000
#: How far outside the image a stroke may end (px).
OUTSIDE_PX = 1.0
#: JSON knows whole numbers of any length; no frame, size or pixel is so large.
_MOST = 10**9
_REMEDY = "Correct the sketch, or draw it again."


@dataclass(frozen=True)
class SketchCurve:
    """One open curve.

    Attributes:
        points_px: (n, 2) image pixels, n >= 2.
        kind: "sure" or "near".
        handles_px: (k, 2) points by which the page bends the curve; None: it was not drawn there.
    """

    points_px: np.ndarray
    kind: str = "sure"
    handles_px: np.ndarray | None = None


@dataclass(frozen=True)
class Sketch:
    """The curves that a person drew on one image of one frame.

    Attributes:
        camera: name of the camera.
        frame: number of the frame.
        image_size_px: (width, height).
        curves: by name, of `CURVE_NAMES`.
    """

    camera: str
    frame: int
    image_size_px: tuple[int, int]
    curves: dict[str, SketchCurve]


def sketch_path(labels: str | Path, camera: str, frame: int) -> Path:
    """Where a sketch lies under a folder `labels`."""
    return Path(labels) / "sketches" / camera / f"{frame:06d}.json"


def write_sketch(path: str | Path, sketch: Sketch) -> None:
    """Check a sketch and write it, whole or not at all. Raises InputError as `read_sketch`."""
    content = {
        "format": FORMAT,
        "version": VERSION,
        "unit": "px",
        "camera": sketch.camera,
        "frame": sketch.frame,
        "image_size_px": list(sketch.image_size_px),
        "curves": {name: _curve_json(curve) for name, curve in sketch.curves.items()},
    }
    sketch_of_json(content, path)
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")


def read_sketch(path: str | Path) -> Sketch:
    """Read and check a sketch.

    Raises:
        InputError: the file cannot be read or is no sketch; the message says which curve and point.
    """
    try:
        content = load_json(path)
    except (OSError, ValueError) as error:
        raise InputError(
            f"a file that is not JSON ({error})",
            "a sketch as docs/guided.md describes it",
            "Draw the sketch again, or remove the file.",
            path=path,
        ) from error
    return sketch_of_json(content, path)


def sketch_of_json(content: object, path: str | Path | None = None) -> Sketch:
    """Check parsed JSON, from a file or a request, and make it a sketch.

    Raises:
        InputError: a sentence about the first thing that is wrong.
    """
    content = _object(content, "", path)
    _need(
        content["format"] == FORMAT, f"the format {content.get('format')!r}",
        f'"{FORMAT}"', path,
    )  # fmt: skip
    version = content["version"]
    _need(_is_whole(version) and version >= 1, f"the version {version!r}", "a number", path)
    if version > VERSION:
        raise InputError(
            f"a sketch of version {version}",
            f"version {VERSION} or older",
            "Update Vermilion, or save the sketch again with this version.",
            path=path,
        )
    unit = content["unit"]
    _need(unit == "px", f"the unit {unit!r}", '"px"', path)
    camera, frame, size = (content[k] for k in ("camera", "frame", "image_size_px"))
    _need(isinstance(camera, str) and camera, f"the camera {camera!r}", "a name", path)
    _need(_is_whole(frame) and frame >= 0, f"the frame {frame!r}", "a number from 0 on", path)
    good_size = isinstance(size, list) and len(size) == 2 and all(map(_is_whole, size))
    _need(good_size and min(size) > 0, f"the image size {size!r}", "[width, height]", path)
    curves = content["curves"]
    _need(isinstance(curves, dict) and curves, f"the curves {curves!r:.40}", "one or more", path)
    return Sketch(
        camera, frame, tuple(size),
        {name: _curve(name, curve, size, path) for name, curve in curves.items()},
    )  # fmt: skip


def _curve_json(curve: SketchCurve) -> dict[str, Any]:
    content = {"kind": curve.kind, "points": np.round(curve.points_px, 3).tolist()}
    if curve.handles_px is not None:
        content["handles"] = np.round(curve.handles_px, 3).tolist()
    return content


def _curve(name: str, curve: object, size: list[int], path: str | Path | None) -> SketchCurve:
    _need(name in CURVE_NAMES, f"a curve named {name!r}", f"one of {', '.join(CURVE_NAMES)}", path)
    what = f"the curve {name}"
    curve = _object(curve, f"{what}, which is ", path)
    kind, handles = curve["kind"], curve["handles"]
    _need(kind in KINDS, f"{what} of the kind {kind!r}", f"one of {', '.join(KINDS)}", path)
    values = _pixels(what, "point", curve["points"], size, path)
    _need(
        np.ptp(values, axis=0).max() > 0, f"{what}, whose points are all the same",
        "a curve with a length", path,
    )  # fmt: skip
    crossing = first_self_crossing(values)
    if crossing is not None:
        _need(False, f"{what}, which crosses itself between the points {crossing[0]} and "
              f"{crossing[1]}", "a curve that does not", path)  # fmt: skip
    return SketchCurve(
        values, kind, None if handles is None else _pixels(what, "handle", handles, size, path)
    )


def _pixels(
    what: str, part: str, points: object, size: list[int], path: str | Path | None
) -> np.ndarray:
    """The points or handles (n, 2) of a curve, checked one by one."""
    _need(isinstance(points, list), f"{what} with {_kind_of(points)} as {part}s", "a list", path)
    assert isinstance(points, list)
    _need(len(points) >= 2, f"{what} with {len(points)} {part}(s)", f"two {part}s or more", path)
    _need(
        len(points) <= MOST_POINTS, f"{what} with {len(points)} {part}s",
        f"at most {MOST_POINTS}", path,
    )  # fmt: skip
    for index, point in enumerate(points):
        good = isinstance(point, list) and len(point) == 2 and all(map(_is_number, point))
        _need(good, f"{what}, whose {part} {index} is {point!r:.40}", "[x, y]", path)
    values = np.array(points, dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    _need(not len(bad), f"{what}, whose {part} {bad[:1]} is not finite", "finite pixels", path)
    outside = np.flatnonzero(
        ((values < -OUTSIDE_PX) | (values > np.array(size) + OUTSIDE_PX)).any(axis=1)
    )
    if len(outside):
        at = values[outside[0]].tolist()
        _need(False, f"{what}, whose {part} {outside[0]} lies at {at}",
              f"pixels of an image of {size[0]} x {size[1]}", path)  # fmt: skip
    return values


def _object(value: object, what: str, path: str | Path | None) -> dict[Any, Any]:
    """A JSON object; a name that it lacks reads as None."""
    if isinstance(value, dict):
        return defaultdict(lambda: None, value)
    raise InputError(f"{what}a {_kind_of(value)}", "an object", _REMEDY, path=path)


def _need(holds: object, found: str, expected: str, path: str | Path | None) -> None:
    if not holds:
        raise InputError(found, expected, _REMEDY, path=path)


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < _MOST


def _is_number(value: object) -> bool:
    return _is_whole(value) or isinstance(value, float)


def _kind_of(value: object) -> str:
    names = {dict: "object", list: "list", str: "text", bool: "truth value", type(None): "nothing"}
    return names.get(type(value), "number")
