"""The sensor: read and shot noise in linear light."""

from __future__ import annotations

import zlib

import numpy as np


def sensor_noise(
    image: np.ndarray, read: float, shot: float, seed: int, name: str, frame: int
) -> np.ndarray:
    """The image (h, w, 3), linear, with noise of variance `read`**2 + `shot` * value.

    The noise depends on the seed, the name (subject, take, camera) and the frame alone, so that
    chunks and the order of jobs change nothing.
    """
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), frame])
    deviation = np.sqrt(read**2 + shot * np.maximum(image, 0.0), dtype=np.float32)
    noise = rng.standard_normal(image.shape, dtype=np.float32)
    return np.clip(image + deviation * noise, 0.0, 1.0)
