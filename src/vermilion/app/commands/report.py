"""Write the report of a finished run again, without running anything.

vermilion report config/yours.yaml
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration."""
    parser.add_argument(
        "configuration", nargs="?", default="config/config.yaml", help="a YAML file (the demo's)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write it from the project's folder."""
    from pathlib import Path

    from vermilion.app import place
    from vermilion.app.run import main

    configuration = Path(arguments.configuration).absolute()
    project = place.enter_project()
    return main(place.from_here(configuration, project), ["--only-report"])
