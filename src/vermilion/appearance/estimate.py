"""Lighting and albedo of a take from a few of its frames (Lips16 3.2).

Images alone do not separate light from albedo. The prior is that skin has one colour except in a
few places (lips, brows, a beard). The light is first fitted to skin of one colour, with Cauchy
weights that discount those places. The albedo explains the rest. Light and albedo then alternate;
the light is fitted to the mean of the albedo and the one colour.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from vermilion.appearance.harmonics import harmonics, irradiance, lit
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.imaging.display import display_slope, to_display_values
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError

#: Assumed mean linear albedo of skin: images do not determine the scale of light against albedo.
SKIN_ALBEDO = 0.35
_ROUNDS = 4
#: Least squares of the light: as many where nothing is known of it, half where it is known roughly.
_LIGHT_ROUNDS = 8
#: A colour that is wrong by this much counts half (display values, 0 to 255).
_ROBUST = 12.0


@dataclass(frozen=True)
class SampleObservations:
    """Colours of N samples in M frames at L resolutions.

    Attributes:
        colours: (M, L, N, 3) linear RGB.
        normals: (M, N, 3) unit normals, camera frame.
        trust: (M, N) in [0, 1]; zero where not seen.
        transfer: (M, N, 9, 9) what reaches each sample of the light (`light_transfer`); None: all.
    """

    colours: np.ndarray
    normals: np.ndarray
    trust: np.ndarray
    transfer: np.ndarray | None = None

    @property
    def basis(self) -> np.ndarray:
        """Harmonics (M, N, 9) of the light at each sample."""
        basis = harmonics(self.normals)
        if self.transfer is None:
            return basis
        return np.einsum("mnk,mnkj->mnj", basis, self.transfer)


@dataclass(frozen=True)
class Appearance:
    """Light, and the skin's albedo at each sample.

    Attributes:
        frames: (M,) int numbers of the frames that it was estimated from.
        triangle, barycentric: (N,) and (N, 3) of the samples.
        light: (9, 3) harmonics in the camera frame, linear RGB on a white surface.
        albedo: (L, N, 3) linear RGB at each resolution, finest first.
        spread: (N,) mean absolute error over the frames at the finest resolution, display values
            (0 to 255).
        seen: (N,) sum of the frames' trust; 0 for samples never seen.
    """

    frames: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    light: np.ndarray
    albedo: np.ndarray
    spread: np.ndarray
    seen: np.ndarray

    @property
    def samples(self) -> SurfacePoints:
        """Places of the samples on the mesh."""
        return SurfacePoints(self.triangle, self.barycentric)

    def colours(self, normals: np.ndarray, level: int = 0) -> np.ndarray:
        """Predicted linear RGB (N, 3) of samples with unit `normals` (N, 3), camera frame."""
        return self.albedo[level] * irradiance(normals, self.light)

    def save(self, path: str | Path, pieces: Mapping[int, Appearance] | None = None) -> None:
        """Write `.npz`, whole or not at all, with the appearance of each piece of the take."""
        others = {
            f"piece/{number}/{item.name}": getattr(found, item.name)
            for number, found in (pieces or {}).items()
            for item in fields(found)
        }
        own: dict[str, Any] = {item.name: getattr(self, item.name) for item in fields(self)}
        write_arrays(path, **own, **others)

    @classmethod
    def load(cls, path: str | Path) -> Appearance:
        """Read what `save` wrote: the appearance of the whole take, or of its longest piece."""
        return cls(**read_arrays(path, "appearance", [item.name for item in fields(cls)]))

    @classmethod
    def load_pieces(cls, path: str | Path) -> dict[int, Appearance]:
        """Piece -> its appearance, where `save` wrote any."""
        arrays = read_arrays(path, "appearance")
        numbers = {int(name.split("/")[1]) for name in arrays if name.startswith("piece/")}
        return {
            number: cls(**{f.name: arrays[f"piece/{number}/{f.name}"] for f in fields(cls)})
            for number in sorted(numbers)
        }


def estimate_appearance(
    frames: np.ndarray, samples: SurfacePoints, seen: SampleObservations, albedo_prior: float
) -> Appearance:
    """Light and albedo from the samples' colours in some frames.

    Args:
        frames: (M,) int numbers.
        samples: N places on the mesh.
        seen: their colours in these frames.
        albedo_prior: weight of the skin's median colour at each sample, in frames.

    Raises:
        InputError: the images show no skin.
    """
    finest, trust = seen.colours[:, 0], seen.trust
    basis = seen.basis
    skin = median_colour(finest, trust)
    problem = _LightProblem.of(basis, finest, trust)
    light = problem.solve(np.broadcast_to(skin, finest.shape[1:]), rounds=_LIGHT_ROUNDS)
    for _ in range(_ROUNDS):
        shading = lit(basis, light)
        skin = median_colour(finest / shading, trust)
        albedo = fit_albedo(finest, shading, trust, skin, albedo_prior)
        light = problem.solve(0.5 * (albedo + skin), rounds=_LIGHT_ROUNDS // 2, start=light)
    # Images do not distinguish a bright light on dark skin from a dim light on fair skin, nor their
    # colours: the mean light on the face is set to white, the skin's mean albedo to SKIN_ALBEDO.
    weight = trust / max(trust.sum(), 1e-12)
    mean = np.einsum("mn,mnc->c", weight, lit(basis, light))
    light = light / mean
    skin = median_colour(finest / lit(basis, light), trust)
    light = light * (skin.mean() / SKIN_ALBEDO)
    skin = skin * (SKIN_ALBEDO / skin.mean())
    shading = lit(basis, light)
    albedo = np.stack(
        [
            fit_albedo(seen.colours[:, level], shading, trust, skin, albedo_prior)
            for level in range(seen.colours.shape[1])
        ]
    )
    error = to_display_values(finest) - to_display_values(albedo[0] * shading)
    total = trust.sum(axis=0)
    spread = np.einsum("mn,mn->n", trust, np.abs(error).mean(axis=2)) / np.maximum(total, 1e-9)
    return Appearance(
        np.asarray(frames), samples.triangle, samples.barycentric, light, albedo, spread, total
    )


def median_colour(colours: np.ndarray, trust: np.ndarray) -> np.ndarray:
    """Median (3,) of `colours` (..., 3) where `trust` (...,) is high; black where nothing is trusted."""
    trusted = colours[trust > 0.3 * trust.max(initial=0.0)]
    return np.median(trusted, axis=0) if len(trusted) else np.zeros(3)


@dataclass(frozen=True)
class _LightProblem:
    """Least squares of the light, under any albedo, from the n samples that M frames show.

    A function or a channel a row: arrays are long, and loops over their short side cost most.

    Attributes:
        seen: (M, N) bool of the samples.
        basis: (9, n) harmonics.
        colours, slope: (3, n) linear RGB, and by how much its display value changes with it.
        trust: (n,).
    """

    seen: np.ndarray
    basis: np.ndarray
    colours: np.ndarray
    slope: np.ndarray
    trust: np.ndarray

    @classmethod
    def of(cls, basis: np.ndarray, colours: np.ndarray, trust: np.ndarray) -> _LightProblem:
        """From `basis` (M, N, 9), `colours` (M, N, 3) linear RGB and `trust` (M, N)."""
        seen = trust > 0
        values = np.ascontiguousarray(colours[seen].T)
        rows = np.ascontiguousarray(basis[seen].T)
        return cls(seen, rows, values, display_slope(values), trust[seen])

    def solve(self, albedo: np.ndarray, rounds: int, start: np.ndarray | None = None) -> np.ndarray:
        """Light (9, 3) under an albedo (N, 3), linear RGB, by iteratively reweighted least squares.

        Args:
            albedo: of the samples.
            rounds: of least squares.
            start: (9, 3) light that the first round's weights come from; None: all count alike.
        """
        shown = np.broadcast_to(albedo, (*self.seen.shape, 3))[self.seen]
        albedos = np.ascontiguousarray(shown.T)
        light = np.zeros((9, 3)) if start is None else start
        robust = np.ones_like(albedos) if start is None else self._robust(albedos, light)
        ridge = 1e-4 * np.eye(9)
        for _ in range(rounds):
            light = np.zeros((9, 3))
            for c in range(3):
                w = self.trust * robust[c] * self.slope[c] ** 2
                matrix = (self.basis * (w * albedos[c] ** 2)) @ self.basis.T
                if not np.trace(matrix) > 0:
                    raise InputError(
                        "no skin that its images show: the face is too small, too dark or hidden",
                        "a face whose eyes are some 60 pixels apart, in some frames",
                        "Leave the take out, or give frames that show the face larger.",
                    )
                right = self.basis @ (w * albedos[c] * self.colours[c])
                light[:, c] = np.linalg.solve(matrix + ridge * np.trace(matrix) / 9, right)
            robust = self._robust(albedos, light)
        return light

    def _robust(self, albedos: np.ndarray, light: np.ndarray) -> np.ndarray:
        """Weights (3, n) of the samples, by how well a light (9, 3) explains them."""
        error = self.slope * (self.colours - albedos * (light.T @ self.basis))
        return 1.0 / (1.0 + (error / _ROBUST) ** 2)


def light_equations(
    basis: np.ndarray, colours: np.ndarray, trust: np.ndarray, albedo: np.ndarray, light: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations (3, 9, 9) and (3, 9) of the light of samples whose albedo is known, a channel each.

    A sample counts by its trust, and less the worse a light that is known roughly explains it.

    Args:
        basis: (N, 9) harmonics of the light at each sample.
        colours: (N, 3) linear RGB.
        trust: (N,) weights.
        albedo: (N, 3) linear RGB.
        light: (9, 3) harmonics, roughly.
    """
    slope = display_slope(colours)
    error = slope * (colours - albedo * lit(basis, light))
    weight = trust[:, None] * slope**2 / (1.0 + (error / _ROBUST) ** 2)
    rows = np.ascontiguousarray(basis.T)
    matrices = [(rows * weighted) @ rows.T for weighted in (weight * albedo**2).T]
    return np.stack(matrices), (rows @ (weight * albedo * colours)).T


def fit_albedo(
    colours: np.ndarray,
    shading: np.ndarray,
    trust: np.ndarray,
    skin: np.ndarray,
    prior: float,
    rounds: int = 4,
) -> np.ndarray:
    """Albedo (N, 3) under a known light, with a prior of one colour.

    Args:
        colours: (M, N, 3) linear RGB of N samples in M frames.
        shading: (M, N, 3) light on the samples, linear RGB.
        trust: (M, N) weights.
        skin: (3,) colour of the prior.
        prior: weight of the prior, in frames.
        rounds: of reweighted least squares.
    """
    robust = np.ones_like(colours)
    level = (skin * shading.reshape(-1, 3).mean(axis=0)) ** 2 / skin**2
    shown = to_display_values(colours)
    for _ in range(rounds):
        weight = trust[..., None] * robust
        top = (weight * shading * colours).sum(axis=0) + prior * level * skin
        albedo = top / ((weight * shading**2).sum(axis=0) + prior * level)
        albedo = np.maximum(albedo, 1e-3)
        error = shown - to_display_values(albedo * shading)
        robust = 1.0 / (1.0 + (error / _ROBUST) ** 2)
    return albedo
