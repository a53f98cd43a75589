"""All files of an exported animation, by format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from vermilion.export.alembic import write_alembic
from vermilion.export.animation import Animation
from vermilion.export.gltf import write_gltf
from vermilion.export.objs import write_objs, write_plys
from vermilion.export.shape_basis import ShapeBasis
from vermilion.export.usd import write_usd
from vermilion.export.usd_shapes import write_usd_shapes

#: Formats that are one file or folder, and need no blend shapes.
_PLAIN = {"usd": write_usd, "alembic": write_alembic, "obj": write_objs, "ply": write_plys}


def write_packages(
    outputs: Mapping[str, str | Path], animation: Animation, basis: Callable[[], ShapeBasis]
) -> None:
    """Write the formats of `outputs`: `usd`, `usd_shapes`, `gltf`, `alembic`, `obj`, `ply` -> path.

    `basis` gives the animation's blend shapes; it is called once, where a format has such. A
    texture that the animation names lies beside the files.
    """
    for name, write in _PLAIN.items():
        if name in outputs:
            write(outputs[name], animation)
    if "usd_shapes" in outputs or "gltf" in outputs:
        shapes = basis()
        print(f"{len(shapes.shapes.names)} blend shapes, {shapes.error_mm:.4f} mm off at most")
        if "usd_shapes" in outputs:
            write_usd_shapes(outputs["usd_shapes"], animation, shapes)
        if "gltf" in outputs:
            path = Path(outputs["gltf"])
            texture = None
            if animation.albedo is not None:
                texture = (path.parent / animation.albedo).read_bytes()
            write_gltf(path, animation, shapes, texture)
