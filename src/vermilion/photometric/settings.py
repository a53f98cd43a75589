"""Settings of the refinement from plain values, as the configuration section holds them."""

from __future__ import annotations

from typing import Any

from vermilion.photometric.frame_fit import PhotometricSettings
from vermilion.photometric.layer import LayerSettings


def photometric_settings(section: dict[str, Any]) -> PhotometricSettings:
    """Of the section `refinement.fit`."""
    return PhotometricSettings(**{**section, "iterations": tuple(section["iterations"])})


def layer_settings(section: dict[str, Any]) -> LayerSettings:
    """Of the section `refinement.offsets`."""
    return LayerSettings(**{**section, "iterations": tuple(section["iterations"])})
