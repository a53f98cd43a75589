"""A face model on the topology of another tracker, its labels transferred from ours by registration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vermilion.external.lip_loops import LipLoops, lip_loops
from vermilion.faces.contours import INNER_LOOP, OUTER_LOOP, edge_graph, enclosed, upper_side
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import Mesh, vertex_normals
from vermilion.landmarks.scheme import EYE_LEFT, EYE_RIGHT, LIP_INNER_OPEN, MOUTH, NOSE
from vermilion.scan.landmarks import ScanLandmarks
from vermilion.scan.personal import PersonalModel, personal_model
from vermilion.storage.errors import InputError

#: Vertices farther from the registered model have none of its labels, mm.
_REACH_MM = 5.0
#: A model that lies farther from the mesh, mean over the face, is not registered, mm.
_LOST_MM = 2.5
_LEAST_RIGID = 12
_HINT = (
    "Start the take at a neutral frame, see tracking.external (unit_mm, up, mesh), or give the landmarks "
    "by hand (tracking.external.base.landmarks)."
)


@dataclass(frozen=True)
class ExternalTopology:
    """What came of the registration.

    Attributes:
        model: on the other topology, without expressions and identities; its neutral is the mesh in the
            head frame of our model.
        made: our model laid over the mesh.
    """

    model: FaceModel
    made: PersonalModel


def label_topology(
    generic: FaceModel,
    neutral: Mesh,
    landmarks: ScanLandmarks,
    *,
    unit_mm: float | None = 1.0,
    least_opening: float = 0.0,
    **place: Any,
) -> ExternalTopology:
    """Lay our model over another tracker's neutral and transfer its labels.

    Args:
        generic: the tracker's model, with regions, contours, landmarks and expressions.
        neutral: V vertices, the tracker's own frame and unit.
        landmarks: on it.
        unit_mm: length of its unit; None: a standard one, or from the model.
        least_opening: see `personal_model`.
        place: subject, take, path of the neutral, for messages.

    Raises:
        InputError: the model cannot be laid over the mesh, or the mesh has no mouth.
    """
    try:
        made = personal_model(
            generic, neutral, landmarks, unit_mm=unit_mm, least_opening=least_opening
        )
    except InputError as error:
        raise unregistered(error.brief, **place) from error
    figures = made.figures()
    if figures["distance_mean_mm"] > _LOST_MM:
        away = figures["distance_mean_mm"]
        raise unregistered(f"a mesh that lies {away:.1f} mm from our face laid over it", **place)
    mesh = Mesh(made.scan.vertices_mm, neutral.triangles)
    try:
        loops = lip_loops(generic, made.registered, mesh)
    except ValueError as error:
        raise unregistered(f"a mesh without edges round the lips ({error})", **place) from error
    model = _labelled(generic, made.registered, mesh, loops)
    found = int(model.regions["rigid"].sum())
    if found < _LEAST_RIGID:
        raise unregistered(f"{found} vertices on the forehead, temples and nose", **place)
    return ExternalTopology(model, made)


def unregistered(found: str, **place: Any) -> InputError:
    """The one error of a topology that our model cannot be laid over."""
    expected = "the neutral face of a tracker's mesh that our face model can be laid over"
    return InputError(found, expected, _HINT, **place)


def _labelled(generic: FaceModel, registered: Mesh, mesh: Mesh, loops: LipLoops) -> FaceModel:
    """The labels of the registered model on the mesh (V vertices, the same frame)."""
    surface = Surface(registered.vertices_mm, registered.triangles)
    normals = vertex_normals(mesh.vertices_mm, mesh.triangles)
    near = surface.closest(mesh.vertices_mm, normals, 0.0)
    somewhere = surface.closest(mesh.vertices_mm)
    assert near.distance_mm is not None
    bound = near.bound & (near.distance_mm < _REACH_MM)

    def carried(mask: np.ndarray) -> np.ndarray:
        values = near.sample(mask[:, None].astype(float), registered.triangles)[:, 0]
        return bound & (np.nan_to_num(values) > 0.5)

    landmarks = _landmarks(generic, registered, mesh, loops, carried(generic.regions["face"]))
    regions = _mouth_regions(mesh, landmarks, loops)
    skin = ~(regions["mouth_inner"] | regions["teeth"] | regions["eyes"])
    lips = regions["vermilion_upper"] | regions["vermilion_lower"]
    regions["face"] = (carried(generic.regions["face"]) | lips) & skin
    regions["rigid"] = carried(generic.regions["rigid"]) & regions["face"] & ~lips
    n_vertices = len(mesh.vertices_mm)
    return FaceModel(
        name="external",
        neutral_mm=mesh.vertices_mm,
        triangles=mesh.triangles.astype(np.int32),
        expression_names=(),
        expressions_mm=np.zeros((0, n_vertices, 3), dtype=np.float32),
        identities_mm=np.zeros((0, n_vertices, 3), dtype=np.float32),
        uv=somewhere.sample(generic.uv.astype(float), registered.triangles).astype(np.float32),
        landmarks=landmarks,
        outer_contour=loops.outer,
        inner_contour=loops.inner,
        regions=regions,
    )


def _landmarks(
    generic: FaceModel, registered: Mesh, mesh: Mesh, loops: LipLoops, face: np.ndarray
) -> np.ndarray:
    """The nearest vertex of the mesh to each landmark (66,) int32; those of the lips on the contours."""
    allowed = dict.fromkeys(range(len(generic.landmarks)), face)
    outer, inner = (np.zeros(len(face), dtype=bool) for _ in range(2))
    outer[loops.outer], inner[loops.inner] = True, True
    for index in OUTER_LOOP:
        allowed[index] = outer
    for index in INNER_LOOP:
        upper = index in LIP_INNER_OPEN[:3]
        side = loops.upper if upper else loops.lower
        allowed[index] = inner & side if index in LIP_INNER_OPEN else outer & inner
    chosen, free = np.empty(len(generic.landmarks), dtype=np.int32), np.ones(len(face), dtype=bool)
    # The contours first: they have few vertices.
    for index in sorted(allowed, key=lambda index: index not in MOUTH):
        place = registered.vertices_mm[generic.landmarks[index]]
        distance = np.linalg.norm(mesh.vertices_mm - place, axis=1)
        usable = allowed[index] & free
        usable = usable if usable.any() else allowed[index]
        chosen[index] = int(np.where(usable, distance, np.inf).argmin())
        free[chosen[index]] = False
    return chosen


def _mouth_regions(mesh: Mesh, landmarks: np.ndarray, loops: LipLoops) -> dict[str, np.ndarray]:
    """The regions that the contours bound, and the parts that hang on no skin: eyes, teeth, tongue."""
    n_vertices, triangles = len(mesh.vertices_mm), mesh.triangles
    nose = int(landmarks[NOSE[0]])
    attached = enclosed(triangles, n_vertices, np.zeros(0, dtype=int), nose)
    outside_lips = enclosed(triangles, n_vertices, loops.outer, nose)
    before = enclosed(triangles, n_vertices, loops.inner, nose)
    lips = attached & ~outside_lips
    before[loops.inner] = True
    graph = edge_graph(mesh.vertices_mm, triangles)
    upper = upper_side(graph, loops.outer, loops.inner, landmarks)
    lids = mesh.vertices_mm[landmarks[np.concatenate([EYE_RIGHT, EYE_LEFT])]]
    mouth = mesh.vertices_mm[landmarks[MOUTH]]
    to_eyes, to_mouth = (
        np.linalg.norm(mesh.vertices_mm[:, None] - part.reshape(-1, 3)[None], axis=2).min(axis=1)
        for part in (lids, mouth)
    )
    used = np.zeros(n_vertices, dtype=bool)
    used[triangles] = True
    apart = used & ~attached
    return {
        "vermilion_upper": lips & before & upper,
        "vermilion_lower": lips & before & ~upper,
        "mouth_inner": attached & ~before,
        "teeth": apart & (to_mouth <= to_eyes),
        "eyes": apart & (to_eyes < to_mouth),
    }
