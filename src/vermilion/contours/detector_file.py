"""Reading a contour detector of any kind."""

from __future__ import annotations

from pathlib import Path

from vermilion.contours.boosted import BoostedDetector
from vermilion.contours.channels import CHANNELS
from vermilion.contours.detector import FORMAT_VERSION, ContourDetector
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.track_ridge import TrackRidgeDetector
from vermilion.storage.arrays import format_version, read_arrays
from vermilion.storage.errors import ModelFileError

_KINDS = {kind.kind: kind for kind in (BoostedDetector, TrackRidgeDetector, LandmarkRidgeDetector)}


def load_detector(path: str | Path) -> ContourDetector:
    """Read a detector of any kind.

    Raises:
        ModelFileError: a damaged file, or one of another version.
    """
    expected = f"a contour detector of format {FORMAT_VERSION}"
    hint = "Remove the file and run again: the detector is trained anew."
    arrays = read_arrays(path, "contour detector", error=ModelFileError)
    try:
        version, kind = format_version(arrays), str(arrays["kind"])
        if version != FORMAT_VERSION or kind not in _KINDS:
            raise ModelFileError(f"format {version}, kind {kind}", expected, hint, path=path)
        if kind == BoostedDetector.kind and tuple(arrays["channels"]) != CHANNELS:
            raise ModelFileError("other image channels", expected, hint, path=path)
        return _KINDS[kind].from_arrays(arrays)
    except KeyError as error:
        raise ModelFileError(f"a file without {error}", expected, hint, path=path) from error
