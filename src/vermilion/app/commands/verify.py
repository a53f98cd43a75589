"""Find and remove damaged results of a configuration, by their checksums.

    vermilion verify config/yours.yaml

What is removed is made again by the next run, and what follows from it.
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration."""
    parser.add_argument(
        "configuration", nargs="?", default="config/config.yaml", help="a YAML file (the demo's)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Verify in the project's folder."""
    from pathlib import Path

    from vermilion.app import place
    from vermilion.app.run import results_folder
    from vermilion.provenance.checksums import main

    configuration = Path(arguments.configuration).absolute()
    place.enter_project()
    return main([str(results_folder(configuration))])
