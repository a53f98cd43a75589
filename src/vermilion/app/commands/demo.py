"""Rebuild everything for two synthetic subjects, and say where to look.

It renders captures of two synthetic actors, reconstructs them, trains regressors, measures them and corrects
a video: `config/config.yaml`. Further options go to Snakemake.
"""

from __future__ import annotations

import argparse

CONFIGURATION = "config/config.yaml"

PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none of its own."""


def run(arguments: argparse.Namespace) -> int:
    """Run the demo from the project's folder."""
    from vermilion.app import place
    from vermilion.app.run import main

    place.enter_project()
    return main(CONFIGURATION, arguments.options)
