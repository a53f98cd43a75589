"""The inpainting has the same defaults in the library and in the configuration, field by field."""

from __future__ import annotations

from dataclasses import MISSING, fields

import pytest

from vermilion.config.inpaint import CompositeConfig, DomainConfig, OpeningConfig, ShadingConfig
from vermilion.inpaint.frame import InpaintInputs
from vermilion.inpaint.opening import OpeningSettings
from vermilion.inpaint.shading import ShadingSettings


@pytest.mark.parametrize(
    ("settings", "section"), [(OpeningSettings, OpeningConfig), (ShadingSettings, ShadingConfig)]
)
def test_settings_are_their_section(settings, section):
    ours, configured = vars(settings()), section().model_dump()
    configured.pop("gap_mm", None)  # of the section `shading`, but a field of `InpaintInputs`
    assert ours == configured


def test_inputs_of_a_take_have_the_defaults_of_their_sections():
    configured = CompositeConfig().model_dump()
    configured |= {"edge_mm": DomainConfig().edge_mm, "gap_mm": ShadingConfig().gap_mm}
    ours = {f.name: f.default for f in fields(InpaintInputs) if f.default is not MISSING}
    configured.pop("seed")  # goes into each frame's own seed
    assert ours == configured
