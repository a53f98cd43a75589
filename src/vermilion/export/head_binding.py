"""Our face model laid over the user's head, once a subject: what ties their topology to ours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.export.head_file import HeadFile
from vermilion.external.topology import label_topology
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.scan.landmarks import ScanLandmarks
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError

_EXPECTED = "a neutral head that our face model can be laid over"
_HINT = "Look at the overlay of the landmarks, and give them by hand (apply.export.head.landmarks)."


@dataclass(frozen=True)
class HeadBinding:
    """What came of the registration; all in the head frame, mm.

    Attributes:
        model: the labels of our face on the head's welded topology, Y vertices; its neutral is the head.
        registered_mm: (V, 3) our model's mesh laid over the head.
        weights: (K,) our model's weights of the expression that the head has.
        unit_mm: length of a unit of the file.
    """

    model: FaceModel
    registered_mm: np.ndarray
    weights: np.ndarray
    unit_mm: float

    def figures(self, triangles: np.ndarray) -> dict[str, float]:
        """Distances of the head's face from our mesh of `triangles` (T, 3), mm."""
        regions = self.model.regions
        lips = regions["vermilion_upper"] | regions["vermilion_lower"]
        away = Surface(self.registered_mm, triangles).closest(self.model.neutral_mm).distance_mm
        assert away is not None
        return {
            "unit_mm": self.unit_mm,
            "residual_mean_mm": float(away[regions["face"]].mean()),
            "residual_p95_mm": float(np.percentile(away[regions["face"]], 95)),
            "residual_lips_mm": float(away[lips].mean()),
        }

    def save(self, path: str | Path, model: str | Path) -> None:
        """Write the binding and its model, `.npz` both."""
        self.model.save(model)
        write_arrays(
            path, registered_mm=self.registered_mm, weights=self.weights,
            unit_mm=np.array(self.unit_mm),
        )  # fmt: skip

    @classmethod
    def load(cls, path: str | Path, model: str | Path) -> HeadBinding:
        """Read what `save` wrote."""
        found = read_arrays(path, "binding of a head", ("registered_mm", "weights", "unit_mm"))
        return cls(
            FaceModel.load(model), found["registered_mm"], found["weights"], float(found["unit_mm"])
        )


def is_ours(generic: FaceModel, head: HeadFile) -> bool:
    """Whether the head has our own vertices and triangles."""
    triangles = head.polygons.triangles
    return len(head.vertices) == generic.n_vertices and np.array_equal(triangles, generic.triangles)


def bind_head(
    generic: FaceModel,
    head: HeadFile,
    landmarks: ScanLandmarks,
    *,
    least_opening: float = 0.0,
    **place: Any,
) -> HeadBinding:
    """Lay our model over a head and transfer its labels.

    A head of our own topology is bound vertex to vertex, and taken to be neutral.

    Args:
        generic: the model of the sequences' topology.
        head: in any unit and frame.
        landmarks: on it, in the file's unit and frame.
        least_opening: see `scan.personal.personal_model`.
        place: subject and path, for messages.

    Raises:
        InputError: the model cannot be laid over the head, or the head has no mouth.
    """
    if is_ours(generic, head):
        return _bound_vertex_to_vertex(generic, head)
    try:
        found = label_topology(
            generic, head.welded, landmarks, unit_mm=None, least_opening=least_opening
        )
    except InputError as error:
        raise InputError(error.brief, _EXPECTED, _HINT, **place) from error
    made = found.made
    return HeadBinding(
        found.model, made.registered.vertices_mm, made.fit.weights, made.fit.head_from_scan.scale
    )


def _bound_vertex_to_vertex(generic: FaceModel, head: HeadFile) -> HeadBinding:
    from vermilion.geometry.alignment import similarity_alignment

    steady = generic.regions["rigid"] | generic.regions["face"]
    to_head = similarity_alignment(head.vertices[steady], generic.neutral_mm[steady])
    vertices = to_head.apply(head.vertices)
    model = replace(
        generic, neutral_mm=vertices, expression_names=(),
        expressions_mm=np.zeros((0, generic.n_vertices, 3), np.float32),
        identities_mm=np.zeros((0, generic.n_vertices, 3), np.float32),
    )  # fmt: skip
    return HeadBinding(model, vertices, np.zeros(generic.n_expressions), to_head.scale)
