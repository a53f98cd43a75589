"""The linear face model that every stage shares.

A model plays one of three parts; each adapter (`procedural`, `ict`) builds all three:

- *studio*: full resolution, all shapes, eyes and teeth; renders synthetic captures;
- *template*: face skin with the lips' inner fold, mouth slightly open, no expressions; its topology
  is that of **H**;
- *tracker*: another, coarser topology, fewer expressions and no lip rolls; its topology is that of
  **C**.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import ModelFileError

FORMAT_VERSION = 1

#: Regions that every model names (boolean per vertex). A model without teeth has them all False.
REGIONS = (
    "face",  # skin of the face in front of the ears, lips included, down to the chin's underside
    "rigid",  # hardly moves with expression: forehead, temples, nose bridge; for rigid alignment
    "vermilion_upper",  # red of the upper lip, up to where it turns into the mouth
    "vermilion_lower",
    "mouth_inner",  # the inside of the lips and the mouth socket
    "teeth",
    "eyes",
)


@dataclass(frozen=True)
class FaceModel:
    """A face as neutral + identities + expressions, all linear.

    Head frame: millimetres, x to the subject's left, y up, z out of the face; origin inside the
    head. (The same handedness as ICT-FaceKit.)

    Attributes:
        name: which model, for messages and file attributes.
        neutral_mm: (V, 3) float64.
        triangles: (T, 3) int32, counter-clockwise seen from outside.
        expression_names: K names, ARKit names with `_L`, `_R` where the model has such.
        expressions_mm: (K, V, 3) float32 displacements at weight 1; weights lie in [0, 1].
        identities_mm: (I, V, 3) float32 displacements at one standard deviation.
        uv: (V, 2) float32 in [0, 1], one per vertex (vertices at seams are duplicated or lie where
            no texture is needed); v up.
        regions: name -> (V,) bool, the names of `REGIONS`.
        landmarks: (66,) int32 vertex of each landmark (DESIGN's 66-point scheme).
        outer_contour: (n,) int32 closed loop of vertices along the vermilion border.
        inner_contour: (m,) int32 closed loop where the lips meet at the neutral.
    """

    name: str
    neutral_mm: np.ndarray
    triangles: np.ndarray
    expression_names: tuple[str, ...]
    expressions_mm: np.ndarray
    identities_mm: np.ndarray
    uv: np.ndarray
    landmarks: np.ndarray
    outer_contour: np.ndarray
    inner_contour: np.ndarray
    regions: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def n_vertices(self) -> int:
        return len(self.neutral_mm)

    @property
    def n_expressions(self) -> int:
        return len(self.expressions_mm)

    @property
    def n_identities(self) -> int:
        return len(self.identities_mm)

    def neutral_of(self, identity: np.ndarray | None = None) -> np.ndarray:
        """Neutral of one person, (V, 3) mm; `identity` (I,) in standard deviations."""
        if identity is None or len(identity) == 0:
            return self.neutral_mm.copy()
        identity = np.asarray(identity, dtype=np.float64)
        return self.neutral_mm + np.tensordot(
            identity, self.identities_mm[: len(identity)].astype(np.float64), axes=1
        )

    def vertices(self, identity: np.ndarray | None, weights: np.ndarray) -> np.ndarray:
        """Mesh of expression weights, mm.

        `identity` (I,) coefficients, None: the mean. `weights` (K,) -> (V, 3), (F, K) -> (F, V, 3).
        """
        weights = np.asarray(weights, dtype=np.float64)
        offsets = np.tensordot(weights, self.expressions_mm.astype(np.float64), axes=(-1, 0))
        return self.neutral_of(identity) + offsets

    def save(self, path: str | Path) -> None:
        """Write `.npz` (no pickle), whole or not at all."""
        regions = np.stack([self.regions[name] for name in REGIONS]).astype(bool)
        write_arrays(
            path,
            compressed=True,
            format_version=FORMAT_VERSION,
            name=self.name,
            neutral_mm=self.neutral_mm.astype(np.float64),
            triangles=self.triangles.astype(np.int32),
            expression_names=np.array(self.expression_names, dtype=str),
            expressions_mm=self.expressions_mm.astype(np.float32),
            identities_mm=self.identities_mm.astype(np.float32),
            uv=self.uv.astype(np.float32),
            landmarks=self.landmarks.astype(np.int32),
            outer_contour=self.outer_contour.astype(np.int32),
            inner_contour=self.inner_contour.astype(np.int32),
            regions=regions,
        )

    @classmethod
    def load(cls, path: str | Path) -> FaceModel:
        """Read what `save` wrote. Raises ModelFileError on a newer or damaged file."""
        arrays = read_arrays(path, "face model", error=ModelFileError, version=FORMAT_VERSION)
        return cls(
            name=str(arrays["name"]),
            neutral_mm=arrays["neutral_mm"],
            triangles=arrays["triangles"],
            expression_names=tuple(str(n) for n in arrays["expression_names"]),
            expressions_mm=arrays["expressions_mm"],
            identities_mm=arrays["identities_mm"],
            uv=arrays["uv"],
            landmarks=arrays["landmarks"],
            outer_contour=arrays["outer_contour"],
            inner_contour=arrays["inner_contour"],
            regions=dict(zip(REGIONS, arrays["regions"], strict=True)),
        )
