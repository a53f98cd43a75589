"""Normals of the relief of a wrinkled studio actor against the true ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from benchmarks.wrinkled_actor import STILL, WrinkledActor
from vermilion.config.detail import ReliefConfig
from vermilion.detail.relief.frames import (
    ReliefChunk,
    ReliefScene,
    mesh_with_relief,
    relief_of_frames,
)
from vermilion.detail.relief.light import ClipLight, estimate_light
from vermilion.detail.relief.light_evidence import LightEvidence, fitted_light, frame_evidence
from vermilion.detail.relief.relief import ReliefSettings
from vermilion.detail.relief.skin_observation import SkinObservation
from vermilion.detail.relief.standing_relief import with_standing_relief
from vermilion.detail.relief.topology import FineTopology
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import normalised, vertex_areas, vertex_normals

#: Every so many frames after the still ones are measured.
STEP = 2
#: A place is in a fold where the truth is farther from the smooth surface (mm).
FOLD_MM = 0.1
_SEEN = 0.3  # least trust of a place that is measured


class AllLight(ReliefScene):
    """A scene in which nothing hides the light."""

    def observe(self, frame: int, fine_mm: np.ndarray) -> SkinObservation:
        """As `ReliefScene.observe`."""
        return replace(super().observe(frame, fine_mm), transfer=None)


@dataclass(frozen=True)
class ReliefOnActor:
    """An actor's take, its smooth meshes as a perfect tracker gives them, and the relief's settings.

    Attributes:
        first_only: as before light and relief were refined: the light of the first frames, on the smooth
            mesh, which hides nothing, and no relief that is always there.
    """

    actor: WrinkledActor
    config: ReliefConfig
    first_only: bool = False

    @cached_property
    def settings(self) -> ReliefSettings:
        """Priors and noise of the configuration."""
        return ReliefSettings(**self.config.model_dump(include=set(ReliefSettings.__annotations__)))

    @cached_property
    def scene(self) -> ReliefScene:
        """Images and smooth meshes."""
        topology = FineTopology.of(self.actor.tracker, self.config.levels, self.config.spacing_mm)
        kind = AllLight if self.first_only else ReliefScene
        image, mesh = self.actor.image, self.actor.tracked_mm
        return kind(topology, self.actor.camera, image, mesh, self.config.face_px)

    @cached_property
    def light(self) -> ClipLight:
        """Light, albedo and standing relief of the take, as the stage finds them."""
        scene, settings = self.scene, self.settings
        first = {frame: scene.observe(frame, scene.fine(frame)) for frame in range(STILL)}
        found = estimate_light(
            range(STILL), list(first.values()), scene.topology, scene.centres(0), settings.detail_mm
        )
        if self.first_only:
            return found
        start = with_standing_relief(found, scene, first, settings)
        frames = range(self.actor.n_frames)
        equations = [
            (frame, *frame_evidence(scene.observe_relief(frame, start, settings), start))
            for frame in frames
        ]
        light = fitted_light([LightEvidence.of(equations)], start.light)
        return with_standing_relief(replace(start, light=light), scene, first, settings)

    @cached_property
    def chunk(self) -> ReliefChunk:
        """Relief of all frames."""
        return relief_of_frames(self.scene, range(self.actor.n_frames), self.light, self.settings)

    def tilts(self, frame: int) -> np.ndarray:
        """Two tilts and trust (S, 3) of a frame."""
        return self.chunk.tilts[frame]

    def along_mm(self, frame: int) -> np.ndarray:
        """Displacements (S,) of a frame."""
        return self.chunk.along_mm[frame]

    def errors_deg(self) -> dict[str, float]:
        """Mean angle of normals to the true ones, smooth and with relief, over the folds and over all
        of the skin that is seen; and how far the relief tilts normals outside of the folds."""
        span, sums = (0, self.actor.n_frames - 1), np.zeros(7)
        for frame in range(STILL + 2, self.actor.n_frames - 2, STEP):
            fine = self.scene.fine(frame)
            mesh = mesh_with_relief(
                self.scene.topology, fine, self, frame, span,
                self.config.window, self.config.position_weight,
            )  # fmt: skip
            ids, triangles = self.scene.topology.skin_ids, self.scene.topology.skin
            skin = fine[ids]
            smooth, found = vertex_normals(skin, triangles), vertex_normals(mesh[ids], triangles)
            true, height = self._true(frame, skin, smooth)
            seen = self.tilts(frame)[:, 2] > _SEEN
            area = vertex_areas(skin, triangles) * seen
            fold = area * (height > FOLD_MM)
            before, after = degrees_apart(smooth, true), degrees_apart(found, true)
            tilt = degrees_apart(smooth, found)
            sums += [
                fold @ before, fold @ after, fold.sum(), area @ before, area @ after, area.sum(),
                (area - fold) @ tilt,
            ]  # fmt: skip
        return {
            "folds, smooth": sums[0] / sums[2],
            "folds": sums[1] / sums[2],
            "ratio": sums[1] / sums[0],
            "skin, smooth": sums[3] / sums[5],
            "skin": sums[4] / sums[5],
            "tilt outside": sums[6] / (sums[5] - sums[2]),
        }

    def _true(self, frame: int, skin: np.ndarray, normals: np.ndarray):
        """True normals (S, 3) beside the smooth skin, and the height (S,) of the folds there, mm."""
        mesh, triangles = self.actor.true_mm(frame), self.actor.triangles
        found = Surface(mesh, triangles).closest(skin, normals, 0.0)
        corners = triangles[found.triangle]
        wanted = vertex_normals(mesh, triangles)[corners]
        heights = np.abs(self.actor.height_mm(frame))[corners]
        true = normalised((found.barycentric[..., None] * wanted).sum(axis=1))
        return true, (found.barycentric * heights).sum(axis=1)


def degrees_apart(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Angles (N,) of unit vectors (N, 3), degrees."""
    return np.degrees(np.arccos(np.clip((one * two).sum(axis=1), -1, 1)))
