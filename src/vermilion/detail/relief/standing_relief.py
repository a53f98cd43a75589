"""Relief that is always there, and the albedo without it: the geometry of the first frames (Mono13 8).

What stays the same in all of the first frames is paint and relief. Paint is assumed to scatter about a
smooth colour, from triangle to triangle, and to change the hue; relief is smooth and changes brightness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from vermilion.appearance.harmonics import irradiance
from vermilion.detail.relief.frames import ReliefScene
from vermilion.detail.relief.high_pass import HighPassFilter
from vermilion.detail.relief.light import ClipLight, relit
from vermilion.detail.relief.relief import ReliefSettings, solve_relief
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.imaging.display import to_display_values

#: A change of hue of a place says that its brightness is off by so many times as much.
_HUE = 6.0


def with_standing_relief(
    light: ClipLight,
    scene: ReliefScene,
    observations: Mapping[int, SkinObservation],
    settings: ReliefSettings,
) -> ClipLight:
    """The light with the relief of its first frames, and their albedo and noise on it.

    Args:
        light: of the take; albedo, noise and relief are found again.
        scene: images and meshes of the take.
        observations: frame -> skin of the smooth mesh, of the first frames.
        settings: priors and noise.
    """
    topology, frames = scene.topology, list(observations)
    skins = {frame: scene.fine(frame)[topology.skin_ids] for frame in frames}
    centres = skins[frames[0]][topology.skin].mean(axis=1)
    smooth = list(observations.values())
    flat = relit(light, light.light, smooth, topology, centres, settings.detail_mm)
    flat = replace(flat, standing_mm=np.zeros(len(topology.skin_ids)))
    middle = frames[len(frames) // 2]
    shown, paint = _as_relief(flat, observations[middle], scene, centres, settings)
    rotation = scene.camera.rotation
    standing = np.zeros(len(topology.skin_ids))
    if (share := settings.standing_share) > 0:
        weaker = replace(
            settings,
            curvature_sigma=share * settings.curvature_sigma,
            displacement_sigma_mm=share * settings.displacement_sigma_mm,
        )
        standing = solve_relief(skins[middle], rotation, shown, paint, topology, weaker)
    raised = [scene.raised(observations[frame], skins[frame], standing) for frame in frames]
    found = relit(flat, light.light, raised, topology, centres, settings.detail_mm)
    return replace(found, standing_mm=standing)


def _as_relief(
    light: ClipLight,
    observed: SkinObservation,
    scene: ReliefScene,
    centres_mm: np.ndarray,
    settings: ReliefSettings,
) -> tuple[SkinObservation, ClipLight]:
    """The first frames' mean image in the pose of one, and the light on skin of a smooth colour.

    `centres_mm` (Q, 3) of the skin's triangles. The noise of that light is what changes of hue tell of paint.
    """
    trust = light.seen / max(light.seen.max(), 1e-9)
    detail = HighPassFilter(scene.topology.pairs, centres_mm, trust, settings.detail_mm)
    smooth = np.exp(detail.smooth(np.log(light.albedo)))
    ratio = light.albedo / smooth
    hue = np.abs(ratio / ratio.mean(axis=1, keepdims=True) - 1).mean(axis=1)
    shading = irradiance(observed.normals, light.reaching(observed).light)
    values = to_display_values(light.albedo * shading)
    painted = to_display_values(smooth * shading * (1 + _HUE * hue[:, None]))
    noise = (painted - to_display_values(smooth * shading)).mean(axis=1)
    shown = replace(observed, colours=values, trust=trust * (observed.trust > 0))
    return shown, replace(light, albedo=smooth, noise=noise)
