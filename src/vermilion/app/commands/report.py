"""Write the report of a finished run again, without running anything.

vermilion report config/yours.yaml
"""

from __future__ import annotations

import argparse

from vermilion.app.subcommands import add_configuration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration."""
    add_configuration(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write it from the project's folder."""
    from vermilion.app import place
    from vermilion.app.run import main

    return main(place.enter_project_with(arguments.configuration), ["--only-report"])
