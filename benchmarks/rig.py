"""Weights of a rig for a corrected take: how far the lips are off, with and without the corrective.

Takes a finished run and one of its corrected takes. The rigs are ARKit's shapes, as `live_link` solves them,
and the track's own shapes; both are the face model's, not made for the person's corrected lips. Bars: the mean
over the vermilion at most 0.8 mm, and 0.3 mm with the one corrective shape.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.common import add_run_arguments
from benchmarks.finished_run import FinishedRun


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """A finished run and a take."""
    add_run_arguments(parser, truth=False)


def corrected_take(run: FinishedRun):
    """The corrected take as `apply_export` has it, on the tracker's mesh."""
    from vermilion.export.animation import Animation, HeadFrame, NamedShapes
    from vermilion.export.head_pose import corrected_pose
    from vermilion.geometry.polygons import Polygons
    from vermilion.storage.sequences import read_sequence

    face, fit = run.tracker_model(), run.fit()
    shapes = NamedShapes(face.expression_names, face.expressions_mm, fit.weights)
    head = HeadFrame(fit.world_from_head_rotation, fit.world_from_head_translation_mm)
    corrected = read_sequence(run.results / "apply" / run.take / "corrected.npy")
    take = Animation(
        fit.frames, 25.0, corrected, Polygons.of_triangles(face.triangles),
        run.identity().neutral_mm, head, shapes, 1.0,
    )  # fmt: skip
    return replace(take, head=corrected_pose(take, face.regions["rigid"]))


def run(arguments: argparse.Namespace) -> None:
    """Print a line a rig."""
    from vermilion.export.full_topology import shapes_on_coarse
    from vermilion.export.rig import solve_rig
    from vermilion.faces.model import FaceModel

    found = FinishedRun.of(arguments)
    take, face = corrected_take(found), found.tracker_model()
    lips = face.regions["vermilion_upper"] | face.regions["vermilion_lower"]
    studio = FaceModel.load(found.results / "face_model" / "studio.npz")
    print(
        f"{found.take}, {len(take.rows)} frames; mm over the vermilion, mean of all frames (worst frame)"
    )
    print("rig               shapes  used    rig alone    with the corrective")
    rigs = {"ARKit": shapes_on_coarse(studio, face)}
    if len(take.shapes.names) != len(rigs["ARKit"].names):
        rigs["the track's own"] = take.shapes
    for name, rig in rigs.items():
        solved = solve_rig(take, rig, lips)
        used = float((solved.alone > 0.01).sum(axis=1).mean())
        left, after = solved.left_mm, solved.corrected_mm
        print(
            f"{name:18} {len(rig.names):5} {used:5.1f} {left.mean():7.3f} ({np.max(left):.3f})"
            f" {after.mean():9.3f} ({np.max(after):.3f})"
        )
