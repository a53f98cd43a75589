"""Check the whole configuration at once, before any job runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vermilion.config.moved import moved_keys, new_key
from vermilion.config.root import Configuration
from vermilion.config.takes import STUDIO, Take, read_takes
from vermilion.imaging.frames import list_frames
from vermilion.imaging.images import AS_TAGGED, IMAGE_SUFFIXES, ImageReading, refusal
from vermilion.imaging.source import VIDEO_SUFFIXES, is_video
from vermilion.imaging.video import VideoReader
from vermilion.storage.errors import ConfigurationError, InputError, VermilionError


def load_configuration(
    raw: dict[str, Any], origin: str, check_disk: bool = True
) -> tuple[Configuration, list[Take]]:
    """Validate the merged configuration and its take sheet.

    Args:
        raw: the configuration as read from YAML and the command line.
        origin: file name(s) for the messages.
        check_disk: also check that sources and frame ranges exist (the main process does).

    Raises:
        ConfigurationError: listing every problem of both files.
    """
    problems = [
        f"{origin}, key {old}: found a key of an earlier version; expected {new}. Rename it."
        for old, new in moved_keys(raw).items()
    ]
    configuration = None
    try:
        configuration = Configuration(**raw)
    except ValidationError as error:
        # A moved key is unknown as well: it is named once, with its new name.
        unknown = [item for item in error.errors() if not (problems and _is_moved(item))]
        problems += [_sentence(origin, item) for item in unknown]
    sheet = raw.get("takes", Configuration.model_fields["takes"].default)
    takes, wrong = read_takes(str(sheet))
    problems += wrong
    if configuration is not None:
        problems += _cross_checks(configuration, takes, origin)
    if check_disk:
        reading = AS_TAGGED if configuration is None else configuration.capture.reading
        for take in takes:
            problems += [f"{sheet}, take {take.name}: {p}" for p in check_source(take, reading)]
    if problems:
        raise ConfigurationError(problems)
    assert configuration is not None
    return configuration, takes


def check_source(take: Take, reading: ImageReading = AS_TAGGED) -> list[str]:
    """What is wrong with the source of a take on disk.

    Headers alone are read: of a video, and of the first image of each camera.
    """
    if take.source == STUDIO or take.role == "tracked":
        return []
    source = Path(take.source)
    wanted = f"frames {take.first} to {take.last}"
    if not source.exists():
        return [
            f"source: found no '{source}'; expected a capture folder, a frame folder or a "
            "video. Correct the path (relative to the folder where the workflow starts)."
        ]
    if source.is_file():
        if not is_video(source):
            return [
                f"source: found '{source.name}'; expected one of {', '.join(VIDEO_SUFFIXES)}. Convert "
                f"it: `ffmpeg -i {source.name} -crf 12 {source.stem}.mp4`."
            ]
        try:
            reader = VideoReader(source)
            count, _ = reader.n_frames, reader.size
        except VermilionError as error:
            return [str(error)]
        if take.last >= count:
            return [
                f"source: found {count} frames in '{source}'; expected {wanted} (counted from "
                f"0). Set `last` to at most {count - 1}."
            ]
        return []
    folders = sorted(p for p in (source / "frames").glob("*") if p.is_dir()) or [source]
    problems = []
    for folder in folders:
        try:
            present = list_frames(folder)
        except InputError as error:
            problems.append(str(error))
            continue
        problems += _refused(present, take, reading)
        missing = [f for f in take.frames if f not in present]
        # A camera may miss frames (they are flagged later); a take may not lie outside the disk.
        if len(missing) == len(take.frames) or take.last > max(present, default=-1):
            span = f"{min(present)} to {max(present)}" if present else f"none{_others(folder)}"
            problems.append(
                f"source: found frames {span} in '{folder}'; expected {wanted}. Correct "
                "`first` and `last`, or export the frames."
            )
    return problems


def _others(folder: Path) -> str:
    """What lies in a folder in place of images that are read, for a message."""
    found = sorted({p.suffix.lower() for p in folder.iterdir() if p.is_file() and p.suffix})
    return f" (files of {', '.join(found)}; read are {', '.join(IMAGE_SUFFIXES)})" if found else ""


def _refused(present: dict[int, Path], take: Take, reading: ImageReading) -> list[str]:
    """Why the first image of a take is of a kind that is not read; damaged ones are flagged later."""
    first = next((path for frame, path in present.items() if frame in take.frames), None)
    if first is None:
        return []
    reason = refusal(first, reading)
    return [reason] if reason else []


def _cross_checks(configuration: Configuration, takes: list[Take], origin: str) -> list[str]:
    problems = []
    subjects = {take.subject for take in takes}
    by_name = {take.name: take for take in takes}
    studio = configuration.studio.subjects
    for take in takes:
        if take.source == STUDIO and take.subject not in studio:
            problems.append(
                f"{origin}, key studio.subjects: found {sorted(studio)}; expected "
                f"also '{take.subject}', as take {take.name} has the source `studio`."
            )
    for name in studio:
        if name not in subjects:
            problems.append(
                f"{origin}, key studio.subjects.{name}: found a subject without takes; "
                "expected a row of the take sheet. Add one or remove the subject."
            )
    for name, scan in configuration.tracking.scans.items():
        key = f"{origin}, key tracking.scans.{name}"
        if name not in subjects:
            problems.append(
                f"{key}: found a subject without takes; expected one of {', '.join(sorted(subjects))}."
            )
        if configuration.landmarks.detector == "csv" and not scan.landmarks:
            problems.append(
                f"{key}.landmarks: found nothing; expected a file, as landmarks.detector is `csv` and "
                "nothing looks for landmarks in images."
            )
    for name in configuration.apply.takes:
        if name not in by_name:
            problems.append(
                f"{origin}, key apply.takes: found '{name}'; expected a take of the "
                f"sheet, written subject/take: {', '.join(by_name) or 'none there'}."
            )
    for name in configuration.apply.takes:
        if name in by_name and by_name[name].role not in ("video", "tattoo"):
            problems.append(
                f"{origin}, key apply.takes: found '{name}' of role {by_name[name].role}; expected "
                "role video or tattoo. Only these have the features that a regressor needs."
            )
    with_rig = {take.subject for take in takes if take.role == "tattoo"}
    for name, frame in configuration.correction.neutral_frames.items():
        key, take = f"{origin}, key correction.neutral_frames", by_name.get(name)
        if take is None or take.role != "video" or take.subject not in with_rig:
            problems.append(
                f"{key}: found '{name}'; expected a take of role video of a subject who has a take of "
                "role tattoo, written subject/take. Correct or remove it."
            )
        elif not take.first <= frame <= take.last:
            problems.append(
                f"{key}.{name}: found frame {frame}; expected one of {take.first} to {take.last}, the "
                "frames of the take."
            )
    refined = {
        "takes": configuration.detail.takes,
        "relief.takes": configuration.detail.relief.takes,
    }
    for key, names in refined.items():
        for name in names:
            if name not in by_name or by_name[name].role not in ("video", "tattoo"):
                problems.append(
                    f"{origin}, key detail.{key}: found '{name}'; expected a take of the sheet of "
                    "role video or tattoo, written subject/take."
                )
    for name, sequence in configuration.guided.takes.items():
        roles = ("tattoo",) if sequence == "H" else ("video", "tattoo")
        if name not in by_name or by_name[name].role not in roles:
            problems.append(
                f"{origin}, key guided.takes: found '{name}' with the sequence {sequence}; expected a "
                f"take of the sheet of role {' or '.join(roles)}, written subject/take."
            )
    for name in configuration.guided.study.takes:
        take = by_name.get(name)
        if take is None or not (take.source == STUDIO or take.role == "tattoo"):
            problems.append(
                f"{origin}, key guided.study.takes: found '{name}'; expected a take of the sheet that "
                "the studio makes, or of role tattoo, written subject/take."
            )
    for name in configuration.landmarks.training_takes:
        if name not in by_name:
            problems.append(
                f"{origin}, key landmarks.training_takes: found '{name}'; expected a "
                f"take of the sheet, written subject/take."
            )
    return problems


def _is_moved(item: dict[str, Any]) -> bool:
    """Whether an error of the schema is an unknown key that has moved."""
    key = ".".join(str(part) for part in item["loc"])
    return item["type"] == "extra_forbidden" and new_key(key) is not None


def _sentence(origin: str, item: dict[str, Any]) -> str:
    key = ".".join(str(part) for part in item["loc"]) or "(top level)"
    found = item.get("input")
    if item["type"] == "extra_forbidden":
        return (
            f"{origin}, key {key}: found an unknown key; expected one of the reference in "
            "docs/configuration.md. Correct the spelling or remove it."
        )
    if item["type"] == "missing":
        return f"{origin}, key {key}: found nothing; expected a value. Add the key."
    return f"{origin}, key {key}: found {found!r}; expected: {item['msg']}."
