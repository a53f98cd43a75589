"""Landmark error, raw and flow-corrected, and CPU time of landmarks and of the fit (Mono13 5, 6).

    python -m benchmarks.bench_landmarks RESULTS SUBJECT/TAKE [key=value ...]

RESULTS is the folder of a finished run. Keys: `captures` and `truth`, folders of captures and of true
meshes (by default those in RESULTS); `camera` (`cam`); `models`, a folder of networks to time; and
fields of `CorrectionSettings`. Truth is used to measure alone.

Expressive frames are the eleven whose landmarks moved most in the face since the first frame, as
many as Mono13's table 1 has a sequence. The detector and a modeller name different places, so there
are two truths:

- `material`: the points of the true surface that the detector marked in the first frame, followed
  through the true motion. No frame is marked by hand. Where lips are closed there, a point of the
  inner contour may lie on the other lip: such are left out.
- `marked`: the model's landmark vertices. The first frame is marked by hand, that is, given to the
  correction; raw is raw.

Prints pixels raw > corrected and the share of the error that went, then CPU milliseconds a frame. Landmarks
alone, of any images (a folder of frames, a video) on one thread, are timed by

    python -m benchmarks.bench_landmarks IMAGES models=FOLDER
"""

from __future__ import annotations

import sys
import time
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, read_cameras
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.frames import open_frames
from vermilion.landmarks.correct_key_frames import settle
from vermilion.landmarks.correction import CorrectionSettings, correct
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
from vermilion.tracking.landmark_fit.expression import fit_motion
from vermilion.tracking.landmark_fit.observation import Observations, focal_px
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.result import Identity, TrackedTake

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
    """Where the surface points under (66, 2) px of the first frame are in all frames, (F, 66, 2).

    NaN where no skin (T, 3) is within 6 % of the inter-ocular distance: points on teeth or eyes
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
    """Points of the inner contour that go with the other lip as it opens, of (F, 66, 2) twice."""
    facing = LIP_INNER_OPEN[::-1]
    own, other = marked_px[:, LIP_INNER_OPEN], marked_px[:, facing]
    widest = np.linalg.norm(own - other, axis=2).argmax(axis=0)
    each = np.arange(len(facing))
    place = material_px[:, LIP_INNER_OPEN]
    near, far = (np.linalg.norm(place - lip, axis=2)[widest, each] for lip in (own, other))
    return LIP_INNER_OPEN[near > far]


def expressive(true_px: np.ndarray) -> np.ndarray:
    """The frames whose points moved most, relative to the bridge of the nose."""
    inner = true_px - true_px[:, 27:31].mean(axis=1, keepdims=True)
    moved = np.linalg.norm(inner - inner[:1], axis=2)[:, 17:].mean(axis=1)
    return np.argsort(-moved, kind="stable")[:N_EXPRESSIVE]


def print_errors(name: str, truth, raw, corrected, frames) -> None:
    def error(points):
        distance = np.linalg.norm(points - truth, axis=2)[frames]
        return {key: np.nanmean(distance[:, group]) for key, group in GROUPS.items()}

    before, after = error(raw), error(corrected)
    cells = [
        f"{key} {before[key]:.2f} > {after[key]:.2f} px ({1 - after[key] / before[key]:+.0%})"
        for key in GROUPS
    ]
    print(f"{name:9s}" + "; ".join(cells), flush=True)


def main(results: str, name: str, places: dict[str, str], changes: dict[str, float]) -> None:
    cv2.setNumThreads(1)
    root, (subject, take) = Path(results), name.split("/")
    folder = root / "takes" / name
    capture = Path(places.get("captures", root / "captures")) / name
    true_folder = Path(places.get("truth", root / "truth")) / name
    studio = FaceModel.load(root / "face" / "studio.npz")
    refined = folder / "cameras"
    cameras = read_cameras(refined if refined.is_dir() else capture / "cameras")
    camera = cameras[places.get("camera", "cam")]
    inpainted = sorted((folder / "inpaint").glob("0*"))
    source = open_frames(inpainted or capture, subject, take)
    detected = LandmarkTrack.load(
        sorted((folder / "landmarks" / "raw").glob("0*.npz"))
        or sorted((folder / "landmarks").glob("0*.npz"))
    )

    @cache
    def grey(frame: int) -> np.ndarray:
        return grey_of(source.read(camera.name, frame))

    frames_mm = np.load(true_folder / "vertices_mm.npy").astype(float)
    triangles = np.load(true_folder / "triangles.npy")
    hidden = studio.regions["teeth"] | studio.regions["eyes"] | studio.regions["mouth_inner"]
    skin = triangles[~hidden[: frames_mm.shape[1]][triangles].any(axis=1)]
    marked = np.stack([camera.project(frame[studio.landmarks]) for frame in frames_mm])
    material = material_points(detected.points_px[0], camera, skin, frames_mm)
    material[:, on_other_lip(material, marked)] = np.nan
    frames = expressive(marked)
    settings = CorrectionSettings(**changes)
    print(f"{name}: {len(frames_mm)} frames, inter-ocular {interocular_px(marked[0]):.0f} px")
    for frame in detected.frames:
        grey(int(frame))
    first = int(detected.frames[0])
    for kind, true_px, given in (
        ("material", material, {}),
        ("marked", marked, {first: marked[0]}),
    ):
        start = time.process_time()
        unbiased = without_offset(detected, given)
        keys = settle(grey, unbiased, find_key_frames(grey, unbiased, given), settings)
        chosen = time.process_time()
        track, _ = correct(grey, detected, keys, detected.frames, settings)
        done = time.process_time()
        print_errors(kind, true_px, detected.points_px, track.points_px, frames)
        n = len(detected.frames)
        print(f"  {len(keys.frames)} key frames; CPU ms a frame: key frames "
              f"{1e3 * (chosen - start) / n:.0f}, correction {1e3 * (done - chosen) / n:.0f}")  # fmt: skip
    if "models" in places:
        images = [source.read(camera.name, int(frame)) for frame in detected.frames[:20]]
        time_networks(places["models"], images)
    if (folder / "tracking" / "fit.npz").is_file():
        time_fit(root, subject, folder, detected)


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


def time_networks(models: str, images: list[np.ndarray], rounds: int = 5) -> None:
    """The least and the median of some rounds: other load only ever adds."""
    detector = NetworkDetector(models)
    detector.detect(images[0])
    whole, inside = [], []
    for _ in range(rounds):
        sessions = [TimedSession(detector._face), TimedSession(detector._landmarks)]
        detector._face, detector._landmarks = sessions
        start = time.process_time()
        for image in images:
            detector.detect(image)
        whole.append(1e3 * (time.process_time() - start) / len(images))
        inside.append(1e3 * sum(s.seconds for s in sessions) / len(images))
        detector._face, detector._landmarks = (s.session for s in sessions)
    best = int(np.argmin(whole))
    height, width = images[0].shape[:2]
    print(
        f"  landmarks, {width} x {height}: {whole[best]:.1f} CPU ms a frame (median of {rounds} rounds "
        f"{np.median(whole):.1f}): networks {inside[best]:.1f}, the rest {whole[best] - inside[best]:.1f}"
    )


def time_fit(root: Path, subject: str, folder: Path, track: LandmarkTrack) -> None:
    fit = TrackedTake.load(folder / "tracking" / "fit.npz")
    tracker = FaceModel.load(root / "face" / "tracker.npz")
    person = Identity.load(root / "subjects" / subject / "identity.npz")
    shape = LandmarkShape.of(tracker, person.identity, person.landmark_offset_mm)
    seen = Observations.of(track, fit.camera)
    start = time.process_time()
    fit_motion(shape, seen, focal_px(fit.camera), 30.0)
    spent = 1e3 * (time.process_time() - start) / len(track.frames)
    print(f"  expression and pose: {spent:.1f} CPU ms a frame")


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[2].startswith("models="):
        cv2.setNumThreads(1)
        any_source = open_frames(sys.argv[1], "", "")
        time_networks(sys.argv[2][7:], [any_source.read("", frame) for frame in range(20)])
        sys.exit()
    options = dict(item.split("=", 1) for item in sys.argv[3:])
    named = {
        key: options.pop(key) for key in ("captures", "truth", "camera", "models") if key in options
    }
    main(sys.argv[1], sys.argv[2], named, {key: float(value) for key, value in options.items()})
