"""What the configuration and the take sheet say of each other: every take and subject exists."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from vermilion.config.external_base import external_checks, sequences_of
from vermilion.config.own_head import head_checks
from vermilion.config.root import Configuration
from vermilion.config.takes import STUDIO, Take, eye_distances

#: Roles whose takes have a coarse track and contours from one camera's images.
IMAGE_ROLES = ("video", "tattoo")


def cross_checks(configuration: Configuration, takes: list[Take]) -> Iterator[str]:
    """One sentence for each problem, which begins with the key."""
    by_name = {take.name: take for take in takes}
    subjects = {take.subject for take in takes}
    yield from _studio(configuration, takes, subjects)
    yield from _scans(configuration, subjects)
    yield from _eye_distances(configuration, takes)
    yield from _applied(configuration, by_name)
    yield from _neutral_frames(configuration, by_name)
    detail = configuration.detail
    yield from _detailed("detail.takes", detail.takes, by_name)
    yield from _detailed("detail.relief.takes", detail.relief.takes, by_name)
    yield from _guided(configuration, by_name)
    yield from head_checks(configuration)
    yield from external_checks(configuration, takes)
    for name in configuration.landmarks.training_takes:
        if name not in by_name:
            yield (
                f"landmarks.training_takes: found '{name}'; expected a take of the sheet, written "
                "subject/take."
            )


def _studio(configuration: Configuration, takes: list[Take], subjects: set[str]) -> Iterator[str]:
    studio = configuration.studio.subjects
    for take in takes:
        if take.source == STUDIO and take.subject not in studio:
            yield (
                f"studio.subjects: found {sorted(studio)}; expected also '{take.subject}', as take "
                f"{take.name} has the source `studio`."
            )
    for name in studio:
        if name not in subjects:
            yield (
                f"studio.subjects.{name}: found a subject without takes; expected a row of the take "
                "sheet. Add one or remove the subject."
            )


def _scans(configuration: Configuration, subjects: set[str]) -> Iterator[str]:
    for name, scan in configuration.tracking.scans.items():
        key = f"tracking.scans.{name}"
        if name not in subjects:
            yield (
                f"{key}: found a subject without takes; expected one of "
                f"{', '.join(sorted(subjects))}."
            )
        if configuration.landmarks.detector == "files" and not scan.landmarks:
            yield (
                f"{key}.landmarks: found nothing; expected a file, because landmarks.detector is "
                "`files` and nothing finds landmarks in images."
            )


def _eye_distances(configuration: Configuration, takes: list[Take]) -> Iterator[str]:
    for subject, distance in eye_distances(takes).items():
        if subject in configuration.tracking.scans:
            yield (
                f"tracking.scans.{subject}: found a scan, and eye_distance_mm {distance:g} in the take sheet; "
                "expected one of them, as a scan has a size of its own. Empty the cell, or remove the scan."
            )
        if sequences_of(takes):
            yield (
                f"takes: found eye_distance_mm {distance:g} of subject {subject}; expected none beside another "
                "tracker's sequence, which has a size of its own. Empty the cell."
            )


def _applied(configuration: Configuration, by_name: dict[str, Take]) -> Iterator[str]:
    for name in configuration.apply.takes:
        take = by_name.get(name)
        if take is None:
            yield (
                f"apply.takes: found '{name}'; expected a take of the sheet, written subject/take: "
                f"{', '.join(by_name) or 'none there'}."
            )
        elif take.role not in IMAGE_ROLES:
            yield (
                f"apply.takes: found '{name}' of role {take.role}; expected role video or tattoo. "
                "Only these have the features that a regressor needs."
            )


def _neutral_frames(configuration: Configuration, by_name: dict[str, Take]) -> Iterator[str]:
    with_rig = {take.subject for take in by_name.values() if take.role == "tattoo"}
    key = "correction.neutral_frames"
    for name, frame in configuration.correction.neutral_frames.items():
        take = by_name.get(name)
        if take is None or take.role != "video" or take.subject not in with_rig:
            yield (
                f"{key}: found '{name}'; expected a take of role video of a subject who has a take "
                "of role tattoo, written subject/take. Correct or remove it."
            )
        elif not take.first <= frame <= take.last:
            yield (
                f"{key}.{name}: found frame {frame}; expected one of {take.first} to {take.last}, "
                "the frames of the take."
            )


def _detailed(key: str, names: Iterable[str], by_name: dict[str, Take]) -> Iterator[str]:
    for name in names:
        if name not in by_name or by_name[name].role not in IMAGE_ROLES:
            yield (
                f"{key}: found '{name}'; expected a take of the sheet of role video or tattoo, "
                "written subject/take."
            )


def _guided(configuration: Configuration, by_name: dict[str, Take]) -> Iterator[str]:
    for name, sequence in configuration.guided.takes.items():
        roles = ("tattoo",) if sequence == "H" else IMAGE_ROLES
        if name not in by_name or by_name[name].role not in roles:
            yield (
                f"guided.takes: found '{name}' with the sequence {sequence}; expected a take of the "
                f"sheet of role {' or '.join(roles)}, written subject/take."
            )
    for name in configuration.guided.study.takes:
        take = by_name.get(name)
        if take is None or not (take.source == STUDIO or take.role == "tattoo"):
            yield (
                f"guided.study.takes: found '{name}'; expected a take of the sheet that the studio "
                "makes, or of role tattoo, written subject/take."
            )
