"""Generated heads that tests share: each is made once a run, so no test may change one."""

from __future__ import annotations

from functools import cache

from vermilion.faces import procedural
from vermilion.faces.model import FaceModel


@cache
def small_tracker() -> FaceModel:
    """A tracker of 2500 triangles with four identities."""
    return procedural.tracker_model(2500, n_identities=4)


@cache
def small_studio() -> FaceModel:
    """A studio head of 2.4 mm spacing with four identities."""
    return procedural.studio_model(spacing_mm=2.4, n_identities=4)
