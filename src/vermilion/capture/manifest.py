"""The manifest of a chunk: every image with its size and hash, and what is wrong with it."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from vermilion.capture.camera_files.read import read_given_cameras
from vermilion.capture.checks import check_image, header_size
from vermilion.capture.video_facts import VideoFacts, field_warning, rate_warning, video_facts
from vermilion.imaging.frames import list_frames, reading_of
from vermilion.imaging.images import AS_TAGGED, ImageReading, refusal
from vermilion.imaging.source import Source, folder_of, is_video, source_path
from vermilion.storage.errors import InputError, describe_problem
from vermilion.storage.files import write_text
from vermilion.storage.json_files import load_json
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Manifest:
    """What a chunk of a take holds.

    Attributes:
        source: a path, or a path with how its images are read (see `imaging.source`).
        kind: `capture` (folders of frames of named cameras), `frames` (one folder, or one image) or `video`.
        cameras: name -> {width_px, height_px, channels, bits}; the size the images should have.
        frames: camera -> frame -> facts of the file (empty for a video).
        bad: camera -> frame -> reason.
        video: facts of the video file, empty otherwise.
        warnings: what is true of the whole take and stops nothing.
    """

    subject: str
    take: str
    source: str | dict[str, str]
    kind: str
    cameras: dict[str, dict] = field(default_factory=dict)
    frames: dict[str, dict[int, dict]] = field(default_factory=dict)
    bad: dict[str, dict[int, str]] = field(default_factory=dict)
    video: dict = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def save(self, path: str | Path) -> None:
        """Write as JSON, sorted, whole or not at all."""
        content = {"format_version": FORMAT_VERSION, **self.__dict__}
        write_text(path, json.dumps(content, indent=1, sort_keys=True) + "\n")


def load_manifest(path: str | Path) -> Manifest:
    """Read what `Manifest.save` wrote. Raises InputError on another or damaged file."""
    try:
        content = load_json(path)
        version = content.pop("format_version")
        if version != FORMAT_VERSION:
            raise ValueError(f"format {version}")
        for name in ("frames", "bad"):
            content[name] = {
                camera: {int(frame): value for frame, value in rows.items()}
                for camera, rows in content[name].items()
            }
        return Manifest(**content)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"an unreadable manifest ({error})",
            f"a manifest of format {FORMAT_VERSION}",
            "Remove the file and run again.",
            path=path,
        ) from error


def capture_manifest(
    source: Source,
    subject: str,
    take: str,
    frames: Sequence[int],
    cameras: Sequence[str] | None = None,
    hash_decoded: bool = False,
    video: VideoFacts | None = None,
    fps: float | None = None,
) -> Manifest:
    """Check the images of a chunk.

    An image that is missing, truncated, unreadable or wrongly sized is listed in `bad` and the
    take goes on.

    Args:
        source: capture folder, folder of frames, video file, or image.
        frames: frame numbers of the chunk.
        cameras: names to check; all of the rig by default.
        hash_decoded: also hash the decoded frames of a video.
        video: facts of the video file, where they were found before; else it is read here.
        fps: rate of the take sheet, to warn where the video's differs; None: not compared.

    Raises:
        InputError listing everything that stops the take: a camera of the rig without images, or
        whose images all disagree with its calibration, or are of a kind that is not read.
    """
    reading, named = reading_of(source), source
    source = source_path(source)
    if is_video(source):
        facts = video or video_facts(source)
        manifest = _video_manifest(source, subject, take, frames, cameras, hash_decoded, facts)
        found = field_warning(facts), "" if fps is None else rate_warning(facts, fps)
        return replace(manifest, warnings=[warning for warning in found if warning])
    rig = source / "frames"
    kind = "capture" if rig.is_dir() else "frames"
    folders = (
        {path.name: path for path in sorted(rig.iterdir()) if path.is_dir()} if rig.is_dir() else {}
    )
    if not rig.is_dir():
        folders = {cameras[0] if cameras else "cam": source}
    sizes = _calibrated_sizes(source)
    wanted = list(cameras) if cameras else sorted(set(folders) | set(sizes))
    place = {"subject": subject, "take": take}
    kept = dict(named) if isinstance(named, Mapping) else str(named)
    manifest = Manifest(subject, take, kept, kind)
    problems = []
    for camera in wanted:
        paths = list_frames(folders[camera]) if camera in folders else {}
        unusable = _unusable(paths, folders.get(camera, rig / camera), reading, camera, place)
        problems += (
            [unusable]
            if unusable
            else _check_camera(manifest, camera, paths, frames, sizes, source, reading)
        )
    if problems:
        raise _fatal(problems, source, place)
    return manifest


def _unusable(
    paths: dict[int, Path], folder: Path, reading: ImageReading, camera: str, place: dict
) -> str:
    """Why a camera stops the take: it has no images, or of a kind that is not read; else empty."""
    if paths:
        return refusal(next(iter(paths.values())), reading, camera=camera, **place)
    return describe_problem(
        "no image",
        "numbered frames of every camera of the rig",
        "Add the camera's frames, or take it out of the rig.",
        camera=camera,
        path=folder,
        **place,
    )


def _check_camera(
    manifest: Manifest,
    camera: str,
    paths: dict[int, Path],
    frames: Sequence[int],
    sizes: dict[str, tuple[int, int]],
    source: Path,
    reading: ImageReading = AS_TAGGED,
) -> list[str]:
    """Check one camera's images of the chunk, filling the manifest; returns fatal problems."""
    calibrated = sizes.get(camera)
    expected = calibrated or _common_size(paths, reading)
    facts, bad = {}, {}
    for frame in progress(frames, f"{manifest.subject}/{manifest.take} {camera}"):
        found, reason = check_image(paths.get(frame, source / "missing"), source, expected, reading)
        if found is not None:
            facts[frame] = asdict(found)
        if reason:
            bad[frame] = reason
    given = (
        [header_size(path, reading) for path in paths.values()] if len(bad) == len(frames) else []
    )
    if calibrated and given and calibrated not in given:
        return [
            describe_problem(
                f"images of {_times(Counter(given).most_common(1)[0][0])}",
                f"{_times(calibrated)}, as the calibration says",
                "Calibrate again at this size, or export the frames at the calibrated size.",
                subject=manifest.subject,
                take=manifest.take,
                camera=camera,
                path=next(iter(paths.values())).parent,
            )
        ]
    first = next(iter(facts.values()), {})
    manifest.cameras[camera] = {
        "width_px": expected[0] if expected else 0,
        "height_px": expected[1] if expected else 0,
        "channels": first.get("channels", 0),
        "bits": first.get("bits", 0),
    }
    manifest.frames[camera] = facts
    if bad:
        manifest.bad[camera] = bad
    return []


def _common_size(paths: dict[int, Path], reading: ImageReading) -> tuple[int, int] | None:
    """The commonest (width, height) of readable images."""
    known = [size for path in paths.values() if (size := header_size(path, reading))]
    return Counter(known).most_common(1)[0][0] if known else None


def _times(size: tuple[int, int] | None) -> str:
    return f"{size[0]}x{size[1]}" if size else "no readable size"


def _calibrated_sizes(source: Path) -> dict[str, tuple[int, int]]:
    """Camera -> (width, height) where the capture brings its calibration."""
    folder = folder_of(source, "cameras")
    if not folder.is_dir():
        return {}
    cameras = read_given_cameras(folder, {}).cameras
    return {name: (camera.width_px, camera.height_px) for name, camera in cameras.items()}


def _video_manifest(
    source: Path,
    subject: str,
    take: str,
    frames: Sequence[int],
    cameras: Sequence[str] | None,
    hash_decoded: bool,
    facts: VideoFacts,
) -> Manifest:
    from vermilion.imaging.video import VideoReader

    reader = VideoReader(source, facts.index)
    place = {"subject": subject, "take": take}
    camera = cameras[0] if cameras else "cam"
    width, height = reader.size
    bad, decoded = {}, {}
    for frame in progress(frames, f"{subject}/{take}"):
        try:
            pixels = reader.read(frame, camera=camera, **place)
        except InputError as error:
            bad[frame] = error.brief
            continue
        if pixels.shape[:2] != (height, width):
            bad[frame] = f"size {pixels.shape[1]}x{pixels.shape[0]}, expected {width}x{height}"
        if hash_decoded:
            decoded[frame] = {"sha256_rgb8": hashlib.sha256(pixels.tobytes()).hexdigest()}
    size = {"width_px": width, "height_px": height, "channels": 3, "bits": 8}
    return Manifest(
        subject,
        take,
        str(source),
        "video",
        {camera: size},
        {camera: decoded} if decoded else {},
        {camera: bad} if bad else {},
        facts.summary(),
    )


def _fatal(problems: list[str], source: Path, place: dict) -> InputError:
    lines = "\n".join(f"  {i}. {problem}" for i, problem in enumerate(problems, start=1))
    return InputError(
        f"{len(problems)} problem(s) that stop the take:\n{lines}\n",
        "every camera of the rig with images that fit its calibration",
        "Mend all of them, then run again.",
        path=source,
        **place,
    )


def quality_rows(
    manifest: Manifest, frames: Sequence[int], needed: Sequence[str] = ()
) -> list[QualityRow]:
    """A row a frame: invalid without a `needed` camera or without half of the cameras.

    A frame that lacks some other image is valid but names it in its reason; the first frame names
    what the manifest warns of.
    """
    rows = []
    for frame in frames:
        lacking = {c: reasons[frame] for c, reasons in manifest.bad.items() if frame in reasons}
        reasons = [f"{camera}: {why}" for camera, why in sorted(lacking.items())]
        reason = "; ".join([*reasons, *(manifest.warnings if frame == frames[0] else [])])
        usable = len(manifest.cameras) - len(lacking)
        valid = not (set(lacking) & set(needed)) and usable > 0
        valid = valid and 2 * usable > len(manifest.cameras)
        figures = {"cameras": len(manifest.cameras), "cameras_bad": len(lacking)}
        rows.append(QualityRow(frame, valid, reason, figures))
    return rows
