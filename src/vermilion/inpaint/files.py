"""Textures of the lips on disc: EXR with their seen weight and, for a take, what is painted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vermilion.imaging.images import read_channels, write_channels
from vermilion.inpaint.bake import Texture
from vermilion.inpaint.domain import LipDomain
from vermilion.storage.errors import InputError


def write_texture(
    path: str | Path, texture: Texture, more: dict[str, np.ndarray] | None = None
) -> None:
    """Write R, G, B (linear), `weight`, and `more` channels, all (h, w), as half EXR."""
    channels = {name: texture.rgb[..., i] for i, name in enumerate("RGB")}
    write_channels(path, {**channels, "weight": texture.weight, **(more or {})})


def read_texture(
    path: str | Path, domain: LipDomain, **place
) -> tuple[Texture, dict[str, np.ndarray]]:
    """Read what `write_texture` wrote: the texture and the other channels, each (h, w).

    Raises InputError where it does not belong to the domain.
    """
    channels = read_channels(path, **place)
    missing = {"R", "G", "B", "weight"} - set(channels)
    shape = next(iter(channels.values())).shape
    if missing or shape != domain.shape:
        raise InputError(
            f"a texture of {shape[1]}x{shape[0]} with channels {sorted(channels)}",
            f"{domain.shape[1]}x{domain.shape[0]} with R, G, B, weight",
            "It was made for another template or texel size: remove it and run again.",
            path=path,
            **place,
        )
    rgb = np.stack([channels.pop(name) for name in "RGB"], axis=-1)
    return Texture(np.ascontiguousarray(rgb), channels.pop("weight")), channels
