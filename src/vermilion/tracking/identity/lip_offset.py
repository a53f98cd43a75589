"""The person's own mouth, which a tracker's few identities cannot show: the neutral moved to where the lips are seen.

Where landmarks draw lips as people have them, what they have in common over all frames, the landmark offsets,
is the person's. Left beside the mesh, the track's lips would lie beside the image's by as much. The offset d of
the vertices minimises

    1 / (2 noise^2) * sum over lip landmarks |d - offset|^2
    + 1 / (2 sigma^2 length^2) * integral of |d|^2 + length^4 |Laplacian d|^2

over the surface: a smooth random field of deviation `SIGMA_MM` that is correlated over `LENGTH_MM`.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vermilion.faces.model import FaceModel
from vermilion.geometry.sparse import CholeskyFactor, cotangent_laplacian
from vermilion.landmarks.scheme import MOUTH

LENGTH_MM, SIGMA_MM, NOISE_MM = 10.0, 2.0, 0.3


def lip_offset(
    model: FaceModel, neutral_mm: np.ndarray, landmark_offset_mm: np.ndarray
) -> np.ndarray:
    """Offset (V, 3) mm of the neutral, head frame, with which its lips lie where they are seen.

    Args:
        model: the tracker's.
        neutral_mm: (V, 3) of the person in it, head frame.
        landmark_offset_mm: (66, 3) mm, head frame: landmarks as detected minus the neutral's.
    """
    laplacian, mass = cotangent_laplacian(neutral_mm, model.triangles)
    areas = np.maximum(mass.diagonal(), 1e-3 * mass.diagonal().mean())
    bending = laplacian @ sparse.diags(1.0 / areas) @ laplacian
    prior = (sparse.diags(areas) + LENGTH_MM**4 * bending) / (SIGMA_MM * LENGTH_MM) ** 2
    vertices = model.landmarks[MOUTH]
    data = sparse.csr_matrix(
        (np.full(len(vertices), NOISE_MM**-2), (vertices, np.arange(len(vertices)))),
        shape=(len(neutral_mm), len(vertices)),
    )
    counts = np.asarray(data.sum(axis=1)).ravel()
    return CholeskyFactor(prior + sparse.diags(counts)).solve(data @ landmark_offset_mm[MOUTH])
