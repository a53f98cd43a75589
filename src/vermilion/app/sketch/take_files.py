"""Where the files of one guided take lie, as the configuration and the workflow say."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vermilion.app.run_files import PATHS, read_configuration, results_paths
from vermilion.config.external_base import sequences_of
from vermilion.config.guided import GuidedConfig
from vermilion.config.root import Configuration
from vermilion.config.takes import STUDIO, Take, eye_distances
from vermilion.imaging.source import Source, folder_of
from vermilion.storage.errors import InputError


@dataclass(frozen=True)
class TakeFiles:
    """One take of `guided.takes`, and the files that the page reads and writes.

    Attributes:
        configuration: path of the configuration, as Snakemake gets it.
        take: its row.
        sequence: what is corrected: `corrected`, `base` or `H`.
        guided: the section of the configuration.
        source: of the images.
        labels: folder of the sketches.
        face, neutral: model of the topology, the person's neutral in it.
        sequence_pattern, guided_pattern, maps_pattern, quality_pattern, refined_pattern: patterns with
            `*` for the chunk or frame.
        fit, cameras, suggestions, overlay: files of the take.
        results: folder of all results.
    """

    configuration: str
    take: Take
    sequence: str
    guided: GuidedConfig
    source: Source
    labels: Path
    face: Path
    neutral: Path
    sequence_pattern: Path
    guided_pattern: Path
    maps_pattern: Path
    quality_pattern: Path
    refined_pattern: Path
    fit: Path
    cameras: Path
    suggestions: Path
    overlay: Path
    results: Path

    @classmethod
    def of(cls, configuration: str, name: str, paths: Path = PATHS) -> TakeFiles:
        """Of the take `subject/take` of a configuration.

        Raises:
            ConfigurationError: a faulty configuration.
            InputError: no such configuration, or a take that it does not correct.
        """
        config, takes = read_configuration(configuration)
        if name not in config.guided.takes:
            named = ", ".join(config.guided.takes) or "no take"
            raise InputError(
                f"the take {name!r}, while `guided.takes` names {named}",
                "one of these takes",
                f"Say TAKE=subject/take, or add `guided: {{takes: {{{name}: base}}}}`.",
                path=configuration,
            )
        take = next(take for take in takes if take.name == name)
        sequence = config.guided.takes[name]
        patterns = results_paths(config, paths)

        def fill(pattern: str) -> Path:
            place = {"subject": take.subject, "take": take.take}
            return Path(pattern.format(**place, chunk="*", frame="*"))

        own_tracker = take.subject in {*config.tracking.scans, *eye_distances(takes)}
        tracker = patterns.own_tracker if own_tracker else patterns.tracker
        if sequences_of(takes):
            tracker = config.tracking.external.base.model or patterns.external_model
        of_sequence = {
            "base": patterns.coarse, "corrected": patterns.corrected, "H": patterns.accurate,
        }  # fmt: skip
        source = _source(take, config, str(fill(patterns.capture_folder)))
        is_rig = sequence == "H"
        return cls(
            configuration, take, sequence, config.guided, source, folder_of(source, "labels"),
            fill(patterns.template if is_rig else tracker),
            fill(patterns.neutral if is_rig else patterns.identity),
            fill(of_sequence[sequence]), fill(patterns.guided_chunk), fill(patterns.maps),
            fill(patterns.guided_quality), fill(patterns.refined), fill(patterns.fit),
            fill(patterns.cameras), fill(patterns.suggestions), fill(patterns.guided_overlay),
            Path(config.results),
        )  # fmt: skip

    @property
    def sequence_chunks(self) -> list[Path]:
        """Chunks of the sequence that exist."""
        return existing(self.sequence_pattern)

    @property
    def guided_chunks(self) -> list[Path]:
        """Chunks of the propagated sequence that exist."""
        return existing(self.guided_pattern)

    @property
    def targets(self) -> list[str]:
        """What the workflow is asked for when the page propagates."""
        return [str(self.suggestions), str(self.overlay)]

    def refined(self, frame: int) -> Path:
        """The workflow's refinement of a frame."""
        return self.refined_pattern.with_name(
            self.refined_pattern.name.replace("*", f"{frame:06d}")
        )


def existing(pattern: Path) -> list[Path]:
    """Files of a pattern whose last part has a `*`, ascending."""
    return sorted(pattern.parent.glob(pattern.name))


def _source(take: Take, config: Configuration, capture_folder: str) -> Source:
    """Where the images lie, as `source_of` of the workflow says it."""
    if take.source == STUDIO:
        return capture_folder
    capture = config.capture
    if not (capture.exr_layer or capture.colour_space):
        return take.source
    return {
        "path": take.source, "exr_layer": capture.exr_layer, "colour_space": capture.colour_space,
    }  # fmt: skip
