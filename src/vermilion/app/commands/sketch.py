"""Draw the lips of a take in a browser.

    vermilion sketch config/yours.yaml subject/take
    vermilion sketch config/yours.yaml subject/take --port 8000 --cores 2 --no-browser

The configuration's `guided.takes` names the take, and it has been run once. The address is printed; Ctrl-C
ends the server.
"""

from __future__ import annotations

import argparse

PASSES_ON = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration and the take; the rest is the page's server's."""
    parser.add_argument("configuration", help="a YAML file")
    parser.add_argument("take", help="subject/take")


def run(arguments: argparse.Namespace) -> int:
    """Serve the page from the project's folder."""
    from vermilion.app import place
    from vermilion.app.sketch.__main__ import main

    return main(
        [place.enter_project_with(arguments.configuration), arguments.take, *arguments.options]
    )
