"""Reading and writing images through OpenImageIO; processing is in linear light, float32."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from vermilion.imaging.colour_space import to_linear
from vermilion.imaging.display_window import to_display_window
from vermilion.imaging.exr_layers import choose_layer, layers_of
from vermilion.imaging.image_file import check_size, is_exr, is_linear, open_image
from vermilion.imaging.orientation import Orientation, orientation_of_exif
from vermilion.imaging.pixel_aspect import resample, square_size
from vermilion.storage.errors import InputError, RefusedInputError
from vermilion.storage.files import atomic_path

LINEAR_SUFFIXES = (".exr", ".hdr")
#: Formats whose pixel aspect is one of the image, not of a sheet of paper.
_WITH_ASPECT = ("openexr", "dpx")
#: Transfers of DPX that are no display values.
_FILM_TRANSFERS = ("Printing density", "Logarithmic", "Linear")


@dataclass(frozen=True)
class ImageReading:
    """What a file does not say of itself.

    Attributes:
        exr_layer: name of the layer that is the image, in EXR files of several.
        colour_space: name of the colour space of the files (see `imaging.colour_space`); by default
            sRGB, and linear sRGB for EXR and HDR.
    """

    exr_layer: str = ""
    colour_space: str = ""


AS_TAGGED = ImageReading()
#: Luminance of linear RGB (ITU-R BT.709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """Linear `values` (...,) float32 of sRGB ones (...,), both in [0, 1] (IEC 61966-2-1)."""
    values = np.asarray(values, dtype=np.float32)
    return np.where(
        values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4
    ).astype(np.float32)


#: PNG's filter that writes differences to the pixel above (`PNG_FILTER_UP` of libpng).
_PNG_UP = 32
#: Value of a byte's step as OpenImageIO has it, and linear value of each byte: a look-up costs a
#: fifth of the curve.
_BYTE = np.float32(1.0 / 255.0)
_LINEAR_OF_BYTE = srgb_to_linear(np.arange(256, dtype=np.float32) * _BYTE)


def linear_to_srgb(values: np.ndarray) -> np.ndarray:
    """sRGB `values` (...,) float32 of linear ones (...,), clipped to [0, 1] (IEC 61966-2-1)."""
    values = np.clip(np.asarray(values, dtype=np.float32), 0.0, 1.0)
    return np.where(
        values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055
    ).astype(np.float32)


def read_image(path: str | Path, reading: ImageReading = AS_TAGGED, **place) -> np.ndarray:
    """An image as linear RGB, (h, w, 3) float32, whatever its format (the content's, not the name's).

    It is upright (EXIF orientation), has square pixels, and for EXR is the display window. Grey
    becomes three equal channels; alpha is left out. 8 and 16 bit files are taken as sRGB; EXR and
    HDR as linear. Raises InputError with the `place` (subject, take, camera, frame) where it cannot
    be read whole, or says that it is something else.
    """
    path = Path(path)
    pixels, linear = _read_pixels(path, reading, place)
    if reading.colour_space:
        if pixels.dtype == np.uint8:
            pixels = pixels * _BYTE
        return to_linear(pixels, reading.colour_space)
    if pixels.dtype == np.uint8:
        return _LINEAR_OF_BYTE[pixels]
    return pixels if linear else srgb_to_linear(pixels)


def read_channels(path: str | Path, **place) -> dict[str, np.ndarray]:
    """Every channel of a file as it is, name -> (h, w) float32."""
    path = Path(path)
    stream = open_image(path, **place)
    names = list(stream.spec().channelnames)
    pixels = stream.read_image(oiio.FLOAT)
    stream.close()
    if pixels is None:
        raise _damaged(path, place)
    pixels = np.asarray(pixels, dtype=np.float32).reshape(pixels.shape[0], pixels.shape[1], -1)
    return {name: pixels[..., index] for index, name in enumerate(names)}


def image_size(path: str | Path, reading: ImageReading = AS_TAGGED, **place) -> tuple[int, int]:
    """(width, height) as `read_image` gives it, from the header alone."""
    path = Path(path)
    stream = open_image(path, **place)
    try:
        return shown_size(stream, path, reading, **place)
    finally:
        stream.close()


def shown_size(
    stream: oiio.ImageInput, path: Path, reading: ImageReading = AS_TAGGED, **place
) -> tuple[int, int]:
    """(width, height) of an open file as `read_image` gives it; the stream is at the image's part."""
    _seek_image(stream, path, reading, place)
    return _orientation(stream.spec()).size(*_square(stream, path, place))


def refusal(path: Path, reading: ImageReading = AS_TAGGED, **place) -> str:
    """Why a file that is whole is of a kind that is not read; empty where it is, or is damaged."""
    try:
        image_size(path, reading, **place)
    except RefusedInputError as error:
        return str(error)
    except InputError:
        pass
    return ""


def write_image(path: str | Path, linear: np.ndarray) -> None:
    """Write linear RGB (h, w, 3) or grey (h, w): sRGB 8 bit for PNG, JPEG; half for EXR."""
    path = Path(path)
    linear = np.atleast_3d(np.asarray(linear, dtype=np.float32))
    if path.suffix.lower() in LINEAR_SUFFIXES:
        names = {1: ["Y"], 3: ["R", "G", "B"], 4: ["R", "G", "B", "A"]}[linear.shape[2]]
        write_channels(path, {name: linear[..., i] for i, name in enumerate(names)})
        return
    write_srgb8(path, np.rint(linear_to_srgb(linear) * 255).astype(np.uint8), noisy=True)


def write_srgb8(path: str | Path, pixels: np.ndarray, noisy: bool = False) -> None:
    """Write `pixels` (h, w, 3) or (h, w) uint8 as they are (PNG or JPEG).

    Args:
        noisy: whether they are of a camera: its noise does not repeat, so PNG looks for runs only.
    """
    pixels = np.ascontiguousarray(np.atleast_3d(pixels))
    height, width, depth = pixels.shape
    spec = oiio.ImageSpec(width, height, depth, oiio.UINT8)
    spec["oiio:ColorSpace"] = "sRGB"
    # A third of the time of level 4 and filters tried for each row; files are 10 % larger, those of cameras 7 % smaller.
    spec["png:compressionLevel"] = 1
    spec["png:filter"] = _PNG_UP
    if noisy and Path(path).suffix.lower() == ".png":
        spec["compression"] = "rle"
    _write(path, spec, pixels)


def write_channels(path: str | Path, channels: dict[str, np.ndarray]) -> None:
    """Write named `channels` (h, w) as half-float EXR, zip compressed."""
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
        closed = stream.close()
        if not (written and closed):
            raise OSError(f"cannot write {path}: {stream.geterror()}")


def _read_pixels(path: Path, reading: ImageReading, place: dict) -> tuple[np.ndarray, bool]:
    """Values (h, w, 3) as stored, laid out as shown: uint8, or float32 for other depths; are they linear?"""
    stream = open_image(path, **place)
    channels = _seek_image(stream, path, reading, place)
    spec, square, linear = stream.spec(), _square(stream, path, place), is_linear(stream)
    windows = is_exr(stream)
    kind = oiio.UINT8 if spec.format == oiio.UINT8 else oiio.FLOAT
    pixels = stream.read_image(kind)
    failed = stream.has_error
    stream.close()
    if pixels is None or failed:
        raise _damaged(path, place)
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, -1)
    if channels is not None:
        pixels = pixels[..., channels]
    if pixels.shape[2] < 3:  # grey, with alpha or without
        pixels = np.repeat(pixels[..., :1], 3, axis=2)
    pixels = np.ascontiguousarray(pixels[..., :3])
    if windows:
        pixels = to_display_window(pixels, spec)
    return _orientation(spec).apply(resample(pixels, square)), linear


def _seek_image(
    stream: oiio.ImageInput, path: Path, reading: ImageReading, place: dict
) -> list[int] | None:
    """Go to the part of the file that is the image; its channels, None for the first ones.

    Raises InputError where the file says that it is no image as those that are read here.
    """
    if is_exr(stream):
        layer = choose_layer(layers_of(stream), reading.exr_layer, path, **place)
        stream.seek_subimage(layer.part, 0)
        check_size(stream, path, **place)
        first = tuple(range(len(layer.indices)))  # a slice of them is no copy
        return None if layer.indices == first else list(layer.indices)
    transfer = stream.spec().get_string_attribute("dpx:Transfer")
    if transfer in _FILM_TRANSFERS and not reading.colour_space:
        raise RefusedInputError(
            f"a DPX of {transfer.lower()} values",
            "display values, or the name of their colour space",
            "Set `capture.colour_space`, for example to `ADX10` or `ARRI LogC3 (EI800)`, or convert "
            "the files to sRGB.",
            path=path,
            **place,
        )
    return None


def _orientation(spec: oiio.ImageSpec) -> Orientation:
    return orientation_of_exif(spec.get_int_attribute("Orientation", 1))


def _square(stream: oiio.ImageInput, path: Path, place: dict) -> tuple[int, int]:
    """(width, height) with square pixels, not yet turned upright."""
    spec = stream.spec()
    width, height = spec.width, spec.height
    if is_exr(stream):
        width, height = spec.full_width, spec.full_height
    if stream.format_name() not in _WITH_ASPECT:
        return width, height
    try:
        return square_size(width, height, spec.get_float_attribute("PixelAspectRatio", 1.0))
    except ValueError as error:
        raise RefusedInputError(
            f"{error}",
            "pixels up to 4 times as wide as high, or the reverse",
            "Correct the file's pixel aspect ratio.",
            path=path,
            **place,
        ) from error


def _damaged(path: Path, place: dict) -> InputError:
    return InputError(
        "a truncated or damaged image",
        "a whole image",
        "Export the frame again.",
        path=path,
        **place,
    )
