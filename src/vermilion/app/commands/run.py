"""Run the workflow for a configuration, then say where to look.

    vermilion run config/yours.yaml
    vermilion run config/yours.yaml -n                  what would run, and why
    vermilion run config/yours.yaml --cores 8 regressors

What follows the configuration goes to Snakemake. A take that fails is named with its reason and left out;
everything else is made. One line says how far the run is; what Snakemake prints is in
`results/<name>/logs/snakemake.log`.
"""

from __future__ import annotations

import argparse

PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration; what follows goes to Snakemake."""
    parser.add_argument("configuration", help="a YAML file")


def run(arguments: argparse.Namespace) -> int:
    """Run it from the project's folder."""
    from vermilion.app import place
    from vermilion.app.run import main

    return main(place.enter_project_with(arguments.configuration), arguments.options)
