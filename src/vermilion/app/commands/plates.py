"""Take out the frontal images without tattoo, with their camera, for another tracker to run on.

    vermilion plates config/yours.yaml [--take subject/take] [--format png|exr|mov] [--out FOLDER]

Writes `<out>/<subject>-<take>/`: the images without lens distortion (numbered PNG or EXR, or one ProRes file),
and the camera as COLMAP text model, USD and JSON. `<out>` is `<results>/plates` where left out. What the tracker
makes of them comes back as the take's mesh sequence (docs/howto/tracker.md).
"""

from __future__ import annotations

import argparse

from vermilion.app.subcommands import add_configuration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The configuration, the take, the format and the folder."""
    add_configuration(parser)
    parser.add_argument("--take", help="only this take, written subject/take")
    parser.add_argument("--format", choices=("png", "exr", "mov"), default="png", help="of images")
    parser.add_argument("--out", help="folder to write (<results>/plates)")


def run(arguments: argparse.Namespace) -> int:
    """Write in the project's folder."""
    from pathlib import Path

    from vermilion.app import place
    from vermilion.app.plates import write_plates_of

    out = Path(arguments.out).absolute() if arguments.out else None
    configuration = place.enter_project_with(arguments.configuration)
    return write_plates_of(configuration, arguments.take, arguments.format, out)
