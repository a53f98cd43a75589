"""Say what is missing for which command, and what to do about it."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def run(arguments: argparse.Namespace) -> int:
    """Print a line a finding; 1 where something is missing that every command needs."""
    from vermilion.app import place
    from vermilion.app.doctor import findings

    found = findings(place.enter_project())
    for finding in found:
        print(finding)
    return int(any(finding.state == "missing" for finding in found))
