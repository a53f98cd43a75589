"""Say what is understood of the cameras of every take, and draw them over the images.

    vermilion cameras config/yours.yaml [--take subject/take]

The overlay (`<results>/cameras/<subject>-<take>.png`) shows, in the first frame of each camera, axes of
100 mm at the point that all cameras look at (x red, y green, z blue), and where the other cameras
stand. The point should lie in the face, and the axes should point alike in all images.
"""

from __future__ import annotations

import argparse

from vermilion.app.subcommands import add_configuration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration, and one take."""
    add_configuration(parser)
    parser.add_argument("--take", help="only this take, written subject/take")


def run(arguments: argparse.Namespace) -> int:
    """Print and draw in the project's folder."""
    from vermilion.app import place
    from vermilion.app.cameras import report

    return report(place.enter_project_with(arguments.configuration), arguments.take)
