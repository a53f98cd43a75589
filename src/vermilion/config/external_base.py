"""Another tracker as the base of a run: rows of role `tracked` that name a take in the column `of`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from vermilion.config.own_head import exported_takes
from vermilion.config.root import Configuration
from vermilion.config.takes import Take

#: Roles whose takes have a base.
BASE_ROLES = ("tattoo", "video")


def sequences_of(takes: Sequence[Take]) -> dict[str, Take]:
    """Name of a take, `subject/take` -> the row of the sequence that is its base."""
    return {_images(take): take for take in takes if take.role == "tracked" and take.of}


def with_frames_of_images(takes: Sequence[Take]) -> list[Take]:
    """The takes; sequences with the frames and the rate of the takes that they were tracked in."""
    by_name = {take.name: take for take in takes}
    result = []
    for take in takes:
        images = by_name.get(_images(take)) if take.of else None
        if images is not None:
            take = replace(take, first=images.first, last=images.last, fps=images.fps)
        result.append(take)
    return result


def external_problems(takes: Sequence[Take]) -> list[str]:
    """A sentence for each row whose `of` names no take that it can be the base of."""
    by_name = {take.name: take for take in takes}
    owner: dict[str, str] = {}
    problems = []
    for take in takes:
        if not take.of:
            continue
        images = by_name.get(_images(take))
        if take.role != "tracked":
            problems.append(
                f"take {take.name}, of: found '{take.of}' in a row of role {take.role}; expected nothing. "
                "Only a `tracked` sequence is of another take."
            )
        elif images is None or images.role not in BASE_ROLES:
            problems.append(
                f"take {take.name}, of: found '{take.of}'; expected a take of subject {take.subject} "
                f"of role {' or '.join(BASE_ROLES)}, whose images the sequence was tracked in."
            )
        elif images.name in owner:
            problems.append(
                f"take {take.name}, of: found '{take.of}', whose base is {owner[images.name]} already; "
                "expected one sequence a take. A run has one base."
            )
        else:
            owner[images.name] = take.name
    return problems


def flame_checks(configuration: Configuration, takes: Sequence[Take]) -> Iterator[str]:
    """Why FLAME's weights cannot be solved for the corrected lips, a sentence each."""
    if not configuration.apply.export.flame:
        return
    found = "apply.export.flame: found true; expected false, since"
    sequences = sequences_of(takes)
    bases = [sequences.get(take.name) for take in exported_takes(configuration, takes)]
    meshes = [row for row in bases if row is not None and not _may_be_flame(row.source)]
    on_h = [name for name, sequence in configuration.guided.takes.items() if sequence == "H"]
    if not sequences:
        yield f"{found} the base is our own tracker's, which has no parameters of FLAME."
    elif configuration.tracking.external.flame is None:
        yield (
            "tracking.external.flame: found nothing; expected your FLAME model, since apply.export.flame "
            "solves its weights. Convert it as docs/interchange.md says."
        )
    elif meshes:
        yield (
            f"{found} the base {meshes[0].name} is '{meshes[0].source}', which holds meshes. Name the "
            "tracker's parameters (.npz, or a folder of them) in the take sheet."
        )
    elif on_h:
        yield f"{found} guided.takes corrects the sequence H of {on_h[0]}, which has no parameters of FLAME."


def _may_be_flame(source: str) -> bool:
    """Whether a sequence has the form of parameters: an archive, or a folder of such, whose names are not looked at."""
    path = Path(source)
    if path.is_dir():
        return any(path.glob("*.npz"))
    return path.suffix.lower() == ".npz"


def external_checks(configuration: Configuration, takes: Sequence[Take]) -> Iterator[str]:
    """What the configuration and the sheet of a run with such a base lack, a sentence each."""
    sequences = sequences_of(takes)
    yield from flame_checks(configuration, takes)
    if not sequences:
        return
    without = [
        take.name
        for take in takes
        if take.role in BASE_ROLES and take.name not in sequences
        if take.name not in configuration.landmarks.training_takes
    ]
    if without:
        yield (
            f"takes: found no sequence of {', '.join(without)}; expected a `tracked` row whose `of` "
            "names it, since a run has one base and other takes have one. Add it, or take the rows "
            "out of the sheet."
        )
    if configuration.apply.export.topology == "full":
        yield (
            "apply.export.topology: found `full`; expected `tracker` or a head, since the base is a sequence "
            "of another tracker."
        )
    for key, used in {
        "apply.export.live_link": configuration.apply.export.live_link,
        "apply.makeup.enabled": configuration.apply.makeup.enabled,
        "detail.takes": configuration.detail.takes,
        "detail.relief.takes": configuration.detail.relief.takes,
    }.items():
        if used:
            yield (
                f"{key}: found {used}; expected nothing, since the base is a sequence of another "
                "tracker, and this stage needs our own face model's."
            )


def weights_path(configuration: Configuration, sequence: Take) -> str | None:
    """The CSV of blend weights of a sequence; None where the tracker gives none."""
    pattern = configuration.tracking.external.base.weights
    return pattern and pattern.format(subject=sequence.subject, take=sequence.take, of=sequence.of)


def missing_files(configuration: Configuration, takes: Sequence[Take]) -> Iterator[str]:
    """A sentence for each file of the base that the configuration names and that is not there."""
    base, sequences = configuration.tracking.external.base, sequences_of(takes)
    named = {"base.landmarks": [base.landmarks], "base.model": [base.model]}
    named["base.weights"] = [weights_path(configuration, row) for row in sequences.values()]
    named["flame"] = [configuration.tracking.external.flame]
    for key, paths in named.items():
        for path in paths if sequences else []:
            if path and not Path(path).is_file():
                yield (
                    f"tracking.external.{key}: found no '{path}'; expected a file. Correct the path "
                    "(relative to the folder where the workflow starts)."
                )


def with_external_base(configuration: Configuration, takes: Sequence[Take]) -> Configuration:
    """The configuration of a run whose base is another tracker's, where the sheet has such rows.

    Our own tracker rests, and the head stays where the sequence has it (`correction.image.repose`),
    unless the configuration says otherwise.
    """
    if not sequences_of(takes):
        return configuration
    tracking, correction = configuration.tracking, configuration.correction
    rests = {
        "image_fit": tracking.image_fit.model_copy(update={"enabled": False}),
        "offsets": tracking.offsets.model_copy(update={"enabled": False}),
    }
    image = correction.image
    if "repose" not in image.model_fields_set:
        image = image.model_copy(update={"repose": False})
    return configuration.model_copy(
        update={
            "tracking": tracking.model_copy(update=rests),
            "correction": correction.model_copy(update={"image": image}),
        }
    )


def _images(take: Take) -> str:
    """Name of the take whose images a sequence was tracked in."""
    return f"{take.subject}/{take.of}"
