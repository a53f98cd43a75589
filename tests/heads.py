"""Generated heads that tests share: each is made once a run, so no test may change one."""

from __future__ import annotations

from functools import cache

from vermilion.faces.model import FaceModel
from vermilion.faces.procedural import studio_model, template_model, tracker_model

#: Weight of jawOpen in a template's neutral: a mouth slightly open.
SLIGHTLY_OPEN = 0.09


@cache
def studio() -> FaceModel:
    """As the studio uses it, without asymmetries."""
    return studio_model(seed=None)


@cache
def template() -> FaceModel:
    """The topology of H."""
    return template_model(SLIGHTLY_OPEN)


@cache
def tracker() -> FaceModel:
    """The topology of C."""
    return tracker_model(6000)


@cache
def small_studio() -> FaceModel:
    """A studio head of 2.4 mm spacing with four identities."""
    return studio_model(spacing_mm=2.4, n_identities=4)


@cache
def small_tracker() -> FaceModel:
    """A tracker of 2500 triangles with four identities."""
    return tracker_model(2500, n_identities=4)
