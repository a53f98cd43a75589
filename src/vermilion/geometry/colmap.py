"""COLMAP models, text or binary, and which camera each of their images is of."""

from __future__ import annotations

import codecs
import math
import re
import struct
import tempfile
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import pycolmap

from vermilion.storage.errors import InputError

#: Files that a model must have; rigs, frames and points are optional.
_NEEDED, _OPTIONAL = ("cameras", "images"), ("rigs", "frames", "points3D")


def model_files(folder: str | Path) -> list[Path]:
    """Files of the model in a folder: of the text model, or of the binary one where it has none."""
    folder = Path(folder)
    for suffix in (".txt", ".bin"):
        if all((folder / f"{name}{suffix}").is_file() for name in _NEEDED):
            paths = [folder / f"{name}{suffix}" for name in (*_NEEDED, *_OPTIONAL)]
            return [path for path in paths if path.is_file()]
    return []


def read_colmap_model(folder: str | Path) -> pycolmap.Reconstruction:
    """Read a model without its points.

    Raises:
        InputError: the folder has no whole model, or one that cannot be read.
    """
    paths = model_files(folder)
    if not paths:
        raise InputError(
            f"no {_lacking(Path(folder))}",
            "a COLMAP model: cameras.txt and images.txt, or cameras.bin and images.bin",
            "Export the rig from COLMAP, or give calibration views.",
            path=folder,
        )
    binary = paths[0].suffix == ".bin"
    if not binary:
        _check_numbers(paths[0], range(4, 99))
        _check_numbers(paths[1], range(1, 8))
    model = pycolmap.Reconstruction()
    try:
        # Exporters leave the points out, COLMAP wants them, and they may be large: it gets none.
        with tempfile.TemporaryDirectory() as copy:
            for path in paths:
                if path.stem != "points3D":
                    data = path.read_bytes()  # editors put a byte order mark before text
                    (Path(copy) / path.name).write_bytes(data.removeprefix(codecs.BOM_UTF8))
            points = Path(copy) / f"points3D{paths[0].suffix}"
            points.write_bytes(struct.pack("<Q", 0) if binary else b"")
            model.read_binary(copy) if binary else model.read_text(copy)
    except Exception as error:  # pycolmap raises several kinds
        raise InputError(
            f"a COLMAP model that cannot be read ({_reason(error)})",
            f"valid {paths[0].name} and {paths[1].name}",
            "Check the files against the COLMAP documentation, or export them again.",
            path=folder,
        ) from error
    return model


def _check_numbers(path: Path, columns: range) -> None:
    """Raise InputError where a row of cameras.txt or images.txt has a number that is not finite."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        raise _not_finite(path, str(error)) from error
    rows = [(k, line.split()) for k, line in enumerate(lines, 1) if not line.startswith("#")]
    if path.stem == "images":  # points follow each image on a line of their own
        first = next((k for k, (_, words) in enumerate(rows) if words), 0)
        rows = rows[first::2]
    for number, words in rows:
        for word in words[columns.start : columns.stop]:
            if not _is_finite(word):
                raise _not_finite(path, f"line {number}: '{word:.20}'")


def _is_finite(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _not_finite(path: Path, found: str) -> InputError:
    return InputError(
        f"a COLMAP model that cannot be read ({found})",
        "finite numbers as the COLMAP documentation has them",
        "Check the file, or export it again.",
        path=path,
    )


def _reason(error: Exception) -> str:
    """What pycolmap says, without its place in COLMAP's source."""
    text = re.sub(r"\[\S+:\d+\]\s*|Check failed:\s*", "", " ".join(str(error).split()))
    return text if len(text) <= 80 else f"{text[:77]}..."


def _lacking(folder: Path) -> str:
    """Name of the file that a folder most likely should have."""
    binary = any((folder / f"{name}.bin").is_file() for name in _NEEDED)
    suffix = ".bin" if binary else ".txt"
    names = [f"{name}{suffix}" for name in _NEEDED]
    return " and ".join(name for name in names if not (folder / name).is_file())


def camera_of_images(images: Iterable[str]) -> dict[str, str]:
    """Camera of each image of a model, by the image's name.

    Where every image lies in a folder and is named by a number, as COLMAP's rigs have it
    (`face0/000000.jpg`), the camera is the folder; else it is the name without folder and suffix
    (`face0.jpg`, `rig/face0.png`, `face0`).
    """
    paths = {name: PurePosixPath(name.replace("\\", "/")) for name in images}
    numbered = all(len(p.parts) > 1 and p.stem[-1:].isdigit() for p in paths.values())
    # One folder for several cameras is a folder of images that are named after them.
    folders = {path.parent.name for path in paths.values()}
    if numbered and (len(folders) > 1 or all(p.stem.isdigit() for p in paths.values())):
        return {name: path.parent.name for name, path in paths.items()}
    return {name: _stem(path) for name, path in paths.items()}


def _stem(path: PurePosixPath) -> str:
    """Name without its suffix; `cam.1` has none."""
    return path.name if path.suffix[1:].isdigit() else path.stem
