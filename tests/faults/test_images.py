"""Image files that are damaged, lie about their size, or are named as something else."""

from __future__ import annotations

import struct
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from tests.faults.case import Case, check, parametrized
from vermilion.imaging.images import image_size, read_channels, read_image, write_channels
from vermilion.imaging.images import write_srgb8 as write

SIDE = 100_000  # pixels: 10^10 of them, 30 GB


def face_image(rng: np.random.Generator) -> np.ndarray:
    """(40, 60, 3) uint8: smooth, so that JPEG keeps it, with some noise."""
    y, x = np.mgrid[:40, :60]
    smooth = np.stack([4 * x, 6 * y, 2 * (x + y)], axis=-1)
    return (smooth + rng.integers(0, 4, smooth.shape)).clip(0, 255).astype(np.uint8)


def whole(path: Path, rng: np.random.Generator) -> Path:
    """A good image of the format of the suffix."""
    if path.suffix == ".exr":
        rgb = face_image(rng).astype(np.float32) / 255
        write_channels(path, {name: rgb[..., k] for k, name in enumerate("RGB")})
    else:
        write(path, face_image(rng))
    return path


def truncated(suffix: str):
    def make(folder, rng):
        path = whole(folder / f"000000{suffix}", rng)
        size = path.stat().st_size
        path.write_bytes(path.read_bytes()[: int(size * rng.uniform(0.3, 0.8))])
        return path

    return make


def named(suffix: str, real: str):
    """An image of one format under the suffix of another."""

    def make(folder, rng):
        path = whole(folder / f"made{real}", rng)
        return path.rename(folder / f"000000{suffix}")

    return make


def content(name: str, data: bytes):
    def make(folder, rng):
        path = folder / name
        path.write_bytes(data)
        return path

    return make


def noise(folder, rng):
    path = folder / "000000.png"
    path.write_bytes(rng.bytes(5000))
    return path


def flipped(folder, rng):
    path = whole(folder / "000000.png", rng)
    data = bytearray(path.read_bytes())
    data[int(rng.integers(60, len(data) - 20))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)
    return path


def a_folder(folder, rng):
    (folder / "000000.png").mkdir()
    return folder / "000000.png"


def broken_link(folder, rng):
    (folder / "000000.png").symlink_to(folder / "nowhere.png")
    return folder / "000000.png"


def png_chunk(kind: bytes, data: bytes) -> bytes:
    import zlib

    check = zlib.crc32(kind + data)
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)


@cache
def zeros_of_ten_megabytes() -> bytes:
    import zlib

    return zlib.compress(bytes(10_000_000), 9)


def png(width: int, height: int) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zeros_of_ten_megabytes()
    return (
        b"\x89PNG\r\n\x1a\n"
        + png_chunk(b"IHDR", header)
        + png_chunk(b"IDAT", data)
        + png_chunk(b"IEND", b"")
    )


def tiff(width: int, height: int) -> bytes:
    """One strip, RGB, without its pixels."""
    rows = [
        (256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1), (262, 3, 2), (273, 4, 8),
        (277, 3, 3), (278, 4, height), (279, 4, 2**31), (284, 3, 1),
    ]  # fmt: skip
    table = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in rows)
    return b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", len(rows)) + table + bytes(4)


def bmp(width: int, height: int) -> bytes:
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 54 + 1000, 0, 0, 54) + header + bytes(1000)


def targa(width: int, height: int) -> bytes:
    return struct.pack("<BBBHHBHHHHBB", 0, 0, 10, 0, 0, 0, 0, 0, width, height, 24, 0) + bytes(100)


def radiance(width: int, height: int) -> bytes:
    size = f"-Y {height} +X {width}\n".encode()
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size + bytes(1000)


def jpeg(width: int, height: int) -> bytes:
    encoded = cv2.imencode(".jpg", np.zeros((16, 16, 3), np.uint8))[1].tobytes()
    at = encoded.index(b"\xff\xc0") + 5
    return encoded[:at] + struct.pack(">HH", height, width) + encoded[at + 4 :]


def exr_window(*windows: bytes):
    """An EXR whose data or display window says 100000 pixels a side."""

    def make(folder, rng):
        path = whole(folder / "000000.exr", rng)
        data = path.read_bytes()
        for window in windows:
            at = data.index(window + b"\0box2i\0") + len(window) + 11
            box = struct.pack("<4i", 0, 0, SIDE - 1, SIDE - 1)
            data = data[:at] + box + data[at + 16 :]
        path.write_bytes(data)
        return path

    return make


DAMAGED = "truncated or damaged|unreadable image"
LARGE = "pixels|image size|MB image|resolution"  # of Vermilion, or of OpenImageIO itself
CASES = [
    *(Case(f"truncated {s}", truncated(s), read_image, DAMAGED) for s in
      (".png", ".jpg", ".tif", ".exr", ".dpx", ".bmp", ".tga", ".webp")),
    Case("zero bytes", content("000000.png", b""), read_image, "empty"),
    Case("zero bytes, size alone", content("000000.tif", b""), image_size, "empty"),
    Case("text", content("000000.png", b"not an image\n" * 50), read_image, "unreadable image"),
    Case("noise", noise, read_image, "unreadable image"),
    Case("flipped bit", flipped, read_image, DAMAGED),
    Case("a folder", a_folder, read_image, "no such file"),
    Case("a broken link", broken_link, read_image, "no such file"),
    Case("no width", content("000000.png", png(0, 40)), read_image, "unreadable image"),
    *(Case(f"100000 pixels a side, {name}", content(f"000000.{name}", make(SIDE, SIDE)), read_image,
           LARGE, heavy=True)
      for name, make in (("png", png), ("tif", tiff), ("bmp", bmp), ("hdr", radiance))),
    Case("40000 pixels a side, tif", content("000000.tif", tiff(40_000, 40_000)), read_image,
         LARGE, heavy=True),
    Case("100000 pixels wide, 4000 high", content("000000.png", png(SIDE, 4000)), read_image, LARGE,
         heavy=True),
    Case("65535 pixels a side, tga", content("000000.tga", targa(65535, 65535)), read_image, LARGE,
         heavy=True),
    Case("65535 pixels a side, jpg", content("000000.jpg", jpeg(65535, 65535)), read_image, LARGE,
         heavy=True),
    Case("100000 pixels a side, size alone", content("000000.png", png(SIDE, SIDE)), image_size, LARGE),
    Case("100000 pixels a side, data window", exr_window(b"dataWindow"), read_image, LARGE, heavy=True),
    Case("100000 pixels a side, display window", exr_window(b"displayWindow"), read_image, LARGE,
         heavy=True),
    Case("100000 pixels a side, maps", exr_window(b"dataWindow", b"displayWindow"), read_channels, LARGE,
         heavy=True),
]  # fmt: skip


def looks_right(suffix: str, real: str):
    """The pixels are those of the format in the file, whatever it is called."""

    def right(pixels):
        expected = ((face_image(np.random.default_rng(1)) / 255.0 + 0.055) / 1.055) ** 2.4
        if real == ".exr":
            expected = face_image(np.random.default_rng(1)) / 255.0
        assert np.abs(pixels - expected).mean() < 0.02

    return Case(f"{real} named {suffix}", named(suffix, real), read_image, right=right)


CASES += [
    looks_right(".png", ".jpg"),
    looks_right(".jpg", ".png"),
    looks_right(".tif", ".png"),
    looks_right(".png", ".exr"),
    looks_right(".exr", ".png"),
]


@parametrized(CASES)
def test_image(case, seed, tmp_path):
    check(case, seed, tmp_path)
