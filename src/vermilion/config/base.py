"""What every section of the configuration shares."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, Field

Section = TypeVar("Section", bound="StageConfig")


class StageConfig(BaseModel):
    """A section: unknown keys and numbers that are not finite are errors, values cannot be changed once read."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def section(kind: Callable[..., Section], description: str) -> Section:
    """Field that holds a section below this one; left out, all its keys have their defaults."""
    field: Section = Field(default_factory=kind, description=description)
    return field
