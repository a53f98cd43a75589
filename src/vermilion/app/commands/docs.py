"""Regenerate the configuration reference and the schemas from the code."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def run(arguments: argparse.Namespace) -> int:
    """Write docs/configuration.md and workflow/schemas/."""
    from vermilion.app import place
    from vermilion.config.reference import write_all

    write_all(place.enter_project())
    return 0
