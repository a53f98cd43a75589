"""Fixtures of the inpainting tests: a lip patch, its chart and its textures."""

from __future__ import annotations

import pytest

from tests import lip_patch
from vermilion.geometry.raycast import RayCaster
from vermilion.inpaint.bake import bake
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.tattoo import feather_mask, tattoo_mask


@pytest.fixture(scope="session")
def model():
    return lip_patch.face_model()


@pytest.fixture(scope="session")
def domain(model):
    return lip_domain(model, skin_mm=9.0, inner_mm=4.0, texel_mm=0.3)


@pytest.fixture(scope="session")
def textures(model, domain):
    """Plain and tattooed neutral from all cameras, tattooed neutral from the front."""
    rest, rig = model.neutral_mm, lip_patch.cameras()

    def baked(tattoo, names):
        views = [(rig[n], lip_patch.render(model, rest, rig[n], tattoo)) for n in names]
        return bake(domain, RayCaster(rest, model.triangles), rest, views)

    return baked(False, rig), baked(True, rig), baked(True, ["front"])


@pytest.fixture(scope="session")
def opacity(domain, textures):
    mask = tattoo_mask(domain, textures[1], textures[0], reach_mm=4.0, sensitivity=6.0)
    return feather_mask(domain, mask, border_mm=0.6, feather_mm=1.0)
