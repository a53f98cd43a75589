"""Train the generic regressor on synthetic people, and put it into `models/`.

    vermilion generic
    vermilion generic -n                                what would run
    vermilion generic --people 12                       of the first twelve people of the sheet alone
    vermilion generic --configuration config/mine.yaml

Sixty actors of the studio are rendered and tracked as a video of an unseen person is; what their tracks get
wrong in the motion of the lips is learnt from their truth (docs/database.md): `config/generic.yaml`. Further
options go to Snakemake. An interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse

CONFIGURATION = "config/generic.yaml"

PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration; what follows goes to Snakemake."""
    parser.add_argument("--configuration", default=CONFIGURATION, help="a YAML file (%(default)s)")
    parser.add_argument("--people", type=int, help="so many people of the sheet; default all")


def run(arguments: argparse.Namespace) -> int:
    """Run it from the project's folder."""
    from vermilion.app.generic import make_generic

    return make_generic(arguments.configuration, arguments.people, arguments.options)
