"""Say where to look when a run has ended."""

from __future__ import annotations

import sys
from pathlib import Path

from vermilion.report.headline import closing_table
from vermilion.storage.tables import read_table


def summary(results: Path) -> list[str]:
    """Lines for the terminal: the headline, flagged frames, and the files to open."""
    lines = []
    table = results / "evaluation" / "headline.tsv"
    if table.is_file():
        found = read_table(table)
        lines += ["", "Held-out frames, all takes together; `null` has learnt nothing:"]
        lines += [closing_table(found), ""]
    quality = results / "quality.tsv"
    if quality.is_file():
        lines.append(f"{len(read_table(quality))} flagged frame(s): {quality}")
    for name, what in (
        ("report.html", "report"),
        ("evaluation/summary.html", "what was built and how accurate it is"),
        ("evaluation/measures.tsv", "every measure"),
        ("database/lips.h5", "database"),
    ):
        if (results / name).is_file():
            lines.append(f"{what}: {results / name}")
    for page in sorted(results.glob("apply/*/*/lips.html")):
        lines.append(f"video beside result: {page}")
    for overlay in sorted(results.glob("apply/*/*/overlay.mp4")):
        lines.append(f"corrected video: {overlay}")
    return lines


if __name__ == "__main__":
    print("\n".join(summary(Path(sys.argv[1]))))
