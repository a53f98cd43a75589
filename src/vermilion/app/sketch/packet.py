"""Arrays for the page in one answer: a JSON header, then the arrays' bytes.

Four bytes give the header's length; the header names each array with its type and shape, in the order
of the bytes that follow; all parts begin at multiples of four. `packet.js` reads it.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

_TYPES = {"float32": "<f4", "uint32": "<u4", "uint8": "u1"}


def pack(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """Bytes of a header and of `arrays` (...,), float32, uint32 or uint8."""
    listed = [
        {"name": name, "type": str(array.dtype), "shape": list(array.shape)}
        for name, array in arrays.items()
    ]
    head = json.dumps({**header, "arrays": listed}, allow_nan=False).encode()
    head += b" " * (-len(head) % 4)
    parts = [struct.pack("<I", len(head)), head]
    for array in arrays.values():
        data = np.ascontiguousarray(array).astype(_TYPES[str(array.dtype)]).tobytes()
        parts.append(data + bytes(-len(data) % 4))
    return b"".join(parts)
