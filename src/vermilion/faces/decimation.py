"""A coarser mesh of another topology that carries a face model's shapes by position."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vermilion.faces.contours import closed_loop, edge_graph, without_spurs
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.storage.errors import InputError

#: Weight of jawOpen at which the lips are so far apart that neither binds to the other.
APART = 0.5
#: Quadric weight of the lips against the rest of the face: how much denser they stay.
LIP_DENSITY = 12.0


def decimate_model(
    model: FaceModel, n_triangles: int, expressions: tuple[str, ...], open_shape: str = "jawOpen"
) -> FaceModel:
    """The model on a mesh of about `n_triangles`, with some of its expressions.

    The mesh is decimated (quadric edge collapse) with the mouth open, and bound to the original by
    nearest point in the same pose, so that upper lip never binds to lower lip. Vertices nearest to
    landmarks and lip contours are moved onto them.

    Raises InputError where an expression is not one of the model's.
    """
    missing = [name for name in (*expressions, open_shape) if name not in model.expression_names]
    if missing:
        raise InputError(
            f"expressions {missing}",
            f"some of {list(model.expression_names)}",
            "Correct the list of the tracker's expressions.",
        )
    opening = model.expressions_mm[model.expression_names.index(open_shape)]
    pose = model.neutral_mm + APART * opening
    vertices, triangles = _decimated(pose, model.triangles, _density(model), n_triangles)
    bound = Surface(pose, model.triangles).closest(vertices)
    corners, weights = bound.corners(model.triangles).astype(np.int64), bound.barycentric
    landmarks = _snap(vertices, pose, model.landmarks, corners, weights)
    outer = _contour(vertices, triangles, pose, model, "outer", landmarks, corners, weights)
    inner = _contour(vertices, triangles, pose, model, "inner", landmarks, corners, weights)
    picked = [model.expression_names.index(name) for name in expressions]

    def carry(values: np.ndarray) -> np.ndarray:
        return np.einsum("...vkc,vk->...vc", values[..., corners, :], weights)

    strongest = corners[np.arange(len(corners)), weights.argmax(axis=1)]
    return FaceModel(
        name=model.name,
        neutral_mm=carry(model.neutral_mm),
        triangles=triangles,
        expression_names=tuple(expressions),
        expressions_mm=np.stack([carry(model.expressions_mm[k]) for k in picked]).astype(
            np.float32
        ),
        identities_mm=_stacked(model.identities_mm, carry, len(vertices)),
        uv=carry(model.uv).astype(np.float32),
        landmarks=landmarks,
        outer_contour=outer,
        inner_contour=inner,
        regions={name: mask[strongest] for name, mask in model.regions.items()},
    )


def _stacked(shapes: np.ndarray, carry, n_vertices: int) -> np.ndarray:
    if len(shapes) == 0:
        return np.zeros((0, n_vertices, 3), dtype=np.float32)
    return np.stack([carry(shape) for shape in shapes]).astype(np.float32)


def _density(model: FaceModel) -> np.ndarray:
    """Weight of each vertex in the decimation, (V,): high at the lips, falling off to 1."""
    lips = model.neutral_mm[np.concatenate([model.outer_contour, model.inner_contour])]
    distance, _ = cKDTree(lips).query(model.neutral_mm)
    weight = 1.0 + (LIP_DENSITY - 1.0) * np.exp(-0.5 * (distance / 12.0) ** 2)
    inside = model.regions["mouth_inner"]
    return np.where(inside, np.minimum(weight, 0.3 * LIP_DENSITY), weight)


def _decimated(
    vertices: np.ndarray, triangles: np.ndarray, density: np.ndarray, n_triangles: int
) -> tuple[np.ndarray, np.ndarray]:
    import pymeshlab

    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(
        pymeshlab.Mesh(
            vertex_matrix=np.asarray(vertices, dtype=np.float64),
            face_matrix=np.asarray(triangles, dtype=np.int32),
            v_scalar_array=np.asarray(density, dtype=np.float64),
        )
    )
    # All parameters: what is left out has the value of the last call in this process.
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=int(n_triangles),
        targetperc=0.0,
        qualitythr=0.4,
        preserveboundary=True,
        boundaryweight=1.0,
        preservenormal=True,
        preservetopology=True,
        optimalplacement=True,
        planarquadric=True,
        planarweight=0.01,
        qualityweight=True,
        autoclean=True,
        selected=False,
    )
    mesh = meshes.current_mesh()
    return np.array(mesh.vertex_matrix()), np.array(mesh.face_matrix(), dtype=np.int32)


def _snap(
    vertices: np.ndarray,
    pose: np.ndarray,
    targets: np.ndarray,
    corners: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """Bind the vertex nearest to each target vertex of the original exactly to it, in place.

    Each target takes a vertex of its own. Returns the vertex of each target.
    """
    taken = np.zeros(len(vertices), dtype=bool)
    chosen = np.empty(len(targets), dtype=np.int32)
    for index, target in enumerate(targets):
        distance = np.linalg.norm(vertices - pose[target], axis=1)
        distance[taken] = np.inf
        vertex = int(np.argmin(distance))
        taken[vertex] = True
        chosen[index] = vertex
        corners[vertex], weights[vertex] = target, (1.0, 0.0, 0.0)
        vertices[vertex] = pose[target]
    return chosen


def _contour(
    vertices: np.ndarray,
    triangles: np.ndarray,
    pose: np.ndarray,
    model: FaceModel,
    which: str,
    landmarks: np.ndarray,
    corners: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """The model's contour as a loop of the coarse mesh, its vertices moved onto the contour."""
    loop = model.outer_contour if which == "outer" else model.inner_contour
    lines = np.stack([loop, np.roll(loop, -1)], axis=1)
    distance, _, _ = _nearest_on_lines(vertices, pose, lines)
    graph = edge_graph(vertices, triangles, cost=1.0 + (distance / 0.4) ** 2)
    # Every eighth of the original loop is a waypoint: the path cannot take the wrong lip.
    steps = np.linspace(0, len(loop), 12, endpoint=False).astype(int)
    near = [int(np.argmin(np.linalg.norm(vertices - pose[loop[i]], axis=1))) for i in steps]
    waypoints = np.array(list(dict.fromkeys(near)))
    coarse = without_spurs(closed_loop(graph, waypoints))
    movable = coarse[~np.isin(coarse, landmarks)]
    _, line, fraction = _nearest_on_lines(vertices[movable], pose, lines)
    corners[movable, 0], corners[movable, 1] = lines[line, 0], lines[line, 1]
    corners[movable, 2] = lines[line, 1]
    weights[movable] = np.stack([1 - fraction, fraction, np.zeros_like(fraction)], axis=1)
    vertices[movable] = (
        pose[lines[line, 0]] * (1 - fraction[:, None]) + pose[lines[line, 1]] * fraction[:, None]
    )
    return coarse.astype(np.int32)


def _nearest_on_lines(
    points: np.ndarray, positions: np.ndarray, lines: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance (N,), line (N,) and fraction along it (N,) of the nearest of the line segments."""
    start, along = positions[lines[:, 0]], positions[lines[:, 1]] - positions[lines[:, 0]]
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)
    offset = points[:, None] - start
    fraction = np.clip((offset * along).sum(axis=2) / length2, 0.0, 1.0)
    distance = np.linalg.norm(offset - fraction[..., None] * along, axis=2)
    line = distance.argmin(axis=1)
    rows = np.arange(len(points))
    return distance[rows, line], line, fraction[rows, line]
