"""Landmark error, raw and flow-corrected, and CPU time of landmarks and of the fit (Mono13 5, 6).

Truth is used to measure alone. Fields of `LandmarkCorrectionSettings` are set by `--set FIELD=NUMBER`.

Expressive frames are the eleven whose landmarks moved most in the face since the first frame, as
many as Mono13's table 1 has a sequence. The detector and a modeller name different places, so there
are two truths:

- `material`: the points of the true surface that the detector marked in the first frame, followed
  through the true motion. No frame is marked by hand. Where lips are closed there, a point of the
  inner contour may lie on the other lip: such are left out.
- `marked`: the model's landmark vertices. The first frame is marked by hand, that is, given to the
  correction; raw is raw.

Prints pixels raw > corrected and the share of the error that went, then CPU milliseconds a frame. With
`--networks FOLDER` landmarks of the take's images are timed too; `--images SOURCE --networks FOLDER`
times landmarks alone, of any images (a folder of frames, a video).
"""

from __future__ import annotations

import argparse
import time
from functools import cache, partial
from pathlib import Path

import numpy as np

from benchmarks.common import add_run_arguments, timed
from benchmarks.finished_run import FinishedRun
from vermilion.geometry.camera import Camera
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.frames import open_frames
from vermilion.landmarks.correct_key_frames import correct_key_frames
from vermilion.landmarks.correction import LandmarkCorrectionSettings, correct_landmarks
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.gradients import grey_of
from vermilion.landmarks.key_frames import find_key_frames, without_offset
from vermilion.landmarks.networks import NetworkDetector
from vermilion.landmarks.scheme import (
    BROWS,
    JAW,
    LIP_INNER_OPEN,
    MOUTH,
    N_LANDMARKS,
    NOSE,
    interocular_px,
)
from vermilion.storage.errors import InputError
from vermilion.tracking.landmark_fit.expression import fit_motion
from vermilion.tracking.landmark_fit.observation import Observations, focal_px
from vermilion.tracking.landmark_fit.shape import LandmarkShape

GROUPS = {
    "all": np.arange(N_LANDMARKS),
    "mouth and eyes": np.arange(36, N_LANDMARKS),
    "mouth": MOUTH,
    "eyes": np.arange(36, 48),
    "nose": NOSE,
    "brows": BROWS,
    "jaw": JAW,
}
N_EXPRESSIVE = 11


def material_points(
    points_px: np.ndarray, camera: Camera, skin: np.ndarray, frames_mm: np.ndarray
) -> np.ndarray:
    """Where the surface points under `points_px` (66, 2) of the first frame are in all frames.

    `frames_mm` (F, V', 3) are the true meshes; the result is (F, 66, 2) px. NaN where no `skin` (T, 3) is within 6 % of the inter-ocular distance: points on teeth or eyes
    take the nearest visible vertex.
    """
    origins, directions = camera.rays(points_px)
    caster = RayCaster(frames_mm[0], skin)
    hits = caster.cast(np.broadcast_to(origins, directions.shape), directions)
    corners, shares, known = skin[hits.triangle].copy(), hits.barycentric.copy(), hits.hit.copy()
    used = np.unique(skin)
    used = used[caster.visible(camera, frames_mm[0])[used]]
    imaged = camera.project(frames_mm[0][used])
    for point in np.flatnonzero(~known):
        distance = np.linalg.norm(imaged - points_px[point], axis=1)
        if distance.min() < 0.06 * interocular_px(points_px):
            corners[point], shares[point] = used[distance.argmin()], [1.0, 0.0, 0.0]
            known[point] = True
    places = np.stack(
        [camera.project((frame[corners] * shares[..., None]).sum(axis=1)) for frame in frames_mm]
    )
    places[:, ~known] = np.nan
    return places + (points_px - places[0])


def on_other_lip(material_px: np.ndarray, marked_px: np.ndarray) -> np.ndarray:
    """Points of the inner contour that go with the other lip as it opens, (n,).

    `material_px` (F, 66, 2) and `marked_px` (F, 66, 2) are both truths.
    """
    facing = LIP_INNER_OPEN[::-1]
    own, other = marked_px[:, LIP_INNER_OPEN], marked_px[:, facing]
    widest = np.linalg.norm(own - other, axis=2).argmax(axis=0)
    each = np.arange(len(facing))
    place = material_px[:, LIP_INNER_OPEN]
    near, far = (np.linalg.norm(place - lip, axis=2)[widest, each] for lip in (own, other))
    return LIP_INNER_OPEN[near > far]


def expressive(true_px: np.ndarray) -> np.ndarray:
    """Frames (N_EXPRESSIVE,) whose `true_px` (F, 66, 2) moved most against the bridge of the nose."""
    inner = true_px - true_px[:, 27:31].mean(axis=1, keepdims=True)
    moved = np.linalg.norm(inner - inner[:1], axis=2)[:, 17:].mean(axis=1)
    return np.argsort(-moved, kind="stable")[:N_EXPRESSIVE]


def print_errors(
    name: str, truth: np.ndarray, raw: np.ndarray, corrected: np.ndarray, frames: np.ndarray
) -> None:
    """Errors of points `raw` and `corrected` against `truth`, all (F, 66, 2) px, over `frames` (n,)."""

    def error(points):
        distance = np.linalg.norm(points - truth, axis=2)[frames]
        return {key: np.nanmean(distance[:, group]) for key, group in GROUPS.items()}

    before, after = error(raw), error(corrected)
    cells = [
        f"{key} {before[key]:.2f} > {after[key]:.2f} px ({1 - after[key] / before[key]:+.0%})"
        for key in GROUPS
    ]
    print(f"{name:9s}" + "; ".join(cells), flush=True)


def true_points(
    run: FinishedRun, camera: Camera, detected: LandmarkTrack
) -> tuple[np.ndarray, np.ndarray]:
    """Both truths, `material` and `marked`, (F, 66, 2) px each."""
    studio, triangles = run.model("studio"), run.true_triangles()
    frames_mm = np.array(run.true_mm(), dtype=float)
    hidden = studio.regions["teeth"] | studio.regions["eyes"] | studio.regions["mouth_inner"]
    skin = triangles[~hidden[: frames_mm.shape[1]][triangles].any(axis=1)]
    marked = np.stack([camera.project(frame[studio.landmarks]) for frame in frames_mm])
    material = material_points(detected.points_px[0], camera, skin, frames_mm)
    material[:, on_other_lip(material, marked)] = np.nan
    return material, marked


def measure(
    run: FinishedRun, camera: Camera, detected: LandmarkTrack, settings: LandmarkCorrectionSettings
) -> None:
    """Correct the landmarks of a take and print their errors against both truths."""
    material, marked = true_points(run, camera, detected)
    images, frames, n = run.images(inpainted=True), expressive(marked), len(detected.frames)
    print(f"{run.take}: {len(marked)} frames, inter-ocular {interocular_px(marked[0]):.0f} px")

    @cache
    def grey(frame: int) -> np.ndarray:
        return grey_of(images.read(camera.name, frame))

    def key_frames(given: dict[int, np.ndarray]):
        unbiased = without_offset(detected, given)
        return correct_key_frames(grey, unbiased, find_key_frames(grey, unbiased, given), settings)

    for frame in detected.frames:
        grey(int(frame))
    for kind, true_px, given in (
        ("material", material, {}),
        ("marked", marked, {int(detected.frames[0]): marked[0]}),
    ):
        keys = timed(partial(key_frames, given))
        flow = timed(
            partial(correct_landmarks, grey, detected, keys.result, detected.frames, settings)
        )
        print_errors(kind, true_px, detected.points_px, flow.result[0].points_px, frames)
        print(
            f"  {len(keys.result.frames)} key frames; CPU ms a frame: key frames "
            f"{1e3 * keys.cpu_s / n:.0f}, correction {1e3 * flow.cpu_s / n:.0f}"
        )


class TimedSession:
    """A session of onnxruntime that adds up its CPU seconds."""

    def __init__(self, session):
        self.session, self.seconds = session, 0.0
        self.get_inputs = session.get_inputs

    def run(self, *arguments):
        start = time.process_time()
        try:
            return self.session.run(*arguments)
        finally:
            self.seconds += time.process_time() - start


def time_networks(folder: Path, images: list[np.ndarray], rounds: int = 5) -> None:
    """The least and the median of some rounds over `images` (h, w, 3): other load only ever adds."""
    detector = NetworkDetector(folder)
    detector.detect(images[0])
    whole, inside = [], []
    for _ in range(rounds):
        sessions = [TimedSession(detector._face), TimedSession(detector._landmarks)]
        detector._face, detector._landmarks = sessions
        spent = timed(lambda: [detector.detect(image) for image in images])
        whole.append(1e3 * spent.cpu_s / len(images))
        inside.append(1e3 * sum(s.seconds for s in sessions) / len(images))
        detector._face, detector._landmarks = (s.session for s in sessions)
    best = int(np.argmin(whole))
    height, width = images[0].shape[:2]
    print(
        f"  landmarks, {width} x {height}: {whole[best]:.1f} CPU ms a frame (median of {rounds} rounds "
        f"{np.median(whole):.1f}): networks {inside[best]:.1f}, the rest {whole[best] - inside[best]:.1f}"
    )


def time_fit(run: FinishedRun, track: LandmarkTrack) -> None:
    """Time pose and expression of all frames."""
    person, camera = run.identity(), run.fit().camera
    shape = LandmarkShape.of(run.tracker_model(), person.identity, person.landmark_offset_mm)
    seen = Observations.of(track, camera)
    spent = timed(lambda: fit_motion(shape, seen, focal_px(camera), 30.0))
    print(f"  expression and pose: {1e3 * spent.cpu_s / len(track.frames):.1f} CPU ms a frame")


def field_of_correction(text: str) -> tuple[str, float]:
    """Name and value of FIELD=NUMBER."""
    name, _, value = text.partition("=")
    if name not in LandmarkCorrectionSettings.__dataclass_fields__:
        known = ", ".join(LandmarkCorrectionSettings.__dataclass_fields__)
        raise argparse.ArgumentTypeError(f"no field {name!r}; there are {known}")
    return name, float(value)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What is read, and how it is measured."""
    add_run_arguments(parser, required=False)
    parser.add_argument("--images", metavar="SOURCE", help="time landmarks of these images alone")
    parser.add_argument("--networks", type=Path, metavar="FOLDER", help="landmark networks to time")
    parser.add_argument("--camera", default="cam", help="camera of the take (%(default)s)")
    parser.add_argument(
        "--set",
        type=field_of_correction,
        action="append",
        default=[],
        metavar="FIELD=NUMBER",
        help="a field of LandmarkCorrectionSettings",
    )


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    if not (arguments.results or (arguments.images and arguments.networks)):
        raise InputError(
            "nothing to measure",
            "--results RESULTS, or --images SOURCE with --networks FOLDER",
            "See --help.",
        )
    if arguments.images:
        source = open_frames(arguments.images)
        time_networks(arguments.networks, [source.read("", frame) for frame in range(20)])
        return
    take = FinishedRun.of(arguments)
    camera, detected = take.cameras()[arguments.camera], take.landmarks(raw=True)
    measure(take, camera, detected, LandmarkCorrectionSettings(**dict(arguments.set)))
    if arguments.networks:
        source, frames = take.images(inpainted=True), detected.frames[:20]
        time_networks(arguments.networks, [source.read(camera.name, int(f)) for f in frames])
    if (take.folder / "tracking" / "fit.npz").is_file():
        time_fit(take, detected)
