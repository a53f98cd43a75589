"""A regressor that has learnt nothing, on the same path as the others.

Its layers and displacements are zero whatever the features say. Told a neutral
(`with_known_neutrals`), it adds the same correction to every frame: the one that corrects that neutral.
What is left of a track's error after it is what a regressor has to learn; what it mends is owed to the
neutral and to the agreement with the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from vermilion.geometry.mesh import mesh_corners, topology_hash
from vermilion.regression.linear import LinearOutputs
from vermilion.regression.model import LipModel

NAME = "null"


class NullRegressor(LinearOutputs):
    """A bias of zero, and no weights."""

    def fit(
        self,
        features: np.ndarray,
        targets: np.ndarray,
        sequences: np.ndarray | None = None,
        persons: np.ndarray | None = None,
        n_layers: int | None = None,
    ) -> Self:
        """Keep the number of features and of targets; nothing else is used.

        Args:
            features: (F, M); targets: (F, K).
            sequences, persons: (F,) labels, not used.
            n_layers: not used.
        """
        n_features, n_outputs = features.shape[1], targets.shape[1]
        self.n_features_in_ = n_features
        self.feature_mean_, self.feature_scale_ = np.zeros(n_features), np.ones(n_features)
        self.feature_low_, self.feature_high_ = -np.ones(n_features), np.ones(n_features)
        self.mean_activation_, self.deviation_ = np.zeros(0), np.zeros((0, 0))
        self.coefficients_ = np.zeros((0, 0))
        self.basis_ = np.zeros((0, n_outputs), dtype=np.float32)
        self.bias_ = np.zeros(n_outputs, dtype=np.float32)
        self.person_biases_ = np.zeros((0, n_outputs), dtype=np.float32)
        return self

    def mixture(self, features: np.ndarray) -> np.ndarray:
        """(F, 0) coefficients of `features` (F, M): there is no basis."""
        return np.zeros((len(features), 0), dtype=np.float32)

    def novelty(self, features: np.ndarray) -> np.ndarray:
        """Zeros (F,) of `features` (F, M): nothing lies outside of no training."""
        return np.zeros(len(features))


def null_model(triangles: np.ndarray, mask: np.ndarray, feature_names: Sequence[str]) -> LipModel:
    """The null regressor of a mesh.

    Args:
        triangles: (T, 3) of the coarse mesh.
        mask: (M,) ids of the triangles of the correction layer.
        feature_names: of all features of a frame.
    """
    vertices = mesh_corners(triangles, mask)
    n_outputs = 9 * len(mask) + 3 * len(vertices)
    none = np.zeros((0, len(feature_names))), np.zeros((0, n_outputs))
    return LipModel(
        name=NAME,
        estimator=NullRegressor().fit(*none),
        feature_names=tuple(feature_names),
        feature_columns=np.arange(len(feature_names)),
        mask=np.asarray(mask),
        topology=topology_hash(triangles),
        training_frames={},
        vertices=vertices,
    )
