"""Guided lip correction: speed beside the obvious way, and error against the number of frames.

`speed`: training (k = 11, m = 19,315 triangles), a frame, and a sketch solve on a mesh of 40,000
vertices, in this thread's time (what else runs does not count), each beside the obvious way in the
same run. Bars: 50 ms, 15 ms, 0.5 s.

`study`: actors whose expressions are their own (each shape with a gain, a direction and a smooth field
of its own, and fields of pairs of shapes, which no sum of shapes gives), 276 recorded frames, 0.03 mm
of noise. Some frames train, all others are predicted; share of the inner lips' deformation from the
neutral that is left (mean distance over the free vertices of the inner lips, head frame). Bars: 10
suggested frames 15 %, 10 uniform 22 %, 5 suggested 30 %, and 5 suggested reach the median of 10 random.
`gradients` is figure 11's mean of |x* - x|. Also lips that pass through each other and the volumes of
the lips.

`sizes`: what other sizes of the inner lips and the mouth region cost.

With the folder of optional data, ICT-FaceKit and a recorded performance; without, the generated head
and generated weights.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.common import add_data_argument
from benchmarks.guided_actors import N_FRAMES, actor_take
from benchmarks.guided_speed import speed
from benchmarks.lip_volumes import LipVolumes
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.evaluation.guided_study import PropagationStudy
from vermilion.faces import ict
from vermilion.faces.ict_archive import read_ict
from vermilion.faces.model import FaceModel
from vermilion.faces.procedural import studio_model
from vermilion.guided.regions import regions_of_face
from vermilion.guided.suggestion import (
    extreme_frames,
    random_frames,
    suggest_frames,
    uniform_frames,
)
from vermilion.studio.live_link import read_live_link
from vermilion.studio.performance import generated_weights

PARTS = ("speed", "study", "sizes")


class Trial:
    """One actor's take: propagation from any chosen frames, and what it leaves."""

    def __init__(self, face: FaceModel, weights: np.ndarray, seed: int, **sizes: float):
        self.neutral, self.take = actor_take(face, weights, seed)
        self.regions = regions_of_face(face, **sizes)
        stable = np.flatnonzero(face.regions["rigid"])
        self.study = PropagationStudy(self.take, self.neutral, self.regions, stable)
        self.deformation, self.size = self.study.deformation, self.study.size_mm

    def left(self, frames: np.ndarray, **options) -> tuple[float, float, np.ndarray]:
        """(share left of the deformation, mean |x* - x|, meshes) of all frames but those trained."""
        left = self.study.left(frames, **options)
        return self.study.ratio(left), left.gradient_error[left.others].mean(), left.vertices_mm


def study(face: FaceModel, takes: dict[str, np.ndarray], actors: int, draws: int) -> None:
    """Print the table of shares left against the choice of frames, and the checks of the lips."""
    print("\nshare of the inner lips' deformation left (%), mean over the frames not trained")
    print(f"{'take':12s} {'actor':>5s} {'mm':>5s} | suggested 5, 10 | uniform 5, 10 | extremes 10 "
          "| random 5, 10 (median) | without the neutral: suggested 5, 10")  # fmt: skip
    held = []
    for name, weights in takes.items():
        for actor in range(actors):
            trial = Trial(face, weights, actor)
            suggested = {k: suggest_frames(trial.deformation, k) for k in (5, 10)}
            uniform = {k: uniform_frames(len(weights), k) for k in (5, 10)}
            extreme = extreme_frames(trial.deformation, 10)
            share = [
                100 * trial.left(f)[0] for f in (*suggested.values(), *uniform.values(), extreme)
            ]
            chance = [
                100
                * np.median(
                    [trial.left(random_frames(len(weights), k, d))[0] for d in range(draws)]
                )
                for k in (5, 10)
            ]
            plain = [100 * trial.left(f, with_neutral=False)[0] for f in suggested.values()]
            held.append((*share, *chance))
            print(
                f"{name:12s} {actor:5d} {trial.size.mean():5.2f} | {share[0]:6.1f} {share[1]:6.1f}   |"
                f" {share[2]:5.1f} {share[3]:6.1f}  | {share[4]:8.1f}    | {chance[0]:8.1f}"
                f" {chance[1]:6.1f}       | {plain[0]:12.1f} {plain[1]:6.1f}",
                flush=True,
            )
    held = np.array(held)
    print(f"worst: 10 suggested {held[:, 1].max():.1f} (bar 15), 10 uniform {held[:, 3].max():.1f} "
          f"(bar 22), 5 suggested {held[:, 0].max():.1f} (bar 30); 5 suggested over the median of "
          f"10 random: mean {(held[:, 0] / held[:, 6]).mean():.2f}, worst "
          f"{(held[:, 0] / held[:, 6]).max():.2f} (bar 1)")  # fmt: skip
    lips(face, next(iter(takes.values())))


def lips(face: FaceModel, weights: np.ndarray) -> None:
    """Figure 11's curve, contact and volumes of one actor, by the number of suggested frames."""
    trial = Trial(face, weights, 0)
    crossings, volumes = LipCrossings(face), LipVolumes.of(face)
    rest = volumes.measure(trial.neutral[None])
    true = volumes.measure(trial.take) / rest
    print("\n  k  left (%)  gradients  volumes off (% of the lip, mean, worst frame)")
    for k in (1, 2, 3, 5, 8, 10, 15, 20):
        share, gradient, found = trial.left(suggest_frames(trial.deformation, k))
        off = 100 * np.abs(volumes.measure(found) / rest - true).max(axis=1)
        print(f"{k:3d} {100 * share:8.1f} {gradient:10.2f} {off.mean():10.2f} {off.max():6.2f}")
    frames = suggest_frames(trial.deformation, 10)
    trial.study.propagator.fit(trial.take[frames])
    every = np.arange(0, len(trial.take), 3)
    for label, lip in (("truth", None), ("propagated", None), ("and parted", crossings)):
        meshes = trial.take[every]
        if label != "truth":
            meshes = trial.study.propagator.correct(meshes, lip).vertices_mm
        depth = np.array([crossings.find(mesh).deepest_mm for mesh in meshes])
        off = 100 * np.abs(volumes.measure(meshes) / rest - true[every]).max(axis=1)
        print(f"lips through each other, {label:11s} {(depth > 0.05).sum():3d} of {len(depth)} frames, "
              f"deepest {depth.max():.2f} mm; volumes off {off.mean():.2f} %, {off.max():.2f} at worst")  # fmt: skip


def sizes(face: FaceModel, weights: np.ndarray) -> None:
    """Print what other sizes of the regions cost, 10 suggested frames."""
    print("\n inner inside mouth (mm)  predicted  trusted  deformation (mm)  left (%)  left (mm)")
    for inner, inside, mouth in (
        (3, 8, 40), (5, 8, 40), (8, 8, 40), (12, 8, 40), (5, 4, 40), (5, 12, 40),
        (5, 8, 15), (5, 8, 25), (5, 8, 60),
    ):  # fmt: skip
        trial = Trial(face, weights, 0, inner_mm=inner, inside_mm=inside, mouth_mm=mouth)
        share = trial.left(suggest_frames(trial.deformation, 10))[0]
        print(f"{inner:6d} {inside:6d} {mouth:5d} {len(trial.regions.predicted):15d} "
              f"{len(trial.regions.trusted):8d} {trial.size.mean():17.2f} {100 * share:9.1f} "
              f"{share * trial.size.mean():9.2f}", flush=True)  # fmt: skip


def the_face(archive: Path) -> FaceModel:
    """ICT-FaceKit where it is, else the generated head."""
    if archive.exists():
        return ict.studio_model(read_ict(archive, 100), 100)
    return studio_model(seed=0)


def the_takes(face: FaceModel, curves: Path) -> dict[str, np.ndarray]:
    """Recorded weights, a busy stretch and the whole take thinned out, or generated ones."""
    names = face.expression_names
    if curves.exists():
        return {
            "rom, whole": read_live_link(curves, names, N_FRAMES, 30.0, 60, 30.0 * 14),
            "rom, 2240": read_live_link(curves, names, N_FRAMES, 30.0, 2240, 30.0),
            "rom, 3500": read_live_link(curves, names, N_FRAMES, 30.0, 3500, 30.0),
        }
    return {"generated": generated_weights(names, N_FRAMES, 30.0, seed=7)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which parts, on which data."""
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], default=list(PARTS))
    parser.add_argument("--actors", type=int, default=4, help="actors of `study` (%(default)s)")
    parser.add_argument("--draws", type=int, default=20, help="random choices (%(default)s)")
    add_data_argument(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    if "speed" in arguments.parts:
        speed()
    if {"study", "sizes"} & set(arguments.parts):
        face = the_face(arguments.data / "ict-facekit" / "FaceXModel.tar.xz")
        takes = the_takes(face, arguments.data / "performance" / "rom.csv")
        print(f"\nface model {face.name}, {face.n_vertices} vertices, {N_FRAMES} frames")
        if "study" in arguments.parts:
            study(face, takes, arguments.actors, arguments.draws)
        if "sizes" in arguments.parts:
            sizes(face, next(iter(takes.values())))
