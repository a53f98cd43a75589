"""High dynamic range to the appearance of standard dynamic range: PQ and HLG (ITU-R BT.2100)."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

#: Light of white where HDR was graded as such (ITU-R BT.2408), and where SDR was put into PQ as it is.
HDR_WHITE_NITS, SDR_WHITE_NITS = 203.0, 100.0
#: Nothing brighter is told apart.
PEAK_NITS = 1000.0
#: Exponent of a display of standard dynamic range (ITU-R BT.1886).
DISPLAY_GAMMA = 2.4
#: Luminance of linear BT.2020 light.
_LUMINANCE = np.array([0.2627, 0.6780, 0.0593], dtype=np.float32)


def pq_to_nits(signal: np.ndarray) -> np.ndarray:
    """Light (...,) in nits of a PQ `signal` (...,) in [0, 1] (SMPTE ST 2084)."""
    m1, m2 = 2610 / 16384, 128 * 2523 / 4096
    c1, c2, c3 = 3424 / 4096, 32 * 2413 / 4096, 32 * 2392 / 4096
    root = np.asarray(signal, dtype=np.float64) ** (1 / m2)
    return 10000.0 * (np.maximum(root - c1, 0.0) / (c2 - c3 * root)) ** (1 / m1)


def hlg_to_scene(signal: np.ndarray) -> np.ndarray:
    """Relative scene light (...,) in [0, 1] of an HLG `signal` (...,) in [0, 1] (ARIB STD-B67)."""
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    signal = np.asarray(signal, dtype=np.float64)
    return np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12)


def light_of(codes: np.ndarray, transfer: str) -> np.ndarray:
    """Light of HDR code values.

    Args:
        codes: (..., 3) uint16 R'G'B', 65535 is a signal of 1.
        transfer: `pq` or `hlg`, the latter shown on a display of 1,000 nits.

    Returns:
        (..., 3) float32 linear light in the primaries of the codes, nits.
    """
    light = _curve(transfer)[codes]
    if transfer == "hlg":  # BT.2100: the display's gamma is 1.2, on luminance
        luminance = np.maximum(light @ _LUMINANCE, 1e-9)
        light *= (PEAK_NITS * luminance ** np.float32(0.2))[..., None]
    return light


@cache
def _curve(transfer: str) -> np.ndarray:
    signal = np.arange(65536) / 65535.0
    curve = pq_to_nits(signal) if transfer == "pq" else hlg_to_scene(signal)
    return curve.astype(np.float32)


def reference_white(light: np.ndarray) -> tuple[float, float]:
    """White and peak (nits) of a clip, from the `light` (..., 3) of some images, BT.709 primaries.

    White is 203 nits as HDR is graded, and 100 nits where next to nothing (one value of a thousand)
    is nearer to the former: then SDR was put into an HDR signal as it is.
    """
    peak = float(np.percentile(light.max(axis=-1), 99.9))
    between = np.sqrt(SDR_WHITE_NITS * HDR_WHITE_NITS)
    white = HDR_WHITE_NITS if peak > between else SDR_WHITE_NITS
    return white, float(np.clip(peak, white, PEAK_NITS))


def tone_map(light: np.ndarray, white_nits: float, peak_nits: float) -> np.ndarray:
    """Display values of standard dynamic range.

    Below a knee they are those of the same light on a display whose white is `white_nits`. From
    there to the peak, the largest of the three channels follows the roll-off of ITU-R BT.2390
    (EETF), and the colour keeps its hue.

    Args:
        light: (h, w, 3) float32 linear light, BT.709 primaries, nits.

    Returns:
        (h, w, 3) float32 in [0, 1], gamma 2.4.
    """
    relative = np.maximum(light, 0.0) / np.float32(white_nits)
    display = cv2.pow(relative, 1.0 / DISPLAY_GAMMA)
    red, green, blue = cv2.split(display)
    largest = cv2.max(cv2.max(red, green), blue)
    peak = (peak_nits / white_nits) ** (1.0 / DISPLAY_GAMMA)
    if peak > 1.0:
        bright = largest > 1.5 - 0.5 * peak
        top = largest[bright]
        display[bright] *= (_roll_off(np.minimum(top, peak), peak) / top)[:, None]
    return np.minimum(display, 1.0)


def _roll_off(value: np.ndarray, peak: float) -> np.ndarray:
    """BT.2390 Hermite spline: slope 1 at the knee, `peak` comes to 1. Values above the knee only."""
    top = 1.0 / peak
    knee = max(1.5 * top - 0.5, 0.0)
    t = (value / peak - knee) / (1.0 - knee)
    curve = (
        (2 * t**3 - 3 * t**2 + 1) * knee
        + (t**3 - 2 * t**2 + t) * (1.0 - knee)
        + (3 * t**2 - 2 * t**3) * top
    )
    return curve * peak
