"""Contours of rendered mouths whose teeth, gums, tongue, wetness and light vary.

Actors of the studio, each with an identity, expressions, colours, light, camera and compression of their own
and a tongue that lies, touches the teeth, stands between them or hangs out, are written as folders of images
with a label a frame, as `lips_on_labels` reads them. Landmarks are the network's. Prints, for the landmarks and
for contours with settings of `contours.detector` changed one at a time, over frames of the first half of the
actors (`chosen`) and of the second (`locked`):

- `inner`: mean distance of true and found inner border, px at a mouth of 120 px;
- `worst`: mean over the actors of each one's worst frame;
- `opening`: median of the openings as a share of the true ones, over frames that are open by more than 4 px,
  and the share of those that lie outside 0.85 to 1.15;
- `closed`: mean height in px of the other frames, less the true one.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.common import add_data_argument, print_table
from benchmarks.lips_on_labels import OPEN_PX, WIDTH_PX, DrawnLips, columns_of, compare, halves
from benchmarks.varied_mouth import VariedMouth
from vermilion.config.contours import ContourDetectorConfig
from vermilion.config.face_model import FaceModelConfig
from vermilion.contours.curves import loop_spline
from vermilion.contours.landmark_rings import LandmarkRings
from vermilion.contours.ridges import blurred_colours
from vermilion.contours.take_detector import detector_from_rings
from vermilion.faces.build import FaceModelSettings, build_models
from vermilion.faces.model import FaceModel
from vermilion.imaging.frames import FolderFrames
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.mediapipe import MediapipeDetector
from vermilion.storage.files import write_text
from vermilion.storage.progress import progress

#: Settings that are changed, one at a time.
VARIANTS: dict[str, dict[str, float]] = {
    "contours": {},
    "no shade": {"lips_shade": 0.0},
    "half the shade": {"lips_shade": 0.5},
    "no colours": {"lips_colours": 0.0},
    "colours 0.25": {"lips_colours": 0.25},
    "colours 0.75": {"lips_colours": 0.75},
    "no heights": {"lips_heights": 0.0},
    "heights 0.5": {"lips_heights": 0.5},
    "heights 2": {"lips_heights": 2.0},
    "reach 0.015": {"lips_reach": 0.015},
    "reach 0.03": {"lips_reach": 0.03},
    "stiffness 3": {"stiffness": 3.0},
    "stiffness 12": {"stiffness": 12.0},
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is rendered, and where."""
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="of the images")
    parser.add_argument("--actors", type=int, default=16, help="%(default)s")
    parser.add_argument("--frames", type=int, default=24, help="of each (%(default)s)")
    parser.add_argument("--only", nargs="+", choices=list(VARIANTS), help="these rows alone")
    parser.add_argument(
        "--network", type=Path, default=Path(".venv-mediapipe"), metavar="FOLDER",
        help="environment of the landmark network (%(default)s)",
    )  # fmt: skip
    add_data_argument(parser)


def run(arguments: argparse.Namespace) -> None:
    """Render what is missing, measure and print."""
    model = face_model(arguments.data / "ict-facekit" / "FaceXModel.tar.xz")
    tables = []
    for seed in range(arguments.actors):
        # Another number of frames is another performance.
        folder = arguments.out / f"actor{seed:02d}_{arguments.frames}"
        write_take(VariedMouth(model, seed, arguments.frames), folder)
        take = Take.read(folder, arguments.network)
        half = "chosen" if seed < arguments.actors // 2 else "locked"
        found = {"landmarks": take.landmark_borders()} | {
            name: take.found_borders(ContourDetectorConfig(**values))
            for name, values in VARIANTS.items()
            if arguments.only is None or name in arguments.only
        }
        tables.append(take.compared(found).assign(half=half, actor=seed))
    table = pd.concat(tables)
    print_table(summary(table))


def face_model(archive: Path) -> FaceModel:
    """The studio's part of ICT-FaceKit where the `archive` is, else of the generated head."""
    name, path = ("ict", str(archive)) if archive.exists() else ("procedural", None)
    config = FaceModelConfig.model_validate({"name": name, "path": path})
    return build_models(name, path, None, FaceModelSettings.of(config.model_dump()))["studio"]


def write_take(actor: VariedMouth, folder: Path) -> None:
    """Images and labels of an actor's frames; what is there is kept."""
    for frame in progress(list(range(actor.n_frames)), f"frames of {folder.name}"):
        image, label = folder / "images" / f"{frame:06d}.png", folder / f"{frame:06d}.json"
        if image.exists():
            continue
        upper, lower = actor.borders_px(frame)
        drawn = {"unit": "px", "upper": upper.round(2).tolist(), "lower": lower.round(2).tolist()}
        write_text(label, json.dumps(drawn))
        write_srgb8(image, actor.image(frame))


class Take:
    """Images, labels and the network's landmarks of an actor's take."""

    def __init__(
        self, images: FolderFrames, labels: dict[int, DrawnLips], landmarks: LandmarkTrack
    ):
        self.images, self.labels, self.landmarks = images, labels, landmarks
        self.rings = LandmarkRings(landmarks)

    @classmethod
    def read(cls, folder: Path, network: Path) -> Take:
        """Of what `write_take` wrote; landmarks are found once."""
        labels = {int(p.stem): DrawnLips.read(p) for p in sorted(folder.glob("*.json"))}
        images, kept = FolderFrames([folder / "images"]), folder / "landmarks.npz"
        if not kept.exists():
            with MediapipeDetector(network) as detector:
                found = [detector.detect(images.read("cam", frame)) for frame in labels]
            LandmarkTrack.of(list(labels), found).save(kept)
        return cls(images, labels, LandmarkTrack.load([kept], None))

    def landmark_borders(self) -> dict[int, np.ndarray]:
        """Frame -> inner ring (n, 2) px of the landmarks."""
        return {frame: ring[1] for frame in self.rings.frames if (ring := self.rings(frame))}

    def found_borders(self, cfg: ContourDetectorConfig) -> dict[int, np.ndarray]:
        """Frame -> inner ring (n, 2) px where the take's detector draws its ridge."""

        def read(frame: int) -> np.ndarray:
            return self.images.read("cam", frame)

        frames = self.rings.frames
        detector = detector_from_rings(cfg, read, self.landmarks, self.rings, frames, True)
        if detector is None:
            return {}
        points = dict(
            zip(self.landmarks.frames.tolist(), self.landmarks.as_ibug66().points_px, strict=True)
        )
        result = {}
        for frame in frames:
            region = detector.region(points[frame], self.rings(frame))
            colours = blurred_colours(region.crop(read(frame)))
            outer = loop_spline(detector.outer_border(colours, region)[0])
            result[frame] = region.to_image(detector.inner_border(colours, region, outer)[0])
        return result

    def compared(self, found: dict[str, dict[int, np.ndarray]]) -> pd.DataFrame:
        """A row a kind and frame."""
        width = np.median([np.linalg.norm(np.subtract(*d.ends)) for d in self.labels.values()])
        rows = []
        for kind, rings in found.items():
            for frame, drawn in self.labels.items():
                row = {"kind": kind, "frame": frame}
                if frame in rings:
                    borders = columns_of(*halves(rings[frame]), *drawn.ends)
                    row |= compare(borders, drawn.borders(), WIDTH_PX / width)
                rows.append(row)
        return pd.DataFrame(rows)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """A row a kind, columns of both halves."""
    rows = []
    for kind, part in table.groupby("kind", sort=False):
        row: dict[str, object] = {"kind": kind}
        for half, some in part.groupby("half", sort=True):
            wide, shut = some[some.drawn > OPEN_PX], some[some.drawn <= OPEN_PX]
            share = wide.gap / wide.drawn
            row |= {
                f"{half}: inner (px)": some.inner.mean(),
                f"{half}: worst": some.groupby("actor").inner.max().mean(),
                f"{half}: opening": share.median(),
                f"{half}: outside (%)": 100 * ((share < 0.85) | (share > 1.15)).mean(),
                f"{half}: closed (px)": (shut.gap - shut.drawn).mean(),
            }
        rows.append(row)
    return pd.DataFrame(rows)
