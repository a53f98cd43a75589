"""Speed and memory of the files for other programs: a minute of video in every format.

Each format is written by a process of its own from a sequence on disk, on the tracker's mesh, on the
full face or on a head of another topology. Frames are counted per core second; the memory is the largest resident set, which the
interpreter and its libraries are part of. `off mm` is the farthest vertex of frames that are read again as a
`tracked` take.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

FILES = {
    "usd": "a.usdc", "usd_shapes": "shapes.usdc", "gltf": "a.glb", "alembic": "a.abc",
    "obj": "obj", "ply": "ply",
}  # fmt: skip
TARGET_FPS, TARGET_MB = 30.0, 1000.0
#: Frames that are read again, evenly over the take.
READ_BACK = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Frames, meshes and formats."""
    parser.add_argument("--frames", type=int, default=1500)
    parser.add_argument("--topology", choices=("tracker", "full", "head"), default="tracker")
    parser.add_argument("--formats", nargs="*", default=list(FILES), choices=list(FILES))
    parser.add_argument("--write", help=argparse.SUPPRESS)


def take(folder: Path, frames: int):
    """A take of the embedded model on disk; and the model."""
    from scipy.spatial.transform import Rotation

    from vermilion.export.animation import Animation, HeadFrame, NamedShapes
    from vermilion.faces import procedural
    from vermilion.geometry.camera import pinhole
    from vermilion.geometry.polygons import Polygons
    from vermilion.storage.sequences import StreamedSequence, write_frames

    model, rng = procedural.tracker_model(6000, 4), np.random.default_rng(0)
    time_s = np.arange(frames) / 25.0
    speeds = rng.uniform(1.0, 5.0, model.n_expressions)
    weights = 0.3 + 0.3 * np.sin(time_s[:, None] * speeds)
    turn = Rotation.from_euler("y", 10 * np.sin(time_s)[:, None], degrees=True).as_matrix()
    head = HeadFrame(turn, np.tile([0.0, 0.0, 600.0], (frames, 1)))
    lips = model.neutral_mm[model.outer_contour].mean(axis=0)
    near = np.exp(-((model.neutral_mm - lips) ** 2).sum(axis=1) / 400)
    # Corrections of 40 independent kinds, and jitter that no blend shape should follow.
    kinds = near[None, :, None] * rng.normal(0, 1.0, (40, model.n_vertices, 3))
    drive = np.sin(time_s[:, None] * rng.uniform(2, 9, 40))
    path = folder / "vertices_mm.npy"
    if not path.exists():

        def world(row: int) -> np.ndarray:
            local = model.vertices(None, weights[row]) + np.tensordot(drive[row], kinds, axes=1) / 6
            return head.to_world(row, local)

        write_frames(path, (frames, model.n_vertices, 3), map(world, range(frames)))
    shapes = NamedShapes(model.expression_names, model.expressions_mm, weights)
    coarse = Animation(
        np.arange(frames), 25.0, StreamedSequence(path),
        Polygons.of_triangles(model.triangles), model.neutral_mm, head, shapes, 1.0, model.uv,
        pinhole("cam", 1500.0, 640, 480),
    )  # fmt: skip
    return coarse, model


def other_mesh(topology: str, coarse, model):
    """What puts the take on the full face or on a head of another topology."""
    from benchmarks.own_head import studio_head
    from vermilion.export.full_topology import FullFace
    from vermilion.export.head_binding import bind_head
    from vermilion.export.head_transfer import HeadTransfer
    from vermilion.faces import procedural

    studio = procedural.studio_model()
    if topology == "full":
        return FullFace.of(studio, model, coarse.neutral_mm, np.zeros(0), coarse.shapes)
    head, landmarks = studio_head(studio, np.zeros(0))
    binding = bind_head(model, head, landmarks)
    return HeadTransfer(head, binding, model, coarse.neutral_mm, coarse.shapes)


def write_one(folder: Path, kind: str, arguments: argparse.Namespace) -> dict[str, float]:
    """Write one format; core seconds, wall seconds and memory of it."""
    from vermilion.export.packages import write_packages
    from vermilion.export.shape_basis import shape_basis
    from vermilion.external.read import read_tracked
    from vermilion.storage.sequences import StreamedSequence, write_frames

    coarse, model = take(folder, arguments.frames)
    on_other = arguments.topology != "tracker"
    other = other_mesh(arguments.topology, coarse, model) if on_other else None
    before_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    start, wall = time.process_time(), time.perf_counter()
    animation = coarse
    if other is not None:
        table = folder / "other.npy"
        shape = (arguments.frames, len(other.neutral_mm), 3)
        rows = range(arguments.frames)
        write_frames(table, shape, (other.vertices_mm(coarse, row) for row in rows))
        animation = other.animation(coarse, StreamedSequence(table))

    def basis():
        if arguments.topology == "full":
            return other.basis(shape_basis(coarse, 0.02, folder))
        return shape_basis(animation, 0.02, folder)

    out = folder / kind
    out.mkdir()
    write_packages({kind: out / FILES[kind]}, animation, basis)
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    figures = {
        "core_s": time.process_time() - start,
        "wall_s": time.perf_counter() - wall,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "before_mb": before_mb,
        "file_mb": size / 1e6,
    }
    rows = np.unique(np.linspace(0, arguments.frames - 1, READ_BACK).astype(int))
    back = read_tracked(out / FILES[kind], animation.frames[rows], fps=animation.fps)
    # A world whose y points down (that of this camera) is turned upright in files of scenes.
    turn = np.ones(3) if kind in ("obj", "ply") else np.array([1.0, -1.0, -1.0])
    away = [back.vertices_mm[k] - turn * animation.vertices_mm[row] for k, row in enumerate(rows)]
    return figures | {"off_mm": float(np.linalg.norm(away, axis=2).max())}


def run(arguments: argparse.Namespace) -> None:
    """Print a line a format."""
    if arguments.write:
        folder, kind = arguments.write.rsplit(":", 1)
        print(json.dumps(write_one(Path(folder), kind, arguments)))
        return
    with tempfile.TemporaryDirectory() as folder:
        take(Path(folder), arguments.frames)
        print(f"{arguments.frames} frames, {arguments.topology} mesh")
        print(
            "format       frames/core s   core s   wall s   memory MB (before)   file MB   off mm"
        )
        for kind in arguments.formats:
            command = [
                sys.executable,
                "-m",
                "benchmarks",
                "interchange",
                "--write",
                f"{folder}:{kind}",
            ]
            command += ["--frames", str(arguments.frames), "--topology", arguments.topology]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                print(f"{kind:12} failed: {done.stderr.strip().splitlines()[-1]}")
                continue
            figures = json.loads(done.stdout.strip().splitlines()[-1])
            rate = arguments.frames / figures["core_s"]
            good = rate >= TARGET_FPS and figures["memory_mb"] <= TARGET_MB
            print(
                f"{kind:12} {rate:13.0f} {figures['core_s']:8.1f} {figures['wall_s']:8.1f} "
                f"{figures['memory_mb']:9.0f} ({figures['before_mb']:.0f}) {figures['file_mb']:14.1f}"
                f" {figures['off_mm']:8.5f}"
                f"{'' if good else '   below the target'}",
                flush=True,
            )
