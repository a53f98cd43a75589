"""Check the whole configuration at once, before any job runs."""

from __future__ import annotations

import reprlib
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vermilion.config.confined import allowed_folders, key_problems, sheet_problems
from vermilion.config.cross_checks import cross_checks
from vermilion.config.external_base import (
    external_problems,
    missing_files,
    with_external_base,
    with_frames_of_images,
)
from vermilion.config.moved import earlier_key, earlier_keys
from vermilion.config.own_head import missing_heads
from vermilion.config.root import Configuration
from vermilion.config.takes import STUDIO, Take, read_takes
from vermilion.config.yaml_file import read_yaml
from vermilion.imaging.frames import list_frames
from vermilion.imaging.images import AS_TAGGED, ImageReading, refusal
from vermilion.imaging.source import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_image, is_video
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
        f"{origin}, key {key}: found a key of an earlier version; {sentence}"
        for key, sentence in earlier_keys(raw).items()
    ]
    configuration = None
    try:
        configuration = Configuration.model_validate(raw)
    except ValidationError as error:
        # A key of an earlier version is unknown as well: it is named once.
        unknown = [item for item in error.errors() if not (problems and _is_earlier(item))]
        problems += [_sentence(origin, item) for item in unknown]
    sheet = raw.get("takes", Configuration.model_fields["takes"].default)
    folders = allowed_folders(raw) if check_disk else []
    leading_out = sheet_problems(str(sheet), folders)
    if leading_out:  # before anything there is opened
        raise ConfigurationError(problems + leading_out)
    takes, wrong = read_takes(str(sheet))
    problems += wrong + [f"{sheet}: {problem}" for problem in external_problems(takes)]
    takes = with_frames_of_images(takes)
    if configuration is not None:
        problems += [f"{origin}, key {problem}" for problem in cross_checks(configuration, takes)]
        names = [{"subject": take.subject, "take": take.take, "of": take.of} for take in takes]
        problems += [f"{origin}, {p}" for p in key_problems(configuration, names, folders)]
    if check_disk and configuration is not None:
        files = [*missing_files(configuration, takes), *missing_heads(configuration, takes)]
        problems += [f"{origin}, key {problem}" for problem in files]
    if check_disk:
        reading = AS_TAGGED if configuration is None else configuration.capture.reading
        for take in takes:
            problems += [f"{sheet}, take {take.name}: {p}" for p in check_source(take, reading)]
    if problems:
        raise ConfigurationError(problems)
    assert configuration is not None
    return with_external_base(configuration, takes), takes


def read_keys(path: str | Path) -> dict[str, Any]:
    """The keys of a configuration file as they stand there, unchecked.

    Raises:
        InputError: the file cannot be read, is no YAML, or holds no keys.
    """
    content = read_yaml(path) or {}
    if not isinstance(content, dict):
        raise InputError(
            f"a {type(content).__name__}", "keys and values", "See config/README.md.", path=path
        )
    return content


def check_source(take: Take, reading: ImageReading = AS_TAGGED) -> list[str]:
    """What is wrong with the source of a take on disk.

    Headers alone are read: of a video, and of the first image of each camera.
    """
    source = Path(take.source)
    if take.of and not source.exists():
        return [
            f"source: found no '{source}'; expected the mesh sequence of another tracker. Correct the "
            "path (relative to the folder where the workflow starts)."
        ]
    if take.source == STUDIO or take.role == "tracked":
        return []
    wanted = f"frames {take.first} to {take.last}"
    if not source.exists():
        return [
            f"source: found no '{source}'; expected a capture folder, a frame folder, a "
            "video or an image. Correct the path (relative to the folder where the workflow starts)."
        ]
    if source.is_file() and not is_image(source):
        if not is_video(source):
            return [
                f"source: found '{source.name}'; expected one of {', '.join(VIDEO_SUFFIXES + IMAGE_SUFFIXES)}. Convert a video: "
                f"`ffmpeg -i {source.name} -crf 12 {source.stem}.mp4`."
            ]
        from vermilion.imaging.video import VideoReader

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


def _is_earlier(item: ErrorDetails) -> bool:
    """Whether an error of the schema is a key of an earlier version."""
    key = ".".join(str(part) for part in item["loc"])
    return item["type"] == "extra_forbidden" and earlier_key(key) is not None


def _sentence(origin: str, item: ErrorDetails) -> str:
    key = ".".join(str(part) for part in item["loc"]) or "(top level)"
    found = item.get("input")
    if item["type"] == "extra_forbidden":
        return (
            f"{origin}, key {key}: found an unknown key; expected one of the reference in "
            "docs/configuration.md. Correct the spelling or remove it."
        )
    if item["type"] == "missing":
        return f"{origin}, key {key}: found nothing; expected a value. Add the key."
    return f"{origin}, key {key}: found {reprlib.repr(found)}; expected: {item['msg']}."
