"""Remove results that only the next stages read: inpainted frames, contour maps, chunks of videos.

    vermilion clean-intermediate config/yours.yaml
    vermilion clean-intermediate config/yours.yaml -n        how much that is; nothing is removed

The run must be finished. What is removed is listed in `results/<name>/cleaned.txt` and not missed by later runs;
where something changes, the jobs that need it make it again.
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration."""
    parser.add_argument("configuration", help="a YAML file whose run is finished")
    parser.add_argument("-n", "--dry-run", action="store_true", help="only say how much it is")


def run(arguments: argparse.Namespace) -> int:
    """Clean in the project's folder."""
    from vermilion.app import place
    from vermilion.app.clean_intermediate import clean_intermediate

    print(clean_intermediate(place.enter_project_with(arguments.configuration), arguments.dry_run))
    return 0
