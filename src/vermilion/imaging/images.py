"""Reading and writing images through OpenImageIO; processing is in linear light, float32."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path

LINEAR_SUFFIXES = (".exr", ".hdr")
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, [0, 1] -> [0, 1], float32."""
    values = np.asarray(values, dtype=np.float32)
    return np.where(
        values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4
    ).astype(np.float32)


def linear_to_srgb(values: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, clipped to [0, 1], float32."""
    values = np.clip(np.asarray(values, dtype=np.float32), 0.0, 1.0)
    return np.where(
        values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055
    ).astype(np.float32)


def read_image(path: str | Path, **place) -> np.ndarray:
    """An image as linear RGB, (h, w, 3) float32, whatever its format.

    8 and 16 bit files are taken as sRGB; EXR and HDR as linear. Raises InputError with the
    `place` (subject, take, camera, frame) where it cannot be read whole.
    """
    path = Path(path)
    pixels = _read_pixels(path, place)
    if path.suffix.lower() not in LINEAR_SUFFIXES:
        pixels = srgb_to_linear(pixels)
    return pixels


def read_channels(path: str | Path, **place) -> dict[str, np.ndarray]:
    """Every channel of a file as it is, name -> (h, w) float32."""
    path = Path(path)
    stream = _open(path, place)
    names = list(stream.spec().channelnames)
    pixels = stream.read_image(oiio.FLOAT)
    stream.close()
    if pixels is None:
        raise _damaged(path, place)
    pixels = np.asarray(pixels, dtype=np.float32).reshape(pixels.shape[0], pixels.shape[1], -1)
    return {name: pixels[..., index] for index, name in enumerate(names)}


def image_size(path: str | Path, **place) -> tuple[int, int]:
    """(width, height) from the header alone."""
    stream = _open(Path(path), place)
    spec = stream.spec()
    stream.close()
    return spec.width, spec.height


def write_image(path: str | Path, linear: np.ndarray) -> None:
    """Write linear RGB (h, w, 3) or grey (h, w): sRGB 8 bit for PNG, JPEG; half for EXR."""
    path = Path(path)
    linear = np.atleast_3d(np.asarray(linear, dtype=np.float32))
    if path.suffix.lower() in LINEAR_SUFFIXES:
        names = {1: ["Y"], 3: ["R", "G", "B"], 4: ["R", "G", "B", "A"]}[linear.shape[2]]
        write_channels(path, {name: linear[..., i] for i, name in enumerate(names)})
        return
    write_srgb8(path, np.rint(linear_to_srgb(linear) * 255).astype(np.uint8))


def write_srgb8(path: str | Path, pixels: np.ndarray) -> None:
    """Write (h, w, 3) or (h, w) uint8 as it is (PNG or JPEG)."""
    pixels = np.ascontiguousarray(np.atleast_3d(pixels))
    height, width, depth = pixels.shape
    spec = oiio.ImageSpec(width, height, depth, oiio.UINT8)
    spec["oiio:ColorSpace"] = "sRGB"
    spec["png:compressionLevel"] = 4
    _write(path, spec, pixels)


def write_channels(path: str | Path, channels: dict[str, np.ndarray]) -> None:
    """Write named (h, w) channels as half-float EXR, zip compressed."""
    pixels = np.ascontiguousarray(np.stack(list(channels.values()), axis=-1), dtype=np.float32)
    height, width, depth = pixels.shape
    spec = oiio.ImageSpec(width, height, depth, oiio.HALF)
    spec.channelnames = list(channels)
    spec["compression"] = "zip"
    _write(path, spec, pixels)


def _write(path: str | Path, spec: oiio.ImageSpec, pixels: np.ndarray) -> None:
    # A rerun writes the same bytes: no time. Where it is not set, OpenImageIO writes the time of day.
    spec["DateTime"] = ""
    with atomic_path(path) as temporary:
        stream = oiio.ImageOutput.create(str(temporary))
        if not stream or not stream.open(str(temporary), spec):
            raise OSError(f"cannot write {path}: {oiio.geterror()}")
        written = stream.write_image(pixels)
        stream.close()
        if not written:
            raise OSError(f"cannot write {path}: {stream.geterror()}")


def _open(path: Path, place: dict) -> oiio.ImageInput:
    if not path.is_file():
        raise InputError(
            "no such file",
            "an image",
            "Check the frame range of the take sheet.",
            path=path,
            **place,
        )
    stream = oiio.ImageInput.open(str(path))
    if not stream:
        raise InputError(
            f"a file that is no readable image ({oiio.geterror()})",
            "PNG, JPEG, TIFF or EXR",
            "Export the frame again.",
            path=path,
            **place,
        )
    return stream


def _read_pixels(path: Path, place: dict) -> np.ndarray:
    stream = _open(path, place)
    spec = stream.spec()
    pixels = stream.read_image(oiio.FLOAT)
    failed = stream.has_error
    stream.close()
    if pixels is None or failed:
        raise _damaged(path, place)
    pixels = np.asarray(pixels, dtype=np.float32).reshape(spec.height, spec.width, -1)
    if pixels.shape[2] == 1:
        return np.repeat(pixels, 3, axis=2)
    return np.ascontiguousarray(pixels[..., :3])


def _damaged(path: Path, place: dict) -> InputError:
    return InputError(
        "a truncated or damaged image",
        "a whole image",
        "Export the frame again.",
        path=path,
        **place,
    )
