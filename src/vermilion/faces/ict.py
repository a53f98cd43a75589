"""ICT-FaceKit (Li et al. 2020, MIT licence) as Vermilion's studio, template and tracker models.

ICT's head frame is ours: right-handed, x to the subject's left (landmark 0, at the subject's right
ear, has x < 0), y up, z out of the face; only centimetres become millimetres. Vertices 0-24590
(face, head and neck, sockets, gums and tongue, teeth, eyeballs) keep their numbers; lacrimal fluid,
eye occlusion and lashes are left out.

ICT has no lip material. The vermilion is bounded by its outer lip landmarks, joined along the
edges that keep to splines through them, and by where the lips meet (its inner lip landmarks,
joined likewise).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vermilion.faces.contours import (
    edge_graph,
    enclosed,
    geodesic_distance,
    smooth_loop,
    upper_side,
)
from vermilion.faces.decimation import decimate_model
from vermilion.faces.ict_archive import IctData
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import submesh

N_STUDIO = 24591
FACE = slice(0, 9409)
TEETH = slice(17039, 21451)
EYES = slice(21451, 24591)
MOUTH_SOCKET, GUMS = slice(11248, 13294), slice(14062, 17039)

#: Point of the 68-point scheme for each point of the 66-point scheme (DESIGN): the separate inner
#: corners 60 and 64 are dropped, the outer corners 48 and 54 become 58 and 62.
SIXTY_SIX = (*range(48), *range(49, 54), *range(55, 60), 48, 61, 62, 63, 54, 65, 66, 67)
OUTER_68 = tuple(range(48, 60))
INNER_68 = tuple(range(60, 68))

#: How far the red reaches past the line where the closed lips meet (mm along the surface).
VERMILION_INSIDE_MM = 1.5
#: How much of the inside of the lips the template keeps (mm along the surface).
TEMPLATE_INSIDE_MM = 9.0

#: ARKit shapes of a handicapped tracker: no rolls, presses, shrugs or funnel, no eye gaze.
FEW_EXPRESSIONS = (
    "browDown_L",
    "browDown_R",
    "browInnerUp_L",
    "browInnerUp_R",
    "browOuterUp_L",
    "browOuterUp_R",
    "cheekSquint_L",
    "cheekSquint_R",
    "eyeBlink_L",
    "eyeBlink_R",
    "eyeWide_L",
    "eyeWide_R",
    "jawForward",
    "jawLeft",
    "jawOpen",
    "jawRight",
    "mouthClose",
    "mouthFrown_L",
    "mouthFrown_R",
    "mouthLeft",
    "mouthLowerDown_L",
    "mouthLowerDown_R",
    "mouthPucker",
    "mouthRight",
    "mouthSmile_L",
    "mouthSmile_R",
    "mouthStretch_L",
    "mouthStretch_R",
    "mouthUpperUp_L",
    "mouthUpperUp_R",
    "noseSneer_L",
    "noseSneer_R",
)


def studio_model(data: IctData, n_identities: int = 100) -> FaceModel:
    """The whole head with all 53 expressions, in ICT's vertex order (24,591 vertices)."""
    kept = (data.polygons < N_STUDIO).all(axis=1)
    triangles = _triangulated(data.polygons[kept])
    vertices = data.neutral_mm[:N_STUDIO]
    skin = triangles[(triangles < GUMS.start).all(axis=1)]
    outer = smooth_loop(vertices, skin, data.landmarks68[list(OUTER_68)], left_corner=6)
    inner = smooth_loop(vertices, skin, data.landmarks68[list(INNER_68)], left_corner=4)
    landmarks = data.landmarks68[list(SIXTY_SIX)]
    return FaceModel(
        name="ict",
        neutral_mm=vertices,
        triangles=triangles,
        expression_names=data.expression_names,
        expressions_mm=data.expressions_mm[:, :N_STUDIO],
        identities_mm=data.identities_mm[:n_identities, :N_STUDIO],
        uv=_vertex_uv(data),
        landmarks=landmarks,
        outer_contour=outer,
        inner_contour=inner,
        regions=_regions(vertices, skin, landmarks, outer, inner),
    )


def template_model(data: IctData, slight_open: float = 0.09, n_identities: int = 50) -> FaceModel:
    """The face skin with the lips' inside, mouth slightly open, no expressions."""
    studio = studio_model(data, n_identities)
    return face_crop(studio, slight_open, with_expressions=False)


def tracker_model(
    data: IctData,
    n_triangles: int = 6000,
    slight_open: float = 0.09,
    n_identities: int = 40,
    expressions: tuple[str, ...] | None = None,
) -> FaceModel:
    """A coarser face of another topology, carried over by position; all expressions unless some are named."""
    crop = face_crop(studio_model(data, n_identities), slight_open, with_expressions=True)
    names = data.expression_names if expressions is None else expressions
    return decimate_model(crop, n_triangles, expressions=tuple(names))


def face_crop(studio: FaceModel, slight_open: float, with_expressions: bool) -> FaceModel:
    """The studio's face in front of the ears and the first millimetres inside the mouth."""
    inside = studio.regions["mouth_inner"] & (_depth_inside(studio) <= TEMPLATE_INSIDE_MM)
    keep = studio.regions["face"] | inside
    keep[GUMS.start :] = False
    ids, triangles = submesh(studio.triangles, keep)
    renumber = np.full(studio.n_vertices, -1, dtype=np.int32)
    renumber[ids] = np.arange(len(ids))
    opening = studio.expressions_mm[studio.expression_names.index("jawOpen")][ids]
    uv = studio.uv[ids] / FACE_TILE
    socket = ids >= FACE.stop  # no texture: collapsed onto the nearest vertex of the face
    uv[socket] = uv[~socket][
        _nearest(studio.neutral_mm[ids[~socket]], studio.neutral_mm[ids[socket]])
    ]
    return FaceModel(
        name="ict",
        neutral_mm=studio.neutral_mm[ids] + slight_open * opening,
        triangles=triangles,
        expression_names=studio.expression_names if with_expressions else (),
        expressions_mm=studio.expressions_mm[: None if with_expressions else 0, ids],
        identities_mm=studio.identities_mm[:, ids],
        uv=uv,
        landmarks=renumber[studio.landmarks],
        outer_contour=renumber[studio.outer_contour],
        inner_contour=renumber[studio.inner_contour],
        regions={name: mask[ids] for name, mask in studio.regions.items()},
    )


def _regions(
    vertices: np.ndarray,
    skin: np.ndarray,
    landmarks: np.ndarray,
    outer: np.ndarray,
    inner: np.ndarray,
) -> dict[str, np.ndarray]:
    n_vertices = len(vertices)
    graph = edge_graph(vertices, skin)
    socket = MOUTH_SOCKET.stop - 1
    lips_and_inside = enclosed(skin, n_vertices, outer, socket)
    lips_and_inside[outer] = True
    past_meeting = enclosed(skin, n_vertices, inner, socket)
    depth = geodesic_distance(graph, inner)
    vermilion = lips_and_inside & ~(past_meeting & (depth > VERMILION_INSIDE_MM))
    upper = upper_side(graph, outer, inner, landmarks)
    mouth_inner = past_meeting & ~vermilion
    mouth_inner[GUMS] = True
    index = np.arange(n_vertices)
    face = _face_front(vertices, landmarks) & (index < FACE.stop) & ~mouth_inner
    return {
        "face": face,
        "rigid": face & _rigid(vertices, landmarks),
        "vermilion_upper": vermilion & upper,
        "vermilion_lower": vermilion & ~upper,
        "mouth_inner": mouth_inner,
        "teeth": (index >= TEETH.start) & (index < TEETH.stop),
        "eyes": (index >= EYES.start) & (index < EYES.stop),
    }


def _face_front(vertices: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """Front of the ears, above the jaw's underside, below the hairline."""
    jaw, brows = vertices[landmarks[:17]], vertices[landmarks[17:27]]
    in_front = vertices[:, 2] > jaw[[0, 16], 2].mean() - 4.0
    under_jaw = (
        vertices[:, 1]
        > np.interp(np.abs(vertices[:, 0]), *_sorted_profile(np.abs(jaw[:, 0]), jaw[:, 1])) - 14.0
    )
    below_hair = vertices[:, 1] < brows[:, 1].max() + 45.0
    # Behind the chin the throat lies lower than the jawline but further back than the jaw's curve.
    throat = (
        vertices[:, 2]
        < np.interp(np.abs(vertices[:, 0]), *_sorted_profile(np.abs(jaw[:, 0]), jaw[:, 2])) - 22.0
    )
    below_jaw = vertices[:, 1] < np.interp(
        np.abs(vertices[:, 0]), *_sorted_profile(np.abs(jaw[:, 0]), jaw[:, 1])
    )
    return in_front & under_jaw & below_hair & ~(throat & below_jaw)


def _sorted_profile(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(x)
    return x[order], y[order]


def _rigid(vertices: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """Temples, upper forehead and nose bridge."""
    brows, eyes = vertices[landmarks[17:27]], vertices[landmarks[36:48]]
    bridge = vertices[landmarks[27:30]]
    forehead = vertices[:, 1] > brows[:, 1].max() + 18.0
    temple = (np.abs(vertices[:, 0]) > np.abs(eyes[:, 0]).max() + 14.0) & (
        vertices[:, 1] > eyes[:, 1].min()
    )
    nose = (np.abs(vertices[:, 0]) < 9.0) & (
        (vertices[:, 1] > bridge[:, 1].min() - 4.0) & (vertices[:, 1] < bridge[:, 1].max())
    )
    return forehead | temple | nose


def _depth_inside(studio: FaceModel) -> np.ndarray:
    skin = studio.triangles[(studio.triangles < GUMS.start).all(axis=1)]
    graph = edge_graph(studio.neutral_mm, skin)
    return geodesic_distance(graph, studio.inner_contour)


def _nearest(points: np.ndarray, queries: np.ndarray) -> np.ndarray:
    return cKDTree(points).query(queries)[1]


def _triangulated(polygons: np.ndarray) -> np.ndarray:
    """(T, 3) from quads whose fourth corner repeats the third where they are triangles."""
    first, second = polygons[:, [0, 1, 2]], polygons[:, [0, 2, 3]]
    both = np.stack([first, second], axis=1).reshape(-1, 3)
    return np.ascontiguousarray(both[both[:, 1] != both[:, 2]], dtype=np.int32)


#: Side of the face's square in the studio's UV atlas; the other materials share the margin.
FACE_TILE = 0.75
_TILES = (
    ("M_Teeth", 0.75, 0.00, 0.25),
    ("M_GumsTongue", 0.75, 0.25, 0.25),
    ("M_BackHead", 0.75, 0.50, 0.25),
    ("M_ScleraLeft", 0.00, 0.75, 0.25),
    ("M_ScleraRight", 0.25, 0.75, 0.25),
    ("M_IrisLeft", 0.50, 0.75, 0.25),
    ("M_IrisRight", 0.75, 0.75, 0.25),
    ("M_Face", 0.00, 0.00, FACE_TILE),  # last: it wins at vertices that it shares with the head
)


def _vertex_uv(data: IctData) -> np.ndarray:
    """One (u, v) per studio vertex, (24591, 2): each material in its own square of an atlas."""
    uv = np.zeros((N_STUDIO, 2), dtype=np.float32)
    for material, left, bottom, side in _TILES:
        polygons = data.materials == material
        inside = data.uv[data.polygon_uv[polygons]]
        inside = inside - np.floor(inside.min(axis=(0, 1)))
        uv[data.polygons[polygons]] = inside * side + [left, bottom]
    return uv
