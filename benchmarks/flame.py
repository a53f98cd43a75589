"""FLAME's jaw and expression for corrected lips: what is left of them, speed and memory.

FLAME itself may not be passed on. Its stand-in has the embedded model's mesh (about as many vertices), a jaw with
the embedded model's `jawOpen` as its weights, and as expressions the principal components of random faces of its
shapes, then smooth noise at the mouth. The corrected take has another jaw and other expressions than the track, and
at the mouth six smooth fields that no expression shows, the first of which stands still (0.8 of 1 mm RMS).
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy import sparse

from benchmarks.common import peak_gb, timed

JAW_COLUMN, FACES = 6, 400
STRENGTHS = np.array([0.8, 0.5, 0.4, 0.3, 0.2, 0.2])  # mm RMS at the lips


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Frames and coefficients."""
    parser.add_argument("--frames", type=int, default=1500)
    parser.add_argument("--expressions", type=int, default=100, help="coefficients (%(default)s)")


def stand_in(face, n_expr: int):
    """The model."""
    from vermilion.external.flame_model import SHAPES, Flame

    rng, rest, count = np.random.default_rng(0), face.neutral_mm / 1000.0, face.n_vertices
    own = np.array([not name.startswith("jaw") for name in face.expression_names])
    drawn = rng.uniform(0, 1, (FACES, own.sum())) ** 3
    faces = np.tensordot(drawn, face.expressions_mm[own], axes=1).reshape(FACES, -1) / 1000.0
    _, sizes, modes = np.linalg.svd(faces - faces.mean(axis=0), full_matrices=False)
    shapes, told = np.zeros((count, 3, SHAPES + n_expr)), min(n_expr, int(own.sum()))
    scaled = modes[:told] * sizes[:told, None] / np.sqrt(FACES)
    shapes[..., SHAPES : SHAPES + told] = scaled.T.reshape(count, 3, told)
    for k in range(told, n_expr):
        wave = near_mouth(face, 0.001) * np.sin(rest @ rng.normal(0, 100, 3))
        shapes[..., SHAPES + k] = wave[:, None] * rng.normal(0, 1e-4, 3)
    opened = np.linalg.norm(face.expressions_mm[face.expression_names.index("jawOpen")], axis=1)
    jaw = np.clip(opened / np.percentile(opened, 98), 0, 1)
    weights = np.stack([0 * jaw, 1 - jaw, jaw, 0 * jaw, 0 * jaw], axis=1)
    joints = np.zeros((5, count))
    joints[:, np.linalg.norm(rest - [0, -0.02, -0.02], axis=1).argsort()[:20]] = 0.05
    return Flame(
        rest, face.triangles, shapes, np.zeros((count, 3, 36)), sparse.csr_matrix(joints), weights,
        np.array([0, 0, 1, 1, 1]),
    )  # fmt: skip


def near_mouth(face, width: float) -> np.ndarray:
    """(V,) 1 at the mouth, fading (m^2)."""
    away = (face.neutral_mm - face.neutral_mm[face.outer_contour].mean(axis=0)) / 1000.0
    return np.exp(-(away**2).sum(axis=1) / width)


def smooth_fields(face, count: int) -> np.ndarray:
    """Displacements (count, V, 3) at the mouth that no expression shows, mm RMS there."""
    from vermilion.geometry.mesh import adjacency

    graph = adjacency(face.triangles, face.n_vertices).astype(float)
    mean = sparse.diags(1 / np.asarray(graph.sum(axis=1)).ravel()) @ graph
    fields = np.random.default_rng(1).normal(size=(face.n_vertices, 3 * count))
    for _ in range(20):
        fields = mean @ fields
    fields *= near_mouth(face, 0.0004)[:, None] / fields.std(axis=0)
    return np.moveaxis(fields.reshape(-1, 3, count), 2, 0)


def takes(face, n_frames: int, n_expr: int):
    """The track's parameters, and the corrected meshes (F, V, 3) float32, metres."""
    from dataclasses import replace

    from vermilion.external.flame import FlameTake

    rng, time = np.random.default_rng(2), np.arange(n_frames)[:, None] / 25.0
    model, zeros = stand_in(face, n_expr), np.zeros((n_frames, 3))
    poses = np.zeros((n_frames, 15))
    poses[:, 1], poses[:, JAW_COLUMN] = (
        0.2 * np.sin(time[:, 0]),
        0.12 + 0.1 * np.sin(5 * time[:, 0]),
    )
    expr = np.sin(time * rng.uniform(2, 8, n_expr) + rng.uniform(0, 6, n_expr))
    expr[:, len(face.expression_names) :] = 0.0
    rest = np.zeros_like(model.template)
    track = FlameTake(
        model, np.arange(n_frames), np.zeros(0), expr, poses, zeros - [0, 0, 1.0], rest, rest,
        np.zeros(n_frames),
    )  # fmt: skip
    other = poses.copy()
    other[:, JAW_COLUMN] += 0.05
    true = replace(track, poses=other, expr=0.8 * expr + 0.3 * np.sin(3 * time) * (expr != 0))
    drive = STRENGTHS * np.sin(time * rng.uniform(2, 9, len(STRENGTHS)))
    drive[:, 0] = STRENGTHS[0]
    fields = smooth_fields(face, len(STRENGTHS)) / 1000.0
    meshes = np.empty((n_frames, *rest.shape), np.float32)
    for row in range(n_frames):
        meshes[row] = true.vertices(row) + np.tensordot(drive[row], fields, axes=1)
    return track, meshes


def run(arguments: argparse.Namespace) -> None:
    """Print what is left, mean over lips and frames (worst frame)."""
    from vermilion.export.animation import Animation, HeadFrame, NamedShapes
    from vermilion.export.flame import solve_flame
    from vermilion.faces import procedural
    from vermilion.geometry.polygons import Polygons

    count, face = arguments.frames, procedural.tracker_model(9700, 4)
    track, meshes = takes(face, count, arguments.expressions)
    head = HeadFrame(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))
    none = NamedShapes((), np.zeros((0, face.n_vertices, 3)), np.zeros((count, 0)))
    # In metres, which are the unit.
    take = Animation(
        track.frames, 25.0, meshes, Polygons.of_triangles(face.triangles), face.neutral_mm, head,
        none, 1.0,
    )  # fmt: skip
    lips = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
    base = [
        1000 * np.linalg.norm(track.vertices(row) - meshes[row], axis=1)[lips].mean()
        for row in range(count)
    ]
    before_gb = peak_gb()
    done = timed(
        lambda: solve_flame(take, track, lips, face.regions["face"], face.regions["rigid"])
    )
    found = done.result
    print(
        f"{count} frames, {face.n_vertices} vertices, {arguments.expressions} coefficients of expression: "
        f"{count / done.cpu_s:.0f} frames a core second, {peak_gb():.2f} GB ({before_gb:.2f} before)"
    )
    for name, off in {
        "the track": np.array(base), "jaw and expression alone": found.alone_mm,
        "with the static offset": found.offset_mm, "and the corrective": found.corrected_mm,
    }.items():  # fmt: skip
        print(f"{name:26} {off.mean():.3f} mm ({off.max():.3f})")
