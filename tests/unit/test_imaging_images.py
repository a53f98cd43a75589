"""Image files as people have them give the image of the plain file."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest

from tests.unit.small_videos import scene
from vermilion.capture.checks import check_image
from vermilion.capture.manifest import capture_manifest
from vermilion.config.capture import CaptureConfig
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import (
    ImageReading,
    image_size,
    linear_to_srgb,
    read_image,
    srgb_to_linear,
    write_image,
    write_srgb8,
)
from vermilion.imaging.source import IMAGE_SUFFIXES, folder_of
from vermilion.storage.errors import InputError, RefusedInputError

IMAGE = scene(3)
LINEAR = srgb_to_linear(IMAGE / np.float32(255))
GREY = IMAGE[..., :1]


def write(path, pixels, names=None, kind=None, window=None, **attributes):
    """Write pixels (h, w, channels) with OpenImageIO; `window` is (x, y, full width, full height)."""
    height, width, depth = pixels.shape
    kind = kind or {"uint8": oiio.UINT8, "uint16": oiio.UINT16}.get(str(pixels.dtype), oiio.HALF)
    spec = oiio.ImageSpec(width, height, depth, kind)
    if names:
        spec.channelnames = names
    if window:
        spec.x, spec.y, spec.full_width, spec.full_height = window
    for name, value in attributes.items():
        spec[name.replace("__", ":")] = value
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), oiio.geterror()
    assert out.write_image(np.ascontiguousarray(pixels)), out.geterror()
    out.close()
    return path


def off(path, expected=LINEAR, **reading) -> float:
    """Largest difference from an image, display values."""
    read = read_image(path, ImageReading(**reading))
    assert read.dtype == np.float32 and read.shape == expected.shape, (read.shape, expected.shape)
    assert image_size(path, ImageReading(**reading)) == (read.shape[1], read.shape[0])
    return float(np.abs(linear_to_srgb(read) - linear_to_srgb(expected)).max() * 255)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_plain_images_are_what_the_library_gives(tmp_path, suffix):
    path = write(tmp_path / f"a{suffix}", IMAGE)
    stream = oiio.ImageInput.open(str(path))
    assert np.array_equal(read_image(path), srgb_to_linear(stream.read_image(oiio.FLOAT)))


#: Orientation of EXIF -> what a camera that is held so stores of an image.
STORED = {
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.swapaxes(0, 1),
    6: np.rot90,  # it is shown turned clockwise
    7: lambda a: a.swapaxes(0, 1)[::-1, ::-1],
    8: lambda a: np.rot90(a, -1),
}


@pytest.mark.parametrize("tag", STORED)
def test_exif_orientation_is_honoured(tmp_path, tag):
    path = write(tmp_path / "a.tif", STORED[tag](IMAGE), Orientation=tag)
    assert off(path) < 0.001
    facts, reason = check_image(path, tmp_path, (96, 64))
    assert reason == "" and (facts.width_px, facts.height_px) == (96, 64)
    jpeg = write(tmp_path / "a.jpg", STORED[tag](IMAGE), Orientation=tag, CompressionQuality=100)
    read = linear_to_srgb(read_image(jpeg))
    assert np.abs(read - IMAGE / 255).mean() * 255 < 2


@pytest.mark.parametrize("suffix", [".png", ".tif", ".dpx", ".bmp", ".tga", ".webp"])
def test_every_kind_of_file_gives_the_plain_image(tmp_path, suffix):
    assert suffix in IMAGE_SUFFIXES
    path = write(tmp_path / f"a{suffix}", IMAGE, compression="lossless")
    assert off(path) < 0.001


def test_channels_become_three_and_alpha_does_not_darken(tmp_path):
    clear = np.full_like(GREY, 128)
    grey = srgb_to_linear(np.repeat(GREY, 3, axis=2) / np.float32(255))
    assert off(write(tmp_path / "g.png", GREY), grey) < 0.001
    half = [("oiio__UnassociatedAlpha", 1)]
    pixels = np.concatenate([GREY, clear], axis=2)
    assert off(write(tmp_path / "ga.png", pixels, ("Y", "A"), **dict(half)), grey) < 1
    pixels = np.concatenate([IMAGE, clear], axis=2)
    assert off(write(tmp_path / "rgba.png", pixels, ("R", "G", "B", "A"), **dict(half))) < 1
    assert off(write(tmp_path / "deep.png", IMAGE.astype(np.uint16) * 257)) < 0.01
    assert off(write(tmp_path / "deep.dpx", IMAGE.astype(np.uint16) * 257)) < 0.01


def test_palette_and_cmyk_give_three_channels(tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    levels = (IMAGE // 64) * 85  # 64 colours fit a palette
    pillow.fromarray(levels).quantize(64, dither=0).save(tmp_path / "p.png")
    assert off(tmp_path / "p.png", srgb_to_linear(levels / np.float32(255))) <= 2
    pillow.fromarray(IMAGE).convert("CMYK").save(tmp_path / "c.jpg", quality=100, subsampling=0)
    assert off(tmp_path / "c.jpg") < 12
    pillow.fromarray(IMAGE).convert("CMYK").save(tmp_path / "c.tif")
    assert off(tmp_path / "c.tif") <= 1


def test_exr_is_read_by_its_display_window(tmp_path):
    padded = np.zeros((80, 120, 3), np.float32)
    padded[8:72, 12:108] = LINEAR
    over = write(tmp_path / "over.exr", padded, window=(-12, -8, 96, 64))
    assert off(over) < 0.2
    part = write(tmp_path / "part.exr", LINEAR[10:50, 20:90], window=(20, 10, 96, 64))
    expected = np.zeros_like(LINEAR)
    expected[10:50, 20:90] = LINEAR[10:50, 20:90]
    assert off(part, expected) < 0.2
    assert check_image(over, tmp_path, (96, 64))[1] == ""
    beside = write(tmp_path / "beside.exr", LINEAR[:8, :8], window=(200, 10, 96, 64))
    assert read_image(beside).shape == LINEAR.shape and read_image(beside).max() == 0


def layered(path, names=("normal.X", "normal.Y", "normal.Z", "beauty.R", "beauty.G", "beauty.B")):
    return write(path, np.concatenate([1 - LINEAR, LINEAR], axis=2), names)


def test_a_layer_of_an_exr_is_read_by_its_name(tmp_path):
    path = layered(tmp_path / "000001.exr")
    assert off(path, exr_layer="beauty") < 0.2
    for reading in (ImageReading(), ImageReading(exr_layer="diffuse")):
        with pytest.raises(RefusedInputError, match=r"'beauty', 'normal'.*capture\.exr_layer"):
            read_image(path, reading)
    with pytest.raises(InputError, match=r"1 problem.*\n.*camera cam.*capture\.exr_layer"):
        capture_manifest(tmp_path, "s", "t", [1])
    source = {"path": str(tmp_path), "exr_layer": "beauty", "colour_space": ""}
    manifest = capture_manifest(source, "s", "t", [1])
    assert manifest.bad == {} and manifest.source == source
    assert np.array_equal(
        open_frames(manifest.source).read("cam", 1), read_image(path, ImageReading("beauty"))
    )


def test_plain_channels_are_the_image_beside_layers_and_one_layer_needs_no_name(tmp_path):
    names = ("depth.Z", "N.X", "N.Y", "R", "G", "B")
    assert off(layered(tmp_path / "a.exr", names)) < 0.2
    assert off(write(tmp_path / "b.exr", LINEAR, ("only.R", "only.G", "only.B"))) < 0.2
    assert off(write(tmp_path / "c.exr", LINEAR), exr_layer="beauty") < 0.2
    grey = np.repeat(LINEAR[..., :1], 3, axis=2)
    assert off(write(tmp_path / "y.exr", LINEAR[..., :1], ("Y",)), grey) < 0.2


def test_parts_of_an_exr_are_layers(tmp_path):
    path, specs = tmp_path / "parts.exr", []
    for name in ("normal", "beauty"):
        specs.append(oiio.ImageSpec(96, 64, 3, oiio.HALF))
        specs[-1]["oiio:subimagename"] = name
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), tuple(specs))
    out.write_image(np.ascontiguousarray(1 - LINEAR))
    assert out.open(str(path), specs[1], "AppendSubimage")
    out.write_image(np.ascontiguousarray(LINEAR))
    out.close()
    assert off(path, exr_layer="beauty") < 0.2
    with pytest.raises(RefusedInputError, match="'normal', 'beauty'"):
        read_image(path)


def test_pixels_of_a_squeezed_exr_become_square(tmp_path):
    path = write(tmp_path / "a.exr", LINEAR[:, ::2], PixelAspectRatio=2.0)
    assert image_size(path) == (96, 64)
    assert np.abs(linear_to_srgb(read_image(path)) - linear_to_srgb(LINEAR)).mean() * 255 < 2


def test_a_colour_space_by_name_becomes_linear_srgb(tmp_path):
    to_acescg = np.array(
        [[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0134], [0.0206, 0.1096, 0.8698]]
    )
    path = write(tmp_path / "a.exr", (LINEAR @ to_acescg.T).astype(np.float32), kind=oiio.FLOAT)
    assert off(path, colour_space="ACEScg") < 1
    assert off(path) > 5
    png = write(tmp_path / "a.png", IMAGE)
    assert off(png, colour_space="sRGB - Texture") < 0.1
    assert CaptureConfig(colour_space="ACEScg").reading == ImageReading("", "ACEScg")
    with pytest.raises(ValueError, match=r"'ACESgc' is no colour space.*near: .*ACEScg"):
        CaptureConfig(colour_space="ACESgc")


def test_film_values_without_their_space_are_refused(tmp_path):
    path = write(tmp_path / "a.dpx", IMAGE, dpx__Transfer="Printing density")
    with pytest.raises(RefusedInputError, match=r"a\.dpx.*printing density.*capture\.colour_space"):
        read_image(path)
    assert read_image(path, ImageReading(colour_space="ADX10")).shape == LINEAR.shape


@pytest.mark.parametrize("tag", [1, 6])
def test_a_photograph_is_a_take_of_one_frame_as_a_folder_with_it_is(tmp_path, tag):
    (tmp_path / "folder").mkdir()
    numbered = write(tmp_path / "folder" / "000000.jpg", STORED[tag](IMAGE), Orientation=tag)
    photo = tmp_path / "portrait.JPG"
    photo.write_bytes(numbered.read_bytes())
    alone, folder = open_frames(photo), open_frames(numbered.parent)
    assert np.array_equal(alone.read("cam", 0), folder.read("cam", 0))
    assert alone.size("cam") == folder.size("cam") == IMAGE.shape[1::-1]
    with pytest.raises(InputError, match="no image of this frame"):
        alone.read("cam", 1)
    manifest = capture_manifest(photo, "s", "t", [0])
    assert not manifest.bad and manifest.frames["cam"][0]["file"] == photo.name
    size = manifest.cameras["cam"]["width_px"], manifest.cameras["cam"]["height_px"]
    assert size == IMAGE.shape[1::-1]
    assert folder_of(photo, "labels") == tmp_path / "portrait.JPG.labels"
    assert folder_of(numbered.parent, "labels") == numbered.parent / "labels"


def test_a_capture_of_mixed_orientation_has_one_size(tmp_path):
    """A size is compared as it is shown, so that a turned image of a turned camera fits."""
    write_srgb8(tmp_path / "000001.png", IMAGE)
    write(tmp_path / "000002.tif", np.rot90(IMAGE), Orientation=6)
    write_image(tmp_path / "000003.exr", LINEAR)
    assert capture_manifest(tmp_path, "s", "t", [1, 2, 3]).bad == {}
