"""Speed and accuracy of the multi-view stage on a capture with known truth.

Each `--every`-th frame of a finished run's take is registered, from the run's template, cameras,
neutral and track, and compared in the same run with what goes without a part:

- `refined`: the stage as it is;
- `refined, no stereo`: without each frame's stereo points;
- `tracked`: frame-to-frame flow between anchor frames alone;
- `held`: the neutral, not moved.

Figures over the vermilion of the template that two cameras see: distance to the true surface, and
drift from the true material point that lay nearest at the neutral, in mm. Seconds are of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.common import add_run_arguments, print_table, timed
from benchmarks.finished_run import FinishedRun
from vermilion.config.multiview import MultiviewConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.closest_points import Surface
from vermilion.multiview.files import read_track
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import ImageSettings, MultiviewImages, Refiner, RefineSettings


class Truth:
    """The true surface, and the material points that the neutral's vertices lie on."""

    def __init__(self, run: FinishedRun, neutral_mm: np.ndarray):
        """`neutral_mm` (V, 3): the registered neutral, world frame."""
        self.vertices_mm, self.triangles = run.true_mm(), run.true_triangles()
        self.material = self.surface(0).closest(neutral_mm)
        self.offset_mm = neutral_mm - self.followed(0)

    def surface(self, frame: int) -> Surface:
        """The true surface of a frame."""
        return Surface(self.vertices_mm[frame], self.triangles)

    def followed(self, frame: int) -> np.ndarray:
        """Where the material points are in a frame, (V, 3) mm."""
        return self.material.on(self.vertices_mm[frame].astype(np.float64), self.triangles)

    def errors(
        self, vertices_mm: np.ndarray, frame: int, where: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distance to the surface and drift, (n,) mm each, of `vertices_mm` (V, 3) in the mask
        `where` (V,)."""
        distance = self.surface(frame).closest(vertices_mm[where]).distance_mm
        drift = np.linalg.norm(vertices_mm - self.followed(frame) - self.offset_mm, axis=1)
        return distance, drift[where]


def refined(refiner: Refiner, frames: Sequence[int], coarse_mm: np.ndarray) -> tuple[list, float]:
    """Frames refined from `coarse_mm` (F, V, 3), and core seconds a frame."""
    refiner.refine(frames[0], coarse_mm[0])  # what is computed once a take
    pairs = list(zip(frames, coarse_mm, strict=True))
    found = timed(lambda: [refiner.refine(*pair) for pair in pairs])
    return found.result, found.cpu_s / len(frames)


def refiner_of(
    run: FinishedRun, model: FaceModel, neutral_mm: np.ndarray, **changes: float
) -> Refiner:
    """The stage's refiner with its default settings, some changed; `neutral_mm` (V, 3)."""
    config = MultiviewConfig()
    images = MultiviewImages(
        run.images(), run.cameras(), ImageSettings(**config.images.model_dump())
    )
    stereo = StereoSettings(**config.stereo.model_dump())
    settings = replace(RefineSettings(**config.refine.model_dump()), **changes)
    return Refiner(images, model, 0, neutral_mm, stereo, settings, FlowMatcher())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read, and how it is measured."""
    add_run_arguments(parser, "p1/rom")
    parser.add_argument(
        "--every", type=int, default=8, help="measure each such frame (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    take = FinishedRun.of(arguments)
    model = take.model("template")
    neutral = take.neutral_mm(model)
    truth = Truth(take, neutral)
    frames = list(range(arguments.every, len(truth.vertices_mm), arguments.every))
    coarse = read_track(take.folder / "multiview" / "track.npz", frames).astype(np.float64)
    full, full_s = refined(refiner_of(take, model, neutral), frames, coarse)
    bare, bare_s = refined(refiner_of(take, model, neutral, cloud_scale=0.0), frames, coarse)
    methods = {
        "refined": ([f.registered.vertices_mm for f in full], full_s),
        "refined, no stereo": ([f.registered.vertices_mm for f in bare], bare_s),
        "tracked": (coarse, np.nan),
        "held": ([neutral] * len(frames), np.nan),
    }
    red = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    seen = [red & (found.registered.cameras_seeing >= 2) for found in full]
    rows = []
    for name, (meshes, seconds) in methods.items():
        pairs = [truth.errors(*frame) for frame in zip(meshes, frames, seen, strict=True)]
        surface, drift = (np.concatenate(part) for part in zip(*pairs, strict=True))
        rows.append(
            {
                "method": name,
                "surface median mm": np.median(surface),
                "surface p95 mm": np.percentile(surface, 95),
                "drift mean mm": drift.mean(),
                "core s a frame": seconds,
            }
        )
    print_table(rows, {"surface median mm": 3, "surface p95 mm": 3, "drift mean mm": 3})
