"""The colours of a take's frames against the model's, each sample's albedo at its best (Lips16 3.2).

A fixed albedo would bias the shape towards the one it was estimated under; so the albedo is solved for
at every state, and its derivatives are kept to eliminate it from the Gauss-Newton system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vermilion.appearance.estimate import fit_albedo, median_colour
from vermilion.appearance.harmonics import irradiance
from vermilion.imaging.display import display_slope, to_display_values


@dataclass(frozen=True)
class IdentityImageSettings:
    """How much the images count beside the landmarks.

    Attributes:
        spacing_mm: distance between samples of the skin.
        pixel_mm: pixel size of the images that are compared, at the face.
        sigma: deviation of a colour, display values (0 to 255).
        robust_sigmas: a sample this many deviations off counts half (Cauchy).
        strength: weight of a face's images, in independent samples.
        albedo_prior: weight of the skin's median colour at each sample, in frames.
        rounds: of `iterations` Gauss-Newton steps each.
        iterations: Gauss-Newton steps of a round, at most.
    """

    spacing_mm: float = 5.0
    pixel_mm: float = 8.0
    sigma: float = 6.0
    robust_sigmas: float = 2.0
    strength: float = 10.0
    albedo_prior: float = 0.5
    rounds: int = 3
    iterations: int = 4


@dataclass(frozen=True)
class SampledFrame:
    """The image of one frame at the N samples, and the model's samples there.

    Attributes:
        colours: (N, 3) linear RGB of the image.
        slopes: (N, 3, 2) derivatives of the colours by the place, per pixel.
        trust: (N,) in [0, 1]; zero where hidden or outside the image.
        normals: (N, 3) unit normals of the model, camera frame.
        rotation: (3, 3) camera from head.
        turned: (N, 3) mm, camera frame, before the translation.
        points: (N, 3) mm, camera frame.
        image: (N, 2) pixels from the principal point.
    """

    colours: np.ndarray
    slopes: np.ndarray
    trust: np.ndarray
    normals: np.ndarray
    rotation: np.ndarray
    turned: np.ndarray
    points: np.ndarray
    image: np.ndarray


@dataclass(frozen=True)
class ColourResiduals:
    """Errors of a take's M frames with the best albedo, and what its elimination needs.

    Attributes:
        errors: (M, N, 3) image minus model, display values (0 to 255).
        weights: (M, N) of the squared errors, without the robust factor.
        by_albedo: (M, N, 3) derivative of the prediction by the albedo.
        predicted: (M, N, 3) linear RGB.
        albedo: (N, 3) linear.
        skin: (3,) the skin's median albedo, to which the albedo is drawn.
        prior: (N, 3) weights of the squared difference of albedo and skin.
    """

    errors: np.ndarray
    weights: np.ndarray
    by_albedo: np.ndarray
    predicted: np.ndarray
    albedo: np.ndarray
    skin: np.ndarray
    prior: np.ndarray


def colour_residuals(
    frames: Sequence[SampledFrame], light: np.ndarray, settings: IdentityImageSettings
) -> ColourResiduals:
    """Residuals of a take's frames under a light (9, 3), harmonics in the camera frame."""
    colours = np.stack([frame.colours for frame in frames])
    trust = np.stack([frame.trust for frame in frames])
    shading = irradiance(np.stack([frame.normals for frame in frames]), light)
    skin = median_colour(colours / shading, trust)
    albedo = fit_albedo(colours, shading, trust, skin, settings.albedo_prior)
    predicted = albedo * shading
    errors = to_display_values(colours) - to_display_values(predicted)
    share = settings.strength / (3 * settings.sigma**2)
    unit = share / np.maximum(trust.sum(axis=1, keepdims=True), 1e-9)
    mean = shading.mean(axis=0)
    prior = settings.albedo_prior * unit.mean() * (display_slope(albedo * mean) * mean) ** 2
    prior = np.where(trust.max(axis=0)[:, None] > 0, prior, 0.0)
    by_albedo = display_slope(predicted) * shading
    return ColourResiduals(errors, unit * trust, by_albedo, predicted, albedo, skin, prior)
