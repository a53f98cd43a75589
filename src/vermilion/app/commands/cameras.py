"""Say what is understood of the cameras of every take, and draw them over the images.

    vermilion cameras config/yours.yaml [--take subject/take]

The overlay (`<results>/cameras/<subject>-<take>.png`) shows, in the first frame of each camera, axes of
100 mm at the point that all cameras look at (x red, y green, z blue), and where the other cameras
stand. The point should lie in the face, and the axes should point alike in all images.
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration, and one take."""
    parser.add_argument(
        "configuration", nargs="?", default="config/config.yaml", help="a YAML file (the demo's)"
    )
    parser.add_argument("--take", help="only this take, written subject/take")


def run(arguments: argparse.Namespace) -> int:
    """Print and draw in the project's folder."""
    from pathlib import Path

    from vermilion.app import place
    from vermilion.app.cameras import report

    configuration = Path(arguments.configuration).absolute()
    place.enter_project()
    return report(configuration, arguments.take)
