"""Hausdorff maps of propagated frames for rising numbers of corrected ones (Guided18 figures 10 and 12)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vermilion.evaluation.guided_study import PropagationStudy
from vermilion.geometry.alignment import align_frames
from vermilion.geometry.mesh import submesh
from vermilion.imaging.images import write_srgb8
from vermilion.report.mesh_sheets import error_bar, error_columns, render_sheet

_SIZE_PX, _MARGIN_MM, _SCALE_MM = 300, 30.0, 1.0
#: Shares of the frames that are less deformed than the frames shown.
_SHOWN = (0.5, 0.8, 0.97)


def surface_distance_mm(
    mesh_mm: np.ndarray, other_mm: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Distance (V,) of each vertex of `mesh_mm` (V, 3) from the surface `other_mm` (V, 3), by MeshLab.

    The largest is the one-sided Hausdorff distance. `triangles` (T, 3) of both.
    """
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    for vertices in (mesh_mm, other_mm):
        meshes.add_mesh(pymeshlab.Mesh(np.asarray(vertices, dtype=np.float64), triangles))
    meshes.compute_scalar_by_distance_from_another_mesh_per_vertex(
        measuremesh=0, refmesh=1, signeddist=False
    )
    return np.abs(meshes.mesh(0).vertex_scalar_array())


def shown_frames(study: PropagationStudy, trained: np.ndarray) -> np.ndarray:
    """Rows of frames to show, from a usual to an extreme mouth, none of them trained (k,)."""
    others = np.setdiff1d(np.arange(len(study.take_mm)), trained)
    order = others[np.argsort(study.size_mm[others], kind="stable")]
    return np.unique(order[[int(share * (len(order) - 1)) for share in _SHOWN]])


def draw_guided_sheet(
    study: PropagationStudy, counts: Sequence[int], stable: np.ndarray, out: str | Path
) -> dict[int, float]:
    """Truth and propagated lips for each number of suggested frames, coloured by their distance; PNG.

    Args:
        study: of the take.
        counts: numbers of corrected frames, rising.
        stable: (s,) vertices that hold the alignment.
        out: file.

    Returns:
        Number of corrected frames -> largest Hausdorff distance of the frames shown, mm.
    """
    neutral, regions = study.propagator.neutral_mm, study.regions
    chosen = {count: study.choose("suggested", count, 0) for count in counts}
    rows = shown_frames(study, np.concatenate(list(chosen.values())))
    weights = np.zeros(len(neutral))
    weights[stable] = 1.0
    true = study.take_mm[rows]
    motions = align_frames(true, neutral, weights)
    true = motions.apply(true)
    ids, triangles = submesh(
        regions.triangles, np.isin(np.arange(len(neutral)), regions.inner_vertices)
    )
    meshes, errors, largest = {"truth": true}, {"truth": np.full(true.shape[:2], np.nan)}, {}
    for count, frames in chosen.items():
        found = motions.apply(study.predicted(frames, rows))
        distance = np.full(true.shape[:2], np.nan)
        for index, (mesh, other) in enumerate(zip(found, true, strict=True)):
            distance[index, ids] = surface_distance_mm(mesh[ids], other[ids], triangles)
        largest[count] = float(np.nanmax(distance))
        name = f"k = {count}, {largest[count]:.2f} mm"
        meshes[name], errors[name] = found, distance
    outside = np.unique(regions.triangles[np.concatenate([regions.predicted, regions.trusted])])
    drawn = np.isin(regions.triangles, outside).all(axis=1)
    columns = error_columns(meshes, errors, regions.triangles[drawn], _SCALE_MM)
    centres = true[:, regions.free].mean(axis=1)
    width = np.ptp(neutral[regions.free, 0]) + 2 * _MARGIN_MM
    sheet = render_sheet(columns, rows.tolist(), centres, width, _SIZE_PX)
    write_srgb8(out, np.vstack([sheet, error_bar(sheet.shape[1], _SCALE_MM)]))
    return largest
