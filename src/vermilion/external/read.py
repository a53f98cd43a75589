"""Reads the mesh sequence of another tracker, whatever its format; says what it understood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.external.alembic import read_alembic
from vermilion.external.folders import read_archive, read_folder
from vermilion.external.gltf import read_gltf
from vermilion.external.sequence import RawSequence, Request
from vermilion.external.usd import read_usd
from vermilion.geometry.polygons import Polygons
from vermilion.storage.errors import InputError

READERS = {
    ".npz": read_archive, ".abc": read_alembic, ".glb": read_gltf, ".gltf": read_gltf,
    ".usd": read_usd, ".usda": read_usd, ".usdc": read_usd, ".usdz": read_usd,
}  # fmt: skip
NAMES = {".npz": ".npz", ".abc": "Alembic", ".glb": "glTF", ".gltf": "glTF"} | dict.fromkeys(
    (".usd", ".usda", ".usdc", ".usdz"), "USD"
)
#: Units that programs have: name -> millimetres.
UNITS_MM = {"millimetres": 1.0, "centimetres": 10.0, "decimetres": 100.0, "metres": 1000.0}
#: Longest side of a face or head in any pose, mm: from a mask to head, neck and shoulders.
_SIZE_MM = (110.0, 700.0)
_USUAL_MM = 240.0


@dataclass(frozen=True)
class MeshSequence:
    """Meshes of one topology.

    Attributes:
        frames: (F,) int numbers.
        vertices_mm: (F, V, 3) float32, world; NaN for a frame that is lost.
        polygons: as the file has them.
        unit_mm: length of the file's unit.
        lost: frame -> why it is lost.
        understood: what was understood and guessed of the file, sentences.
        up: axis of the file that points up, as configured, else as the file says, else y.
        turned: whether the sequence was turned from z up to y up.
    """

    frames: np.ndarray
    vertices_mm: np.ndarray
    polygons: Polygons
    unit_mm: float
    lost: dict[int, str] = field(default_factory=dict)
    understood: tuple[str, ...] = ()
    up: str = "y"
    turned: bool = False

    @property
    def triangles(self) -> np.ndarray:
        """Triangles (T, 3) int32 of the polygons."""
        return self.polygons.triangles


def read_tracked(
    source: str | Path,
    frames: Sequence[int],
    unit_mm: float | None = None,
    *,
    fps: float | None = None,
    mesh: str | None = None,
    up: str | None = None,
    flame: str | Path | None = None,
    **place: Any,
) -> MeshSequence:
    """Read some frames of a mesh sequence.

    Args:
        source: folder of numbered `.obj`, `.ply` or `.stl`; `.npz` with `vertices_mm` (F, V, 3),
            `triangles` (T, 3) and optionally `frames` (F,), else counted from 0; USD; Alembic; glTF;
            `.npz` with parameters of FLAME, or a folder with one a frame.
        frames: numbers of the frames to read.
        unit_mm: length of the file's unit, mm; None: that which the file names, else a guess from
            the mesh's size.
        fps: rate, for files that count seconds; None: the file's own.
        mesh: path or name of the mesh where the file has several.
        up: axis of the file that is up, `y` or `z`: a sequence with z up is turned to y up. None: it
            is left as it is.
        flame: the user's FLAME model (`.npz`), for sequences of its parameters.
        place: subject and take, for error messages.

    Raises:
        InputError: no frame can be read, topologies differ, or the file has none of these forms.
    """
    source = Path(source)
    request = Request(
        source, [int(frame) for frame in frames], fps, mesh, place, Path(flame) if flame else None
    )
    if source.is_dir():
        raw = _checked(read_folder(request), request)
    elif source.suffix.lower() in READERS and source.is_file():
        raw = _checked(_read(request), request)
    else:
        raise request.error(
            "no mesh sequence" if source.exists() else "no such file or folder",
            "a folder of .obj, .ply or .stl, an .npz, USD, Alembic (.abc) or glTF (.glb) file",
            "Correct the `source` of the take sheet.",
        )
    unit, named = (unit_mm, f"unit {unit_mm:g} mm, as configured") if unit_mm else _unit(raw)
    vertices = raw.vertices * unit
    if up == "z":
        vertices = vertices[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    axis = f"up axis {up}, as configured" if up else _up(raw)
    understood = (*raw.facts, *_shape(raw), named, axis)
    return MeshSequence(
        raw.frames, vertices.astype(np.float32), raw.polygons, unit, raw.lost, understood,
        up or raw.up or "y", up == "z",
    )  # fmt: skip


def _read(request: Request) -> RawSequence:
    """What a file holds. Whatever its reader trips over is a fault of the file."""
    suffix = request.path.suffix.lower()
    try:
        return READERS[suffix](request)
    except InputError:
        raise
    except Exception as error:  # libraries of these formats raise kinds of their own
        raise request.error(
            f"an unreadable {NAMES[suffix]} file ({type(error).__name__}: {error!s:.200})",
            "a whole file with one mesh",
            "Export it again.",
        ) from error


def _checked(raw: RawSequence, request: Request) -> RawSequence:
    """The sequence, whose frames with vertices that are not finite are lost.

    Raises InputError where its polygons are none of its vertices, or no frame is left.
    """
    try:
        Polygons.of_corners(raw.polygons.counts, raw.polygons.corners, raw.vertices.shape[1])
    except ValueError as error:
        raise request.error(
            f"{error}", "faces of the mesh's vertices", "Export it again."
        ) from error
    finite = np.isfinite(raw.vertices).all(axis=(1, 2))
    lost = {
        int(frame): "vertices that are not finite"
        for frame, good in zip(raw.frames, finite, strict=True)
        if not good
    }
    lost |= raw.lost
    if len(lost) == len(raw.frames):
        first = int(raw.frames[0])
        raise request.error(
            f"no frame that can be used (frame {first}: {lost[first]})",
            "finite vertices",
            "Export it again.",
        )
    return replace(raw, lost=lost)


def _extent(raw: RawSequence) -> np.ndarray:
    """Sides (3,) of the mesh's box, the median over the frames, in the file's unit."""
    known = raw.vertices[np.isfinite(raw.vertices).all(axis=(1, 2))]
    return np.median(known.max(axis=1) - known.min(axis=1), axis=0) if len(known) else np.zeros(3)


def _unit(raw: RawSequence) -> tuple[float, str]:
    """Length of the unit (mm) and how it is known: the file's where a head can have it."""
    size = float(_extent(raw).max())
    low, high = _SIZE_MM
    if size <= 0:
        return raw.unit_mm or 1.0, "unit unknown: the mesh has no size; taken as millimetres"
    if raw.unit_mm is not None and low <= size * raw.unit_mm <= high:
        return raw.unit_mm, f"unit {raw.unit_mm:g} mm, as the file says"
    name = min(UNITS_MM, key=lambda unit: abs(np.log(size * UNITS_MM[unit] / _USUAL_MM)))
    value = UNITS_MM[name]
    plausible = low <= size * value <= high
    why = f"the mesh is {size:.4g} units long"
    if raw.unit_mm is not None:
        why += f", which is no head in the {raw.unit_mm:g} mm that the file says"
        return (
            (raw.unit_mm, f"unit {raw.unit_mm:g} mm, as the file says, though {why}")
            if not plausible
            else (value, f"unit guessed: {name}, since {why}")
        )
    if not plausible:
        return 1.0, f"unit unknown, taken as millimetres: {why}; set tracking.external.unit_mm"
    return value, f"unit guessed: {name}, since {why}"


def _up(raw: RawSequence) -> str:
    """What is known of the up axis: from the file, else from the box's sides."""
    if raw.up is not None:
        return f"up axis {raw.up}, as the file says"
    sides = _extent(raw)
    axis = "xyz"[int(np.argmax(sides))]
    return f"up axis guessed: {axis}, along which the mesh is longest; it is not turned"


def _shape(raw: RawSequence) -> tuple[str, ...]:
    counts = np.bincount(raw.polygons.counts)
    kinds = {3: "triangles", 4: "quads"}
    parts = [f"{n} {kinds.get(k, f'polygons of {k}')}" for k, n in enumerate(counts) if n]
    lost = f", {len(raw.lost)} frames lost" if raw.lost else ""
    return (f"{raw.vertices.shape[1]} vertices, {', '.join(parts)}{lost}",)
