"""What the configuration says of the user's own head, the mesh of exported files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from vermilion.config.root import Configuration
from vermilion.config.takes import Take

_KEY = "apply.export.topology"


def head_checks(configuration: Configuration) -> Iterator[str]:
    """A sentence for each key that does not go with a head as the mesh of the files."""
    export = configuration.apply.export
    if configuration.apply.head_of("") is None:
        if export.head.landmarks:
            yield (
                f"apply.export.head.landmarks: found a file; expected nothing, since {_KEY} is "
                f"`{export.topology}`. Name your head there."
            )
        return
    if configuration.landmarks.detector == "files" and not export.head.landmarks:
        yield (
            "apply.export.head.landmarks: found nothing; expected a file, because landmarks.detector is "
            "`files` and nothing finds landmarks in images."
        )
    for name, sequence in configuration.guided.takes.items():
        if sequence == "H":
            yield (
                f"{_KEY}: found '{export.topology}'; expected `tracker` or `full`, since guided.takes "
                f"corrects the sequence H of {name}, which has no blend shapes that a head could follow."
            )


def exported_takes(configuration: Configuration, takes: Sequence[Take]) -> list[Take]:
    """The takes whose corrected files are written."""
    options = configuration.apply
    chosen = [*options.takes, *configuration.guided.takes]
    return [
        take
        for take in takes
        if take.name in chosen or (not options.takes and take.role == "video")
    ]


def missing_heads(configuration: Configuration, takes: Sequence[Take]) -> Iterator[str]:
    """A sentence for each file of a head that is not there."""
    options = configuration.apply
    for subject in dict.fromkeys(take.subject for take in exported_takes(configuration, takes)):
        head = options.head_of(subject)
        if head is None:
            continue
        landmarks = (options.export.head.landmarks or "").replace("{subject}", subject)
        for key, path in ((_KEY, head), ("apply.export.head.landmarks", landmarks)):
            if path and not Path(path).is_file():
                yield (
                    f"{key}: found no '{path}'; expected a file for subject {subject}. Correct the path "
                    "(relative to the folder where the workflow starts)."
                )
