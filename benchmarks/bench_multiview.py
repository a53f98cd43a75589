"""Speed and accuracy of the multiview stage on a capture with known truth.

    python benchmarks/bench_multiview.py RESULTS SUBJECT TAKE CAPTURE TRUTH [STEP]

RESULTS is the results folder of a finished run (its template, cameras, neutral and track are read),
TRUTH a folder with vertices_mm.npy and triangles.npy in the same world. Every STEP-th frame is
registered, and compared in the same run with what goes without it:

- `refined`: the stage as it is;
- `refined, no stereo`: without each frame's stereo points;
- `tracked`: frame-to-frame flow between anchor frames alone;
- `held`: the neutral, not moved.

Figures over the vermilion of the template that two cameras see: distance to the true surface, and
drift from the true material point that lay nearest at the neutral, in mm. Seconds are of one core.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from vermilion.config.multiview import MultiviewConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.geometry.closest_points import Surface
from vermilion.imaging.frames import open_frames
from vermilion.multiview.files import read_neutral, read_track
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.stereo import StereoSettings
from vermilion.multiview.take import ImageSettings, MultiviewImages, Refiner, RefineSettings


class Truth:
    """The true surface, and the material points that the neutral's vertices lie on."""

    def __init__(self, folder: Path, neutral_mm: np.ndarray):
        self.vertices_mm = np.load(folder / "vertices_mm.npy", mmap_mode="r")
        self.triangles = np.load(folder / "triangles.npy")
        self.material = self.surface(0).closest(neutral_mm)
        self.offset_mm = neutral_mm - self.followed(0)

    def surface(self, frame: int) -> Surface:
        return Surface(self.vertices_mm[frame], self.triangles)

    def followed(self, frame: int) -> np.ndarray:
        return self.material.on(self.vertices_mm[frame].astype(np.float64), self.triangles)

    def errors(self, vertices_mm: np.ndarray, frame: int, where: np.ndarray):
        """(distance to the surface, drift) in mm of the vertices of a mask."""
        distance = self.surface(frame).closest(vertices_mm[where]).distance_mm
        drift = np.linalg.norm(vertices_mm - self.followed(frame) - self.offset_mm, axis=1)
        return distance, drift[where]


def main() -> None:
    results, subject, take, capture, truth_folder = sys.argv[1:6]
    step = int(sys.argv[6]) if len(sys.argv) > 6 else 8
    cv2.setNumThreads(1)
    folder = Path(results) / "takes" / subject / take
    model = FaceModel.load(Path(results) / "face" / "template.npz")
    neutral = read_neutral(folder / "multiview" / "neutral.npz", model.n_vertices)
    truth = Truth(Path(truth_folder), neutral)
    frames = list(range(step, len(truth.vertices_mm), step))
    coarse = read_track(folder / "multiview" / "track.npz", frames).astype(np.float64)
    config = MultiviewConfig()
    cameras = folder / "cameras" if (folder / "cameras").is_dir() else Path(capture) / "cameras"
    image_settings = ImageSettings(**config.images.model_dump())
    images = MultiviewImages(
        open_frames(capture, subject, take), read_cameras(cameras), image_settings
    )
    stereo = StereoSettings(**config.stereo.model_dump())
    settings = RefineSettings(**config.refine.model_dump())
    red = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    errors, seconds = {}, {}

    def refined(name, options):
        refiner = Refiner(images, model, 0, neutral, stereo, options, FlowMatcher())
        refiner.refine(frames[0], coarse[0])  # what is computed once a take
        start = time.process_time()
        found = [refiner.refine(f, c) for f, c in zip(frames, coarse, strict=True)]
        seconds[name] = (time.process_time() - start) / len(frames)
        return found

    full = refined("refined", settings)
    bare = refined("refined, no stereo", replace(settings, cloud_scale=0.0))
    rows = {
        "refined": [f.registered.vertices_mm for f in full],
        "refined, no stereo": [f.registered.vertices_mm for f in bare],
        "tracked": list(coarse),
        "held": [neutral] * len(frames),
    }
    for name, meshes in rows.items():
        pairs = [
            truth.errors(vertices, number, red & (found.registered.cameras_seeing >= 2))
            for vertices, number, found in zip(meshes, frames, full, strict=True)
        ]
        errors[name] = [np.concatenate([pair[k] for pair in pairs]) for k in (0, 1)]
    print("method\tsurface median mm\tsurface p95 mm\tdrift mean mm\tseconds a frame")
    for name, (surface, drift) in errors.items():
        figures = (np.median(surface), np.percentile(surface, 95), drift.mean())
        spent = f"{seconds[name]:.2f}" if name in seconds else ""
        print(name, *(f"{value:.3f}" for value in figures), spent, sep="\t")


if __name__ == "__main__":
    main()
