"""Find and remove damaged results of a configuration, by their checksums.

    vermilion verify config/yours.yaml

What is removed is made again by the next run, and what follows from it.
"""

from __future__ import annotations

import argparse

from vermilion.app.subcommands import add_configuration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration."""
    add_configuration(parser)


def run(arguments: argparse.Namespace) -> int:
    """Verify in the project's folder."""
    from vermilion.app import place
    from vermilion.app.run import results_folder
    from vermilion.provenance.checksums import main

    configuration = place.enter_project_with(arguments.configuration)
    return main([str(results_folder(configuration))])
