"""Colours of video: matrix, range, transfer and primaries as tagged (ITU-T H.273)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import av
import cv2
import numpy as np

from vermilion.imaging.tone_mapping import DISPLAY_GAMMA, light_of, tone_map
from vermilion.storage.errors import RefusedInputError

#: Matrix codes of H.273 that swscale reads from the frame itself.
_TAGGED_MATRICES = {1: "BT.709", 4: "FCC", 5: "BT.601", 6: "BT.601", 7: "SMPTE 240M", 9: "BT.2020"}
_UNSPECIFIED = 2
#: swscale's numbers of the matrices that are used where none is tagged.
_BT709, _BT601, _BT2020 = 1, 5, 9
#: An image whose shorter side has at least these lines is of BT.709 where it says nothing.
HD_LINES = 720

#: Transfers whose code values a display shows alike, so that they are taken as they are.
_DISPLAY_TRANSFERS = (0, 1, 2, 4, 6, 7, 11, 12, 13, 14, 15)
_HDR_TRANSFERS = {16: "pq", 18: "hlg"}
_GAMMA_28 = 5
_REFUSED_TRANSFERS = {8: "linear", 9: "logarithmic", 10: "logarithmic", 17: "SMPTE ST 428"}
#: Primaries of standard definition differ from BT.709 by less than cameras do.
_NEAR_709 = (0, 1, 2, 5, 6, 7, 22)
#: Linear BT.709 from linear light of other primaries, white D65.
_TO_709 = {
    9: np.array(
        [
            [1.660491, -0.587641, -0.072850],
            [-0.124550, 1.132900, -0.008349],
            [-0.018151, -0.100579, 1.118730],
        ],
        dtype=np.float32,
    ),
    12: np.array(
        [[1.224940, -0.224940, 0.0], [-0.042057, 1.042057, 0.0], [-0.019638, -0.078636, 1.098274]],
        dtype=np.float32,
    ),
}
_CONVERT = (
    "Convert it to BT.709, for example with `ffmpeg -i {name} -vf "
    "zscale=transfer=bt709:matrix=bt709:primaries=bt709,format=yuv420p -crf 12 converted.mp4`."
)


@dataclass(frozen=True)
class VideoColour:
    """How the code values of a video become sRGB.

    Attributes:
        matrix: swscale's number of the matrix where the tag does not say it, else None.
        transfer: `display` (as they are), `gamma28`, `pq` or `hlg`.
        primaries: H.273 code of primaries that are converted to BT.709, else 1.
    """

    matrix: int | None = None
    transfer: str = "display"
    primaries: int = 1

    @property
    def is_plain(self) -> bool:
        """Whether the code values are sRGB as they come out of the matrix."""
        return self.transfer == "display" and self.primaries == 1

    @property
    def is_hdr(self) -> bool:
        return self.transfer in ("pq", "hlg")

    def light(self, frame: av.VideoFrame) -> np.ndarray:
        """Linear light (h, w, 3) float32, BT.709 primaries: nits for HDR, else relative to white."""
        codes = frame.to_ndarray(**self._format("rgb48le"))
        if self.is_hdr:
            light = light_of(codes, self.transfer)
        else:
            gamma = 2.8 if self.transfer == "gamma28" else DISPLAY_GAMMA
            light = (np.arange(65536, dtype=np.float32) / 65535.0) ** np.float32(gamma)
            light = light[codes]
        if self.primaries == 1:
            return light
        return cv2.transform(light, _TO_709[self.primaries])

    def srgb8(self, frame: av.VideoFrame, white_nits: float = 1.0, peak_nits: float = 1.0):
        """The frame as (h, w, 3) uint8 sRGB; white and peak of the clip for HDR."""
        if self.is_plain:
            return frame.to_ndarray(**self._format("rgb24"))
        display = tone_map(self.light(frame), white_nits, peak_nits)
        return np.rint(display * 255.0).astype(np.uint8)

    def _format(self, name: str) -> dict[str, Any]:
        """How PyAV is to convert a frame to a pixel format, by the matrix."""
        if self.matrix is None:
            return {"format": name}
        return {"format": name, "src_colorspace": self.matrix, "dst_colorspace": self.matrix}


def colour_of_frame(frame: av.VideoFrame, **place) -> VideoColour:
    """Colours of a decoded frame by its tags, and by its resolution where it has none.

    Raises RefusedInputError with `place` where a tag says what is not converted here.
    """
    transfer = _transfer(frame, place)
    entries: Iterable[Any] = frame.side_data  # the stub lists the keys
    dolby = any(entry.type.name.startswith("DOVI") for entry in entries)
    if dolby and transfer == "display" and int(frame.colorspace) == _UNSPECIFIED:
        raise _refused("Dolby Vision without a base layer that others show (profile 5)", place)
    primaries = int(frame.color_primaries)
    if primaries == _UNSPECIFIED and transfer in ("pq", "hlg"):
        primaries = 9
    if primaries not in _NEAR_709 and primaries not in _TO_709:
        raise _refused(f"colour primaries of code {primaries} (ITU-T H.273)", place)
    return VideoColour(
        _matrix(frame, transfer, place), transfer, primaries if primaries in _TO_709 else 1
    )


def _transfer(frame: av.VideoFrame, place: dict) -> str:
    code = int(frame.color_trc)
    if code in _HDR_TRANSFERS:
        return _HDR_TRANSFERS[code]
    if code == _GAMMA_28:
        return "gamma28"
    if code not in _DISPLAY_TRANSFERS:
        name = _REFUSED_TRANSFERS.get(code, f"code {code}")
        raise _refused(f"a transfer function that is not converted ({name})", place)
    return "display"


def _matrix(frame: av.VideoFrame, transfer: str, place: dict) -> int | None:
    code = int(frame.colorspace)
    if frame.format.is_rgb or len(frame.format.components) < 3 or code in _TAGGED_MATRICES:
        return None
    if code != _UNSPECIFIED:
        raise _refused(f"a colour matrix of code {code} (ITU-T H.273)", place)
    if transfer in ("pq", "hlg"):
        return _BT2020
    return _BT709 if min(frame.width, frame.height) >= HD_LINES else _BT601


def _refused(found: str, place: dict) -> RefusedInputError:
    name = getattr(place.get("path"), "name", "video.mp4")
    return RefusedInputError(
        f"{found}",
        "BT.601, BT.709, BT.2020 or Display P3 video of standard range, or PQ or HLG",
        _CONVERT.format(name=name),
        **place,
    )
