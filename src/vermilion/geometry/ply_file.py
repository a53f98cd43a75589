"""PLY files, text and binary, with polygons of any number of corners, no reordering."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vermilion.geometry.polygons import Polygons

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """A table of the file: name, rows, properties (name, type of a list's count or none, type)."""

    name: str
    count: int
    properties: list[tuple[str, str | None, str]] = field(default_factory=list)

    @property
    def has_list(self) -> bool:
        return any(length is not None for _, length, _ in self.properties)


def read_ply(path: Path) -> tuple[np.ndarray, Polygons]:
    """Vertices (V, 3) and polygons of a file.

    Raises:
        ValueError: no PLY, or one that is damaged or has no vertices.
        OSError: no such file.
    """
    data = path.read_bytes()
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise ValueError("no PLY header")
    start = data.index(b"\n", end) + 1
    order, elements = _header(data[:end].decode("ascii", errors="replace").splitlines())
    if order is None:
        tables = _read_text(data[start:].decode("ascii", errors="replace").split(), elements)
    else:
        tables = _read_binary(data, start, elements, order)
    points = tables.get("vertex")
    if points is None or not all(axis in points for axis in "xyz"):
        raise ValueError("no vertices with x, y, z")
    vertices = np.stack([np.asarray(points[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    faces = tables.get("face", {})
    for name in _CORNERS:
        if name in faces:
            counts, corners = faces[name]
            return vertices, Polygons.of_corners(counts, corners, len(vertices))
    return vertices, Polygons(np.zeros(0, np.int32), np.zeros(0, np.int32))


def _header(lines: list[str]) -> tuple[str | None, list[_Element]]:
    """Byte order, None for text, and the elements."""
    order: str | None = None
    elements: list[_Element] = []
    for line in lines:
        words = line.split()
        if not words:
            continue
        if words[0] == "format" and words[1] != "ascii":
            order = _ORDERS[words[1]]
        elif words[0] == "element":
            elements.append(_Element(words[1], int(words[2])))
        elif words[0] == "property" and words[1] == "list":
            elements[-1].properties.append((words[4], _TYPES[words[2]], _TYPES[words[3]]))
        elif words[0] == "property":
            elements[-1].properties.append((words[2], None, _TYPES[words[1]]))
    return order, elements


def _read_text(words: list[str], elements: list[_Element]) -> dict[str, dict]:
    tables: dict[str, dict] = {}
    at = 0
    for element in elements:
        columns: dict[str, list] = {name: [] for name, _, _ in element.properties}
        for _ in range(element.count):
            for name, length, _ in element.properties:
                if length is None:
                    columns[name].append(float(words[at]))
                    at += 1
                else:
                    count = int(words[at])
                    columns[name].append(words[at + 1 : at + 1 + count])
                    at += 1 + count
        tables[element.name] = {
            name: np.array(columns[name]) if length is None else _joined(columns[name])
            for name, length, _ in element.properties
        }
    return tables


def _joined(rows: list) -> tuple[np.ndarray, np.ndarray]:
    """Counts and numbers of lists."""
    counts = np.array([len(row) for row in rows], dtype=np.int32)
    return counts, np.array([int(float(word)) for row in rows for word in row], dtype=np.int64)


def _read_binary(data: bytes, at: int, elements: list[_Element], order: str) -> dict[str, dict]:
    tables: dict[str, dict] = {}
    for element in elements:
        if not element.has_list:
            kind = np.dtype([(name, order + form) for name, _, form in element.properties])
            table = np.frombuffer(data, kind, element.count, at)
            tables[element.name] = {name: table[name] for name, _, _ in element.properties}
            at += kind.itemsize * element.count
            continue
        tables[element.name], at = _read_lists(data, at, element, order)
    return tables


def _read_lists(data: bytes, at: int, element: _Element, order: str) -> tuple[dict, int]:
    """A table with lists: at once where all rows have the first one's lengths, else row by row."""
    kinds: list[tuple] = []
    probe = at
    for name, length, form in element.properties:
        if length is None or element.count == 0:
            kinds.append((name, order + form))
            probe += np.dtype(form).itemsize
            continue
        count = int(np.frombuffer(data, order + length, 1, probe)[0])
        kinds += [(f"#{name}", order + length), (name, order + form, (count,))]
        probe += np.dtype(length).itemsize + count * np.dtype(form).itemsize
    kind = np.dtype(kinds)
    if len(data) - at >= kind.itemsize * element.count:
        table = np.frombuffer(data, kind, element.count, at)
        lists = [(name, length) for name, length, _ in element.properties if length is not None]
        if element.count and all((table[f"#{n}"] == table[n].shape[1]).all() for n, _ in lists):
            columns: dict = {
                name: table[name] for name, length, _ in element.properties if not length
            }
            for name, _ in lists:
                columns[name] = (table[f"#{name}"].astype(np.int32), table[name].reshape(-1))
            return columns, at + kind.itemsize * element.count
    return _row_by_row(data, at, element, order)


def _row_by_row(data: bytes, at: int, element: _Element, order: str) -> tuple[dict, int]:
    rows: dict[str, list] = {name: [] for name, _, _ in element.properties}
    for _ in range(element.count):
        for name, length, form in element.properties:
            count = 1
            if length is not None:
                count = int(np.frombuffer(data, order + length, 1, at)[0])
                at += np.dtype(length).itemsize
            rows[name].append(np.frombuffer(data, order + form, count, at))
            at += count * np.dtype(form).itemsize
    columns: dict = {}
    for name, length, _ in element.properties:
        joined = np.concatenate(rows[name]) if rows[name] else np.zeros(0)
        counts = np.array([len(row) for row in rows[name]], dtype=np.int32)
        columns[name] = joined if length is None else (counts, joined)
    return columns, at
