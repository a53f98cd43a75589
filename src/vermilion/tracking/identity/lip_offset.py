"""The person's own mouth, which a tracker's few identities cannot show: the neutral moved to where the lips are seen.

Where landmarks draw lips as people have them, what they have in common over all frames, the landmark offsets,
is the person's. Left beside the mesh, the track's lips would lie beside the image's by as much. The offset d of
the vertices minimises

    1 / (2 noise^2) * sum over lip landmarks |d - offset|^2
    + 1 / (2 sigma^2 length^2) * integral of |d|^2 + length^4 |Laplacian d|^2

over the surface: a smooth random field of deviation sigma that is correlated over the length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vermilion.faces.model import FaceModel
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.landmarks.scheme import MOUTH


@dataclass(frozen=True)
class OwnLips:
    """How far mouths differ from what the tracker's identities show.

    Attributes:
        range_mm: the length, over which neighbouring skin moves along.
        sigma_mm: deviation of the offset.
        noise_mm: deviation of a landmark's mean offset.
    """

    range_mm: float
    sigma_mm: float
    noise_mm: float


def lip_offset(
    model: FaceModel, neutral_mm: np.ndarray, landmark_offset_mm: np.ndarray, prior: OwnLips
) -> np.ndarray:
    """Offset (V, 3) mm of the neutral, head frame, with which its lips lie where they are seen.

    Args:
        model: the tracker's.
        neutral_mm: (V, 3) of the person in it, head frame.
        landmark_offset_mm: (66, 3) mm, head frame: landmarks as detected minus the neutral's.
        prior: how far mouths differ.
    """
    laplacian, mass = cotangent_laplacian(neutral_mm, model.triangles)
    areas = np.maximum(mass.diagonal(), 1e-3 * mass.diagonal().mean())
    bending = laplacian @ sparse.diags(1.0 / areas) @ laplacian
    stiffness = sparse.diags(areas) + prior.range_mm**4 * bending
    stiffness = stiffness / (prior.sigma_mm * prior.range_mm) ** 2
    vertices = model.landmarks[MOUTH]
    data = sparse.csr_matrix(
        (np.full(len(vertices), prior.noise_mm**-2), (vertices, np.arange(len(vertices)))),
        shape=(len(neutral_mm), len(vertices)),
    )
    counts = np.asarray(data.sum(axis=1)).ravel()
    return CholeskyFactor(stiffness + sparse.diags(counts)).solve(data @ landmark_offset_mm[MOUTH])
