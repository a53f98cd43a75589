"""The small inputs of the data folder `cases`: what each should give, and what it gives.

Videos are compared with the one that they were made from, images with the plain one, cameras with those
of the sample capture (mean differences in display values, 0 to 255). `two_faces.mp4` and `cut.mp4` go
through the landmarks of mediapipe. The last row is no file: landmarks of a blink, fitted.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.common import add_data_argument, print_table
from tests.unit import test_fast_motion as motion
from vermilion.capture.video_facts import rate_warning, uneven_times, video_facts
from vermilion.config.landmarks import LandmarksConfig
from vermilion.external.read import read_tracked
from vermilion.geometry.camera import read_cameras
from vermilion.imaging.frames import list_frames
from vermilion.imaging.images import (
    AS_TAGGED,
    ImageReading,
    linear_to_srgb,
    read_image,
    srgb_to_linear,
)
from vermilion.imaging.video import VideoReader
from vermilion.landmarks.faces import SeenFaces, find_faces
from vermilion.landmarks.following import FaceChoice, FollowedFace, follow_face
from vermilion.landmarks.mediapipe import MediapipeDetector
from vermilion.storage.errors import InputError

#: What a case gives, and whether that is what it should.
Finding = tuple[str, bool]
#: Largest mean difference of an image that was encoded again, display values.
_SAME = 2.6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where the data and the environment of the landmarks are."""
    add_data_argument(parser)
    parser.add_argument(
        "--environment",
        default=LandmarksConfig().mediapipe.environment,
        metavar="FOLDER",
        help="environment of mediapipe (%(default)s)",
    )


def run(arguments: argparse.Namespace) -> None:
    """Look at all cases and print them."""
    data = arguments.data
    cases = data / "cases"
    address = VideoReader(data / "video" / "address.mp4")

    def video(name: str, frames: Sequence[tuple[int, int]], like: VideoReader = address) -> Finding:
        return same_images(VideoReader(cases / f"{name}.mp4"), like, frames)

    portrait = VideoReader(cases / "portrait_plain.mp4")
    rows: list[tuple[str, str, Callable[[], Finding]]] = [
        ("portrait_tagged.mp4", "portrait_plain.mp4",
         lambda: video("portrait_tagged", [(0, 0), (31, 31), (49, 49)], portrait)),
        ("hdr_pq.mp4", "address.mp4", lambda: video("hdr_pq", [(0, 0), (20, 20), (49, 49)])),
        ("interlaced.mp4", "its first fields", lambda: video("interlaced", [(10, 20), (49, 98)])),
        ("anamorphic.mp4", "1280x720", lambda: video("anamorphic", [(20, 20)])),
        ("variable_rate.mp4", "times used, warning", lambda: variable_rate(cases)),
        ("two_faces.mp4", "one of them, said", lambda: two_faces(cases, arguments.environment)),
        ("cut.mp4", "a cut at frame 25", lambda: cut(cases, arguments.environment)),
        *((f"images/{name}", should, lambda name=name: image(cases / "images", name))
          for name, should in IMAGES.items()),
        ("numbered/", "frames 1 to 3, 0 to 3", lambda: numbered(cases / "numbered")),
        *((f"{name}/", "the sample's cameras", lambda name=name: cameras(cases / name, data))
          for name in ("colmap_folders", "colmap_binary")),
        ("a blink's landmarks", "within 0.05", blink),
    ]  # fmt: skip
    table = []
    for name, should, look in rows:
        try:
            found, right = look()
        except InputError as error:
            found, right = f"refused: {error}", False
        table.append(
            {"case": name, "should": should, "gives": found, "right": "yes" if right else "no"}
        )
    print_table(table)
    print(f"{sum(row['right'] == 'yes' for row in table)} of {len(table)}")


def same_images(
    reader: VideoReader, like: VideoReader, frames: Sequence[tuple[int, int]]
) -> Finding:
    """Mean difference of frames of a video and those of another, and the size."""
    if reader.size != like.size:
        return f"{reader.size} for {like.size}", False
    apart = max(
        float(np.abs(reader.read(frame).astype(float) - like.read(other)).mean())
        for frame, other in frames
    )
    return f"{reader.size[0]}x{reader.size[1]}, {apart:.1f} apart", apart < _SAME


def variable_rate(cases: Path) -> Finding:
    """The times that the track is smoothed over, and the warning."""
    facts = video_facts(cases / "variable_rate.mp4")
    warning = rate_warning(facts, 25.0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.json"
        facts.save(path)
        times = uneven_times(path, np.arange(len(facts.stamps)))
    if times is None or not warning:
        return "even spacing", False
    steps = np.diff(times)
    return f"{steps.min():.2f} to {steps.max():.2f} s apart, warned", bool(np.ptp(steps) > 0)


def followed(path: Path, environment: str, face: Sequence[float] = ()) -> FollowedFace:
    """The face that is followed through a video; `face`: a point (px) that it is nearest to."""
    reader, options = VideoReader(path), LandmarksConfig().following
    choice = FaceChoice.of(face, options.least_eyes_px, options.person_difference)
    with tempfile.TemporaryDirectory() as folder, MediapipeDetector(environment) as detector:
        finds = find_faces(
            lambda frame: srgb_to_linear(reader.read(frame).astype(np.float32) / 255),
            lambda _, image: [] if image is None else detector.faces(image),
            range(reader.n_frames),
            detector.landmark_set,
        )
        finds.save(Path(folder) / "faces.npz")
        return follow_face(SeenFaces.load([Path(folder) / "faces.npz"]), choice)


def two_faces(cases: Path, environment: str) -> Finding:
    """One of two people in all frames: the largest, and the one that a point tells."""
    path = cases / "two_faces.mp4"
    width, height = VideoReader(path).size
    largest, left, right = (
        followed(path, environment, face)
        for face in ((), (0.25 * width, 0.4 * height), (0.75 * width, 0.4 * height))
    )
    lost = sum(int(np.count_nonzero(~found.valid)) for found in (largest, left, right))
    if lost:
        return f"{lost} frames without the face", False
    apart = (left.face != right.face).all()
    return str(largest.reason[0]), bool(apart) and "2 faces" in largest.reason[0]


def cut(cases: Path, environment: str) -> Finding:
    """Where the pieces of the clip begin."""
    found = followed(cases / "cut.mp4", environment)
    starts = found.frames[1:][np.diff(found.piece) != 0].tolist()
    return f"cut at {starts}", starts == [25]


IMAGES = {
    "exif_orientation_6.jpg": "plain.png",
    "grey_alpha.png": "plain.png, grey",
    "rgba.png": "plain.png",
    "sixteen_bit.png": "plain.png",
    "plain.dpx": "plain.png",
    "overscan.exr": "plain.png",
    "cropped_data_window.exr": "plain.png, black round it",
    "layers.exr": "the layer that is named",
}


def image(folder: Path, name: str) -> Finding:
    """Mean difference of an image to the plain one."""
    plain = shown(folder / "plain.png", AS_TAGGED)
    if name == "layers.exr":
        try:
            read_image(folder / name)
        except InputError:
            found = shown(folder / name, ImageReading(exr_layer="beauty"))
        else:
            return "a layer without being told which", False
    else:
        found = shown(folder / name, AS_TAGGED)
    if found.shape != plain.shape:
        return f"{found.shape}", False
    if name.startswith("grey"):
        plain = np.repeat((plain @ [0.299, 0.587, 0.114])[..., None], 3, axis=2)
    if name.startswith("cropped"):
        inside = np.zeros(plain.shape, dtype=bool)
        inside[20:160, 40:280] = True
        plain = np.where(inside, plain, 0.0)
    apart = float(np.abs(found - plain).mean())
    return f"{apart:.2f} apart", apart < _SAME


def shown(path: Path, reading: ImageReading) -> np.ndarray:
    """Display values (h, w, 3) of an image file."""
    return linear_to_srgb(read_image(path, reading)) * 255


def numbered(folder: Path) -> Finding:
    """Frames of the images and of the meshes."""
    images = list(list_frames(folder))
    meshes = read_tracked(folder, [0, 1, 2, 3]).vertices_mm.shape[0]
    return f"{images}, {meshes} meshes", images == [1, 2, 3] and meshes == 4


def cameras(folder: Path, data: Path) -> Finding:
    """Largest difference of the poses to those of the sample capture."""
    expected = read_cameras(data / "capture-sample/captures/p1/rom/cameras")
    found = read_cameras(folder)
    if list(found) != list(expected):
        return f"{list(found)}", False
    apart = max(
        float(np.abs(found[name].cam_from_world - expected[name].cam_from_world).max())
        for name in expected
    )
    return f"{len(found)} cameras, {apart:.0e} apart", apart < 1e-6


def blink() -> Finding:
    """Weights of a blink after the landmark fit."""
    worst, shown = 0.0, []
    for noise in (0.0, motion.QUIET):
        found = motion.fitted(motion.blinking(), noise)[17:22, motion.LIDS].mean(axis=1)
        worst = max(worst, float(np.abs(found - motion.BLINK).max()))
        shown.append(", ".join(f"{value:.2f}" for value in found[1:4]))
    return "; ".join(shown), worst < 0.05
