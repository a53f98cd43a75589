"""Takes that a run leaves out (`skip_takes`), taken out of the sheet and of every list that names them."""

from __future__ import annotations

from vermilion.config.external_base import sequences_of
from vermilion.config.root import Configuration
from vermilion.config.takes import Take


def without_skipped(
    configuration: Configuration, takes: list[Take]
) -> tuple[Configuration, list[Take]]:
    """The configuration and the sheet as if the takes of `skip_takes` had never been named."""
    skipped = set(configuration.skip_takes)
    if not skipped:
        return configuration, takes
    # A take without its base is left out with it.
    skipped |= {name for name, row in sequences_of(takes).items() if row.name in skipped}

    def kept(names: list[str]) -> list[str]:
        return [name for name in names if name not in skipped]

    neutral = {
        name: frame
        for name, frame in configuration.correction.neutral_frames.items()
        if name not in skipped
    }
    detail, guided = configuration.detail, configuration.guided
    relief = detail.relief.model_copy(update={"takes": kept(detail.relief.takes)})
    sections = {
        "apply": configuration.apply.model_copy(update={"takes": kept(configuration.apply.takes)}),
        "correction": configuration.correction.model_copy(update={"neutral_frames": neutral}),
        "detail": detail.model_copy(update={"takes": kept(detail.takes), "relief": relief}),
        "guided": guided.model_copy(
            update={
                "takes": {n: s for n, s in guided.takes.items() if n not in skipped},
                "study": guided.study.model_copy(update={"takes": kept(guided.study.takes)}),
            }
        ),
        "landmarks": configuration.landmarks.model_copy(
            update={"training_takes": kept(configuration.landmarks.training_takes)}
        ),
    }
    rest = [take for take in takes if take.name not in skipped]
    return configuration.model_copy(update=sections), rest
