"""Two clips of a take, tracked by one job after the other and by two jobs side by side.

    python benchmarks/bench_clips.py RESULTS SUBJECT TAKE CAPTURE

RESULTS is the results folder of a finished run (its template, cameras and neutral are read). The take is
cut in the middle; the frame there is registered to the neutral as an anchor, and both halves are
tracked forward and backward as the stage does it. Prints wall seconds of both ways, their ratio, core
seconds a frame, and the largest memory of a job.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import cv2  # noqa: E402
import numpy as np  # noqa: E402

from vermilion.config.multiview import ImageConfig, TrackConfig  # noqa: E402
from vermilion.faces.model import FaceModel  # noqa: E402
from vermilion.geometry.camera import read_cameras  # noqa: E402
from vermilion.imaging.frames import open_frames  # noqa: E402
from vermilion.multiview.anchors import TrackSettings, find_anchor  # noqa: E402
from vermilion.multiview.files import read_neutral  # noqa: E402
from vermilion.multiview.photometric import FlowMatcher  # noqa: E402
from vermilion.multiview.take import ImageSettings, MultiviewImages, open_coarse  # noqa: E402
from vermilion.multiview.track import track_clip  # noqa: E402


def job(arguments, frames, ends) -> tuple[float, float]:
    """Track a clip from nothing, as a job does; (CPU seconds, peak MB)."""
    results, subject, take, capture = arguments
    cv2.setNumThreads(1)
    folder = Path(results) / "takes" / subject / take
    model = FaceModel.load(Path(results) / "face" / "template.npz")
    neutral = read_neutral(folder / "multiview" / "neutral.npz", model.n_vertices)
    image_settings = ImageSettings(**ImageConfig().model_dump())
    track = TrackConfig().model_dump(exclude={"clip_frames"})
    scale = track.pop("scale")
    source = open_frames(capture, subject, take)
    images = MultiviewImages(source, read_cameras(folder / "cameras"), image_settings)
    first = int(np.load(folder / "multiview" / "track.npz")["frames"][0])
    reference, load = open_coarse(images, first, neutral, model.triangles, scale)
    settings = TrackSettings(**{**track, "anchor_similarity": 0.0})
    start, stop = (
        None if frame is None
        else neutral if frame == first
        else find_anchor(reference, [frame], load, FlowMatcher(), settings).vertices_mm
        for frame in ends
    )  # fmt: skip
    track_clip(reference, frames, load, start, stop, FlowMatcher(), settings)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return time.process_time(), peak


def timed(arguments, clips, processes: int):
    start = time.perf_counter()
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, spawn, max_tasks_per_child=1) as pool:
        jobs = [pool.submit(job, arguments, *clip) for clip in clips]
        found = [running.result() for running in jobs]
    return time.perf_counter() - start, found


def main() -> None:
    arguments = sys.argv[1:5]
    results, subject, take, _ = arguments
    track = np.load(Path(results) / "takes" / subject / take / "multiview" / "track.npz")
    frames = [int(frame) for frame in track["frames"]]
    middle = len(frames) // 2
    clips = [
        (frames[: middle + 1], (frames[0], frames[middle])),
        (frames[middle:], (frames[middle], frames[-1])),
    ]
    one, found = timed(arguments, clips, 1)
    two, _ = timed(arguments, clips, 2)
    print("one job s\ttwo jobs s\ttimes as fast\tcore s a frame\tpeak MB")
    cores = sum(seconds for seconds, _ in found) / len(frames)
    print(f"{one:.1f}\t{two:.1f}\t{one / two:.2f}\t{cores:.2f}\t{max(p for _, p in found):.0f}")


if __name__ == "__main__":
    main()
