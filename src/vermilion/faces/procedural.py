"""The embedded face model: a generated head that needs no file.

Three parts sample the same continuous head at different layouts (see `FaceModel`): they share no
vertex and no triangle, and the tracker's shapes know no rolling of the lips.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from vermilion.faces.model import REGIONS, FaceModel
from vermilion.faces.procedural_expressions import (
    JAW_MOTIONS,
    STUDIO_SHAPES,
    TRACKER_SHAPES,
    expressions,
)
from vermilion.faces.procedural_fields import Fields, jaw_motion
from vermilion.faces.procedural_head import EYE_CENTRE_MM
from vermilion.faces.procedural_head_mesh import HeadMesh, build_head_mesh
from vermilion.faces.procedural_identities import (
    IDENTITY_NAMES,
    asymmetry,
    identities,
    rigid_identities,
)
from vermilion.faces.procedural_landmarks import head_regions, landmarks
from vermilion.faces.procedural_layout import Layout, skin_sheet
from vermilion.faces.procedural_mouth import STOMION_Y_MM
from vermilion.faces.procedural_parts import Part, eyeball, tooth_row

TEETH_CENTRE_MM = np.array([0.0, STOMION_Y_MM, 84.0])


def studio_model(
    spacing_mm: float = 0.8, n_identities: int = len(IDENTITY_NAMES), seed: int | None = 0
) -> FaceModel:
    """The full head: skin, lips, mouth socket, teeth and eyeballs, all expressions.

    Args:
        spacing_mm: vertex spacing at the lips.
        n_identities: identity modes.
        seed: of the head's slight asymmetry; None for a symmetric head.
    """
    layout = Layout(
        spacing_mm, vermilion_rings=_rings(10.5, spacing_mm), fold_rings=_rings(6.5, spacing_mm),
        socket_rings=8,
    )  # fmt: skip
    mesh = build_head_mesh(layout)
    head = _head_model("procedural", mesh, STUDIO_SHAPES, True, n_identities)
    return _with_asymmetry(_with_parts(head), seed)


def template_model(
    slight_open: float = 0.09,
    spacing_mm: float = 1.0,
    n_identities: int = len(IDENTITY_NAMES),
) -> FaceModel:
    """Face skin with the lips' inner fold, mouth slightly open, no expressions: topology of H.

    Args:
        slight_open: weight of jawOpen in the neutral, [0, 1].
        spacing_mm: vertex spacing at the lips.
        n_identities: identity modes.
    """
    layout = Layout(
        spacing_mm, coarsening=1.25, vermilion_rings=_rings(10.5, spacing_mm),
        fold_rings=_rings(6.5, spacing_mm), offset=0.37,
    )  # fmt: skip
    mesh = build_head_mesh(layout)
    head = _head_model("procedural-template", mesh, ("jawOpen",), True, n_identities)
    opened = head.neutral_mm + slight_open * head.expressions_mm[0]
    return replace(
        head, neutral_mm=opened, expression_names=(), expressions_mm=head.expressions_mm[:0]
    )


def tracker_model(
    n_triangles: int = 6000, n_identities: int = len(IDENTITY_NAMES), *, few: bool = True
) -> FaceModel:
    """A coarse head: topology of C.

    Args:
        n_triangles: target count; met within some per cent.
        n_identities: identity modes.
        few: fewer expressions and no lip rolls; else all of the studio's.
    """
    layout = _tracker_layout(n_triangles)
    mesh = build_head_mesh(layout)
    return _head_model(
        "procedural-tracker", mesh, TRACKER_SHAPES if few else STUDIO_SHAPES, not few, n_identities
    )


def _rings(length_mm: float, spacing_mm: float) -> int:
    return max(2, round(length_mm / spacing_mm))


@cache
def _tracker_layout(n_triangles: int) -> Layout:
    """The layout whose mesh has about `n_triangles`: counts fall with the spacing squared."""
    make = partial(Layout, coarsening=1.0, fold_rings=2, offset=0.21, fold_end=1.5)
    spacing = 1.7 * np.sqrt(6000 / n_triangles)
    for _ in range(3):
        rings = _rings(9.0, spacing)
        layout = make(spacing_mm=float(spacing), vermilion_rings=rings)
        sheet = skin_sheet(layout)
        count = len(sheet.triangles) + 2 * layout.n_border * (rings + 2) + 12 * len(sheet.phase)
        spacing *= np.sqrt(count / n_triangles)
    return layout


def _head_model(
    name: str, mesh: HeadMesh, shapes: tuple[str, ...], rolls: bool, n_identities: int
) -> FaceModel:
    fields = Fields(mesh)
    return FaceModel(
        name=name,
        neutral_mm=mesh.point_mm,
        triangles=mesh.triangles,
        expression_names=shapes,
        expressions_mm=expressions(fields, shapes, rolls),
        identities_mm=identities(fields, n_identities).astype(np.float32),
        uv=mesh.uv.astype(np.float32),
        landmarks=landmarks(mesh),
        outer_contour=mesh.border.astype(np.int32),
        inner_contour=mesh.meeting.astype(np.int32),
        regions=head_regions(mesh),
    )


def _with_parts(head: FaceModel) -> FaceModel:
    """Add eyeballs and teeth."""
    n_identities = head.n_identities
    left = EYE_CENTRE_MM
    parts: list[tuple[Part, str, bool, np.ndarray]] = [
        (eyeball(1.0), "eyes", False, left),
        (eyeball(-1.0), "eyes", False, left * [-1, 1, 1]),
        (tooth_row(True), "teeth", False, TEETH_CENTRE_MM),
        (tooth_row(False), "teeth", True, TEETH_CENTRE_MM),
    ]
    points, triangles, uvs = [head.neutral_mm], [head.triangles], [head.uv]
    shapes, people = [head.expressions_mm], [head.identities_mm]
    regions = {name: [mask] for name, mask in head.regions.items()}
    total = head.n_vertices
    for part, region, on_jaw, centre in parts:
        n = len(part.point_mm)
        points.append(part.point_mm)
        triangles.append(part.triangles + total)
        uvs.append(part.uv)
        shapes.append(_part_expressions(part.point_mm, head.expression_names, on_jaw))
        shift = rigid_identities(centre, n_identities)
        people.append(np.broadcast_to(shift[:, None], (n_identities, n, 3)))
        for name in REGIONS:
            regions[name].append(np.full(n, name == region))
        total += n
    return replace(
        head,
        neutral_mm=np.concatenate(points),
        triangles=np.concatenate(triangles).astype(np.int32),
        uv=np.concatenate(uvs).astype(np.float32),
        expressions_mm=np.concatenate(shapes, axis=1).astype(np.float32),
        identities_mm=np.concatenate(people, axis=1).astype(np.float32),
        regions={name: np.concatenate(masks) for name, masks in regions.items()},
    )


def _part_expressions(point: np.ndarray, names: tuple[str, ...], on_jaw: bool) -> np.ndarray:
    result = np.zeros((len(names), len(point), 3))
    if on_jaw:
        for k, name in enumerate(names):
            if name in JAW_MOTIONS:
                result[k] = jaw_motion(point, *JAW_MOTIONS[name])
    return result


def _with_asymmetry(head: FaceModel, seed: int | None) -> FaceModel:
    if seed is None:
        return head
    rigid = head.regions["eyes"] | head.regions["teeth"]
    shift = asymmetry(head.neutral_mm, seed)
    # Rigid parts move as wholes, or eyeballs and teeth would be squeezed.
    for centre, ids in _rigid_parts(head, rigid):
        shift[ids] = asymmetry(centre[None], seed)
    return replace(head, neutral_mm=head.neutral_mm + shift)


def _rigid_parts(head: FaceModel, rigid: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    point = head.neutral_mm
    eyes = head.regions["eyes"]
    left, right = eyes & (point[:, 0] > 0), eyes & (point[:, 0] < 0)
    teeth = rigid & ~eyes
    centres = (EYE_CENTRE_MM, EYE_CENTRE_MM * [-1, 1, 1], TEETH_CENTRE_MM)
    return [(c, np.flatnonzero(m)) for c, m in zip(centres, (left, right, teeth), strict=True)]
