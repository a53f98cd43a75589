"""Two clips of a multi-view take tracked one after the other, and by two jobs side by side.

The take is cut in the middle; the frame there is registered to the neutral as an anchor, and both
halves are tracked forward and backward as the stage does it. Prints wall seconds of both ways, their
ratio, core seconds a frame, and the largest memory of a job.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

import cv2

from benchmarks.common import Timed, add_run_arguments, peak_gb, print_table, timed
from benchmarks.finished_run import FinishedRun
from vermilion.config.multiview import ImageConfig, TrackConfig
from vermilion.multiview.anchors import TrackSettings, find_anchor
from vermilion.multiview.files import read_anchors
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.take import ImageSettings, MultiviewImages, open_coarse
from vermilion.multiview.track import track_clip

#: Frames of a clip, and its first and last one.
ClipFrames = tuple[list[int], tuple[int, int]]


def track(run: FinishedRun, frames: list[int], ends: Sequence[int]) -> tuple[float, float]:
    """Track a clip from nothing, as a job does; (core seconds, peak GB)."""
    cv2.setNumThreads(1)
    model = run.model("template")
    neutral = run.neutral_mm(model)
    options = TrackConfig().model_dump(exclude={"clip_frames"})
    scale = options.pop("scale")
    image_settings = ImageSettings(**ImageConfig().model_dump())
    images = MultiviewImages(run.images(), run.cameras(), image_settings)
    first = frames_of(run)[0]
    reference, load = open_coarse(images, first, neutral, model.triangles, scale)
    settings = TrackSettings(**{**options, "anchor_similarity": 0.0})
    start, stop = (
        neutral
        if frame == first
        else find_anchor(reference, [frame], load, FlowMatcher(), settings).vertices_mm
        for frame in ends
    )
    track_clip(reference, frames, load, start, stop, FlowMatcher(), settings)
    return time.process_time(), peak_gb()


def frames_of(run: FinishedRun) -> list[int]:
    """Frame numbers of the take."""
    return [int(frame) for frame in read_anchors(run.folder / "multiview" / "track.npz")[0]]


def in_jobs(run: FinishedRun, clips: Sequence[ClipFrames], jobs: int) -> Timed:
    """Track clips in processes of their own, `jobs` at a time."""

    def task() -> list[tuple[float, float]]:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(jobs, spawn, max_tasks_per_child=1) as pool:
            running = [pool.submit(track, run, *clip) for clip in clips]
            return [job.result() for job in running]

    return timed(task)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read, and how it is measured."""
    add_run_arguments(parser, "p1/rom", truth=False)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    take = FinishedRun.of(arguments)
    frames = frames_of(take)
    middle = len(frames) // 2
    clips = [
        (frames[: middle + 1], (frames[0], frames[middle])),
        (frames[middle:], (frames[middle], frames[-1])),
    ]
    one, two = (in_jobs(take, clips, jobs) for jobs in (1, 2))
    cores_s, peaks = zip(*one.result, strict=True)
    print_table(
        [
            {
                "one job s": one.wall_s,
                "two jobs s": two.wall_s,
                "times as fast": one.wall_s / two.wall_s,
                "core s a frame": sum(cores_s) / len(frames),
                "peak GB": max(peaks),
            }
        ]
    )
