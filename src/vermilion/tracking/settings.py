"""Settings of the landmark fits from the plain values of their configuration sections."""

from __future__ import annotations

from typing import Any

from vermilion.tracking.identity.landmark_identity import IdentitySettings
from vermilion.tracking.identity.lip_offset import OwnLips
from vermilion.tracking.landmark_fit.expression import LandmarkFitSettings
from vermilion.tracking.landmark_fit.observation import LandmarkNoise


def landmark_fit_settings(
    fit: dict[str, Any], motion: dict[str, Any] | None = None
) -> LandmarkFitSettings:
    """Settings of the sections `tracking.fit` and `tracking.motion`."""
    motion = {k: v for k, v in (motion or {}).items() if k != "max_reprojection"}
    noise = LandmarkNoise(**fit["noise"], robust_sigmas=fit["robust_sigmas"])
    return LandmarkFitSettings(
        noise=noise,
        weight_sigma=fit["weight_sigma"],
        lid_weight_sigma=fit["lid_weight_sigma"],
        side_weight_share=fit["side_weight_share"],
        rare_weight_share=fit["rare_weight_share"],
        jaw_slide=fit["jaw_slide"],
        **motion,
    )


def identity_settings(fit: dict[str, Any], identity: dict[str, Any]) -> IdentitySettings:
    """Settings of the sections `tracking.fit` and `tracking.identity`."""
    return IdentitySettings(
        fit=landmark_fit_settings(fit),
        bias=LandmarkNoise(**identity["bias"]),
        neutral_weight_sigma=identity["neutral_weight_sigma"],
        focal_sigma=identity["focal_sigma"],
    )


def own_lips_settings(identity: dict[str, Any], tells_lips: bool) -> OwnLips | None:
    """Settings of the section `tracking.identity.own_lips`; None where it is off, or landmarks do not tell lips."""
    chosen = dict(identity["own_lips"])
    enabled = chosen.pop("enabled")
    return OwnLips(**chosen) if enabled and tells_lips else None
