"""EXR files of several layers: which channels are the image."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import OpenImageIO as oiio

from vermilion.storage.errors import RefusedInputError


@dataclass(frozen=True)
class ExrLayer:
    """Channels of an EXR file that belong together.

    Attributes:
        name: `beauty` of `beauty.R`; the name of the part in a multi-part file whose channels have
            none; empty for plain `R`, `G`, `B` of a file of one part.
        part: index of the part (subimage).
        channels: channel name without the layer -> index in the part, in the file's order.
    """

    name: str
    part: int
    channels: dict[str, int]

    @property
    def rgb(self) -> tuple[int, ...] | None:
        """Indices of red, green and blue, or of luminance alone; None where there are none."""
        by_name = {name.upper(): index for name, index in self.channels.items()}
        for names in (("R", "G", "B"), ("RED", "GREEN", "BLUE"), ("Y",)):
            if all(name in by_name for name in names):
                return tuple(by_name[name] for name in names)
        return None

    @property
    def indices(self) -> tuple[int, ...]:
        """Channels to read: the colours, else the first three of the layer."""
        return self.rgb or tuple(self.channels.values())[:3]


def layers_of(stream: oiio.ImageInput) -> list[ExrLayer]:
    """Layers of an open EXR file, in the file's order."""
    layers: dict[tuple[str, int], dict[str, int]] = {}
    part = 0
    while stream.seek_subimage(part, 0):
        spec = stream.spec()
        part_name = spec.get_string_attribute("oiio:subimagename") if part or _parts(spec) else ""
        for index, channel in enumerate(spec.channelnames):
            name, _, short = channel.rpartition(".")
            layers.setdefault((name or part_name, part), {})[short] = index
        part += 1
    stream.seek_subimage(0, 0)
    return [ExrLayer(name, part, channels) for (name, part), channels in layers.items()]


def _parts(spec: oiio.ImageSpec) -> bool:
    """Whether the file has several parts."""
    return spec.get_int_attribute("oiio:subimages", 1) > 1


def choose_layer(layers: list[ExrLayer], wanted: str, path: Path, **place) -> ExrLayer:
    """The layer that is the image.

    A file of one layer, or with plain R, G and B in its first part, is read as it is where no layer
    is wanted.

    Raises:
        RefusedInputError: several layers and none wanted, or none of that name. It lists the layers.
    """
    if len(layers) == 1 and (not wanted or not layers[0].name):
        return layers[0]
    for layer in layers:
        if layer.name == wanted and (wanted or (layer.part == 0 and layer.rgb)):
            return layer
    names = ", ".join(f"'{layer.name}'" for layer in layers if layer.name)
    found = f"an EXR of the layers {names or 'without names'}"
    raise RefusedInputError(
        f"{found}, and no layer '{wanted}'" if wanted else found,
        "the name of the layer that is the image, or plain channels R, G, B",
        "Set `capture.exr_layer` to one of them.",
        path=path,
        **place,
    )
