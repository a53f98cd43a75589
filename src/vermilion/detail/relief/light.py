"""One light and one albedo for a take, from its first frames (Mono13 section 8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from vermilion.appearance.estimate import (
    SampleObservations,
    estimate_appearance,
    fit_albedo,
    median_colour,
)
from vermilion.appearance.harmonics import harmonics_jacobian, irradiance, lit
from vermilion.detail.relief.high_pass import HighPassFilter
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.imaging.display import display_slope, to_display_values
from vermilion.imaging.images import srgb_to_linear
from vermilion.storage.arrays import read_arrays, write_arrays

#: Weight of the skin's median colour in the albedo of a triangle, in frames.
_PRIOR = 0.5
_NOISE_MM = 3.0  # range over which the noise estimate is smoothed


@dataclass(frozen=True)
class ClipLight:
    """Light and albedo of all frames of a take.

    Attributes:
        light: (9, 3) harmonics in the camera frame, linear RGB; of a frame's `reaching` (Q, 9, 3).
        albedo: (Q, 3) linear RGB of the skin's triangles.
        seen: (Q,) sum of the first frames' trust.
        noise: (Q,) deviation of a triangle's value between frames, display values.
        frames: (M,) int numbers of the frames that they were estimated from.
        standing_mm: (S,) relief of the skin's vertices that is always there, about which that of a frame is
            looked for.
    """

    light: np.ndarray
    albedo: np.ndarray
    seen: np.ndarray
    noise: np.ndarray
    frames: np.ndarray
    standing_mm: np.ndarray

    def values(self, normals: np.ndarray) -> np.ndarray:
        """Predicted display values (Q, 3) of triangles with unit `normals` (Q, 3), camera frame."""
        return to_display_values(self.albedo * irradiance(normals, self.light))

    def slopes(self, normals: np.ndarray) -> np.ndarray:
        """Derivative (Q, 3) of a triangle's mean display value by its normal, at `normals` (Q, 3)."""
        linear = self.albedo * irradiance(normals, self.light)
        by_normal = np.swapaxes(self.light, -1, -2) @ harmonics_jacobian(normals)
        return np.einsum("qc,qck->qk", display_slope(linear) * self.albedo, by_normal) / 3

    def reaching(self, observed: SkinObservation) -> ClipLight:
        """The same with the light that reaches each triangle in a frame."""
        if observed.transfer is None:
            return self
        return replace(self, light=observed.transfer @ self.light)

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        write_arrays(path, **{item.name: getattr(self, item.name) for item in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> ClipLight:
        """Read what `save` wrote."""
        names = [item.name for item in fields(cls)]
        return cls(**read_arrays(path, "light of a clip", names))


def estimate_light(
    frames: Sequence[int],
    observations: Sequence[SkinObservation],
    topology: FineTopology,
    centres_mm: np.ndarray,
    detail_mm: float,
) -> ClipLight:
    """Light, albedo and noise from observations of a few frames.

    Each triangle has its own albedo: the part of its colour that is constant over the frames. The
    rest is shading and noise. A single frame gives zero noise.

    Args:
        frames: numbers of the frames of `observations`.
        observations: image at the skin's triangles in each frame.
        topology: of the skin.
        centres_mm: (Q, 3) of the triangles in one of the frames.
        detail_mm: noise that changes over longer ranges is left out.
    """
    n = len(topology.skin)
    middle = SurfacePoints(np.arange(n, dtype=np.int32), np.full((n, 3), 1 / 3))
    found = estimate_appearance(np.asarray(frames), middle, _samples(observations), _PRIOR)
    flat = np.zeros(len(topology.skin_ids))
    light = ClipLight(found.light, found.albedo[0], found.seen, np.zeros(n), found.frames, flat)
    return _with_noise(light, observations, topology, centres_mm, detail_mm)


def relit(
    start: ClipLight,
    light: np.ndarray,
    observations: Sequence[SkinObservation],
    topology: FineTopology,
    centres_mm: np.ndarray,
    detail_mm: float,
) -> ClipLight:
    """Albedo and noise again, under another light.

    Args:
        start: as `estimate_light` found it from the same frames.
        light: (9, 3) harmonics in the camera frame.
        observations, topology, detail_mm: as for `estimate_light`.
        centres_mm: (Q, 3) of the triangles in one of the frames.
    """
    seen = _samples(observations)
    finest, shading = seen.colours[:, 0], lit(seen.basis, light)
    skin = median_colour(finest / shading, seen.trust)
    albedo = fit_albedo(finest, shading, seen.trust, skin, _PRIOR)
    found = replace(start, light=light, albedo=albedo)
    return _with_noise(found, observations, topology, centres_mm, detail_mm)


def _with_noise(
    light: ClipLight,
    observations: Sequence[SkinObservation],
    topology: FineTopology,
    centres_mm: np.ndarray,
    detail_mm: float,
) -> ClipLight:
    """`light` with the deviation of its triangles' values between the frames of `observations`."""
    detail = HighPassFilter(topology.pairs, centres_mm, light.seen, detail_mm)
    trust = np.stack([s.trust for s in observations])
    left = np.stack(
        [
            detail((s.colours - light.reaching(s).values(s.normals)).mean(axis=1))
            for s in observations
        ]
    )
    squared = (trust * left**2).sum(axis=0) / np.maximum(light.seen, 1e-9)
    # The albedo has absorbed a share of the noise (Bessel's correction).
    share = len(observations) / max(len(observations) - 1, 1)
    near = HighPassFilter(topology.pairs, centres_mm, light.seen, _NOISE_MM).smooth(squared)
    return replace(light, noise=np.sqrt(share * np.maximum(near, 0)))


def _samples(observations: Sequence[SkinObservation]) -> SampleObservations:
    """The observations of some frames, at one resolution."""
    colours = np.stack([srgb_to_linear(s.colours / 255) for s in observations])
    return SampleObservations(
        colours[:, None].astype(np.float64),
        np.stack([s.normals for s in observations]),
        np.stack([s.trust for s in observations]),
        _stacked([s.transfer for s in observations]),
    )


def _stacked(transfers: list[np.ndarray | None]) -> np.ndarray | None:
    known = [transfer for transfer in transfers if transfer is not None]
    return np.stack(known) if len(known) == len(transfers) else None
