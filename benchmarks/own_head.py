"""A corrected take on the user's own head: how well the embedded model's full head follows our mesh.

The head is the studio's topology (20,000 vertices, eyes, teeth) in another unit and pose, of the same
person and of another one; the take is the tracker's mesh with shapes that both models have alike. The
motion of the studio's own shapes is the truth.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

POSES = (
    {}, {"jawOpen": 0.6}, {"jawOpen": 0.1}, {"mouthSmile_L": 0.8, "mouthSmile_R": 0.5},
    {"mouthStretch_L": 0.6, "jawOpen": 0.2}, {"mouthUpperUp_L": 0.7, "mouthLowerDown_R": 0.7},
)  # fmt: skip
PERSON = np.array([0.8, -0.5, 0.3, 0.1])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Triangles of our mesh."""
    parser.add_argument("--triangles", type=int, default=6000, help="of our mesh (%(default)s)")


def weights_of(model) -> np.ndarray:
    """Weights (F, K) of the poses in a model."""
    weights = np.zeros((len(POSES), model.n_expressions))
    for row, pose in enumerate(POSES):
        for name, weight in pose.items():
            weights[row, model.expression_names.index(name)] = weight
    return weights


def studio_head(studio, identity: np.ndarray):
    """A person's full head as a file in centimetres, turned and moved; landmarks on it."""
    from scipy.spatial.transform import Rotation

    from vermilion.export.head_file import HeadFile
    from vermilion.geometry.polygons import Polygons
    from vermilion.scan.landmarks import ScanLandmarks

    turn = Rotation.from_euler("xyz", [20, -40, 10], degrees=True).as_matrix()
    vertices = 0.1 * studio.neutral_of(identity) @ turn.T + [3.0, 50.0, -7.0]
    landmarks = ScanLandmarks(vertices[studio.landmarks], np.zeros(66))
    return HeadFile(vertices, Polygons.with_quads(studio.triangles), studio.uv), landmarks


def own_take(tracker):
    """The take of the person on our mesh."""
    from vermilion.export.animation import Animation, HeadFrame, NamedShapes
    from vermilion.geometry.polygons import Polygons

    count, weights = len(POSES), weights_of(tracker)
    head = HeadFrame(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))
    shapes = NamedShapes(tracker.expression_names, tracker.expressions_mm, weights)
    return Animation(
        np.arange(count), 25.0, tracker.vertices(PERSON, weights),
        Polygons.of_triangles(tracker.triangles), tracker.neutral_of(PERSON), head, shapes, 1.0,
    )  # fmt: skip


def measure(title: str, head, landmarks, tracker, take, truth, shape: str) -> None:
    """Print one line."""
    from vermilion.export.head_binding import bind_head
    from vermilion.export.head_transfer import HeadTransfer

    binding = bind_head(tracker, head, landmarks)
    found = HeadTransfer(head, binding, tracker, take.neutral_mm, take.shapes, shape)
    start = time.process_time()
    poses = np.stack([found.vertices_mm(take, row) for row in range(len(POSES))])
    rate = len(POSES) / (time.process_time() - start)
    off = np.linalg.norm((poses - poses[0]) - (truth - truth[0]), axis=2)[1:]
    size = np.linalg.norm(truth - truth[0], axis=2)[1:]
    face, lips = found.region("face"), found.lips
    gaps = np.abs([np.subtract(*found.gaps_mm(take, row)) for row in range(len(POSES))])
    figures = binding.figures(tracker.triangles)
    print(
        f"{title:22} {shape:7} {figures['residual_mean_mm']:8.3f} {figures['residual_lips_mm']:8.3f}"
        f" {off[:, lips].mean():9.4f} of {size[:, lips].mean():.2f} {off[:, face].mean():9.4f}"
        f" {gaps.mean():10.5f} {gaps.max():8.5f} {rate:9.0f}"
    )


def run(arguments: argparse.Namespace) -> None:
    """Print a line a head and shape."""
    from vermilion.export.head_file import HeadFile
    from vermilion.faces import procedural
    from vermilion.geometry.polygons import Polygons

    tracker = procedural.tracker_model(arguments.triangles, 4)
    studio = procedural.studio_model(n_identities=4, seed=None)
    take, truth = own_take(tracker), studio.vertices(PERSON, weights_of(studio))
    ours = HeadFile(0.1 * take.neutral_mm, Polygons.of_triangles(tracker.triangles))
    print(
        "head                   shape   residual     lips   motion of lips      of face   gap mean      max  frames/s"
    )
    for shape in ("own", "person"):
        measure("our own mesh", ours, None, tracker, take, take.vertices_mm, shape)
        for title, person in (("the person", PERSON), ("another person", -1.5 * PERSON)):
            head, landmarks = studio_head(studio, person)
            measure(f"studio, {title}", head, landmarks, tracker, take, truth, shape)
