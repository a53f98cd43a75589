"""Build the documentation site, with the configuration reference made anew from the code.

The site is in results/site; it opens offline and has search.
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """There are none."""


def run(arguments: argparse.Namespace) -> int:
    """As `make docs`, which also makes the environment of the site's generator."""
    import subprocess

    from vermilion.app import place

    place.enter_project()
    return subprocess.run(["make", "docs"], check=False).returncode
