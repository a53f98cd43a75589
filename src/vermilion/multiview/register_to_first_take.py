"""One person, the same points of the skin in every take.

A template fitted to each take by itself slides along the surface: where landmarks differ, so do the
places that a vertex marks, by millimetres, and what is learnt from one take contradicts another. So
the neutral of a person's first take is the reference of all (Beeler et al. 2011, section 4, whose
reference frame serves several sequences), and the later ones' own fits only say where to begin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.geometry.alignment import similarity_alignment
from vermilion.multiview.neutral import Neutral, skin_of
from vermilion.multiview.take import Refiner
from vermilion.multiview.views import Frame


def register_to_first_take(
    first: Refiner, take: str, frame: Frame, own: Neutral
) -> tuple[Neutral, str]:
    """A later take's neutral on the points of the skin that the first take's vertices mark.

    Args:
        first: registers images to the neutral of the first take, `take`.
        frame: of the later take, with the expression of a neutral, cameras named as in the first.
        own: the template fitted to that frame; it says where the head is.

    Returns:
        (the neutral, why the own fit was kept or an empty text).
    """
    skin = skin_of(first.model).astype(np.float64)
    placed = similarity_alignment(first.neutral_mm, own.vertices_mm, skin, scale=1.0)
    start = placed.apply(first.neutral_mm)
    found = first.register(frame, start, from_afar=True)
    if not found.quality.valid:
        return own, found.quality.reason
    vertices = found.registered.vertices_mm
    moved = np.linalg.norm(vertices - own.vertices_mm, axis=1)
    return replace(own, vertices_mm=vertices, first_take=take, moved_mm=moved), ""
