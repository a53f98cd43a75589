"""A memory for Snakemake's question which rules could make a file."""

from __future__ import annotations

from typing import Any


def remember_producers(output_index: Any) -> None:
    """Let Snakemake's `OutputIndex` remember which rules could make a file.

    It tries the patterns of a dozen rules on each file for each job that reads it: a fifth of the time of a run in
    which nothing is to be done. The rules do not change while the graph is made. A Snakemake without these names is
    left as it is.
    """
    look_up = getattr(output_index, "match_producers", None)
    if look_up is None or hasattr(look_up, "remembers"):
        return

    def match_producers(self: Any, targetfile: str) -> Any:
        known = self.__dict__.setdefault("_known_producers", {})
        name = str(targetfile)
        if name not in known:
            known[name] = look_up(self, targetfile)
        return known[name]

    match_producers.remembers = True  # type: ignore[attr-defined]
    output_index.match_producers = match_producers
