"""Train on a few corrected frames, correct the sequence (Guided18 section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from vermilion.correction.lip_crossings import LipCrossings
from vermilion.geometry.alignment import move_frames, similarity_alignment
from vermilion.guided.constrained_energy import ConstrainedEnergy
from vermilion.guided.contact import separate_lips
from vermilion.guided.dirichlet import FOLLOW_MM, GradientIntegrator
from vermilion.guided.gradients import NeutralTriangles
from vermilion.guided.mouth_change import MouthChange
from vermilion.guided.reduced_regression import ReducedRegression
from vermilion.guided.regions import GuidedRegions, rim_fade
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import InputError, ModelFileError

FORMAT_VERSION = 1
#: Frames whose gradients are in memory together.
_BLOCK = 16


@dataclass(frozen=True)
class Propagation:
    """Corrected frames, and what is known of each.

    Attributes:
        vertices_mm: (F, V, 3) float64, in the frame of the input.
        unexplained: (F,) share of the mouth region's deformation that no training frame spans, in
            [0, 1]: the higher, the more a frame needs a correction of its own. Of a frame that is
            deformed less than the corrected ones in the mean, it is the share of that mean: a mouth
            at rest needs none.
        depth_mm: (F,) how deep one lip lies in the other; 0 without contact.
    """

    vertices_mm: np.ndarray
    unexplained: np.ndarray
    depth_mm: np.ndarray


class LipPropagator:
    """Learns inner lips from corrected frames of one person and corrects sequences of it.

    Rigid motion: every frame is aligned with the neutral by the vertices `stable` first, and goes
    back after. So a rigid motion of the input moves the output rigidly, whatever it is.

    Attributes:
        neutral_mm: (V, 3).
        regions: of the topology.
        stable: (s,) vertices that hold the alignment.
        base: whether the regression predicts the change of the base's lips (True) or the lips
            themselves (False, the paper).
        scale: mean length of the corrected frames' trusted gradients less the neutral's.
        regression: fitted by `fit`.
        change: of the whole mouth region; None where the region is trusted (the paper).
    """

    def __init__(
        self,
        neutral_mm: np.ndarray,
        regions: GuidedRegions,
        stable: np.ndarray | None = None,
        follow_mm: float = FOLLOW_MM,
    ):
        """Prepare a topology.

        Args:
            neutral_mm: (V, 3) of the person, head frame.
            regions: predicted and trusted triangles.
            stable: vertex ids that hardly move with expression (the face model's region `rigid`);
                None for the corners of the trusted triangles.
            follow_mm: how far the inside of the mouth goes along with the lips.
        """
        self.neutral_mm = np.asarray(neutral_mm, dtype=np.float64)
        self.regions = regions
        trusted = np.unique(regions.triangles[regions.trusted])
        self.stable = trusted if stable is None else np.asarray(stable)
        self.follow_mm = follow_mm
        # Only the mouth takes part; `local` numbers its vertices.
        self._mouth = regions.mouth_vertices
        local, rest = regions.restricted(self._mouth), self.neutral_mm[self._mouth]
        self._local, self._fade = local, rim_fade(regions)[self._mouth]
        self.integrator = GradientIntegrator(rest, local, follow_mm)
        self._trusted = NeutralTriangles(rest, local.triangles[local.trusted])
        self._predicted = NeutralTriangles(rest, local.triangles[local.predicted])
        self._neutral_y = self._trusted.gradients(rest[None])
        self._energy = ConstrainedEnergy(self.integrator.factor, regions.free, regions.n_vertices)
        self.base, self.scale = False, 0.0
        self.regression: ReducedRegression | None = None
        self.change: MouthChange | None = None

    def fit(
        self,
        corrected_mm: np.ndarray,
        base_mm: np.ndarray | None = None,
        change: bool = True,
        with_neutral: bool = True,
        whole: bool = False,
    ) -> Self:
        """Learn from k corrected frames.

        Args:
            corrected_mm: (k, V, 3), any rigid pose.
            base_mm: (k, V, 3), the same frames before their correction, in the same poses. Given,
                the trusted gradients are the base's, as they will be in `correct`: a refinement
                moves the mouth region a little, too. None: the corrected frames' (the paper).
            change: with a base, predict the change of its lips' gradients, so that where nothing was
                wrong in training nothing changes; False: the lips themselves.
            with_neutral: the neutral counts as one more corrected frame, which costs nobody work.
            whole: with a base, move the whole mouth region as the corrected frames' was moved
                (`MouthChange`), so that the lips are not held by a border that is wrong.

        Raises:
            InputError: no frames, another topology, or a mesh that is not finite.
        """
        self._check_meshes(corrected_mm, "corrected frames")
        aligned, motions = self._aligned(corrected_mm)
        corrected, x = aligned, self._predicted.gradients(aligned)
        self.base = change and base_mm is not None
        if base_mm is not None:
            self._check_meshes(base_mm, "base frames")
            aligned = move_frames(base_mm[:, self._mouth], *motions)
        y = self._trusted.gradients(aligned)
        self.change = None
        if whole and base_mm is not None:
            moved = (corrected - aligned) * self._fade[:, None]
            self.change = MouthChange.of(y - self._neutral_y, moved)
        self.scale = float(np.linalg.norm(y - self._neutral_y, axis=1).mean())
        if self.base:
            x = x - self._predicted.gradients(aligned)
        if with_neutral:
            rest = self._predicted.gradients(self.neutral_mm[None, self._mouth])
            y = np.concatenate([self._neutral_y, y])
            x = np.concatenate([np.zeros_like(rest) if self.base else rest, x])
        self.regression = ReducedRegression().fit(y, x)
        return self

    def correct(
        self, sequence_mm: np.ndarray, crossings: LipCrossings | None = None
    ) -> Propagation:
        """Correct frames; each result depends on its own frame alone.

        Args:
            sequence_mm: (F, V, 3), any rigid poses.
            crossings: the lips, to separate where one would pass through the other; None: the paper.

        Raises:
            InputError: nothing was learnt yet, another topology, or a mesh that is not finite.
        """
        if self.regression is None:
            raise InputError("no training", "a call of `fit` first", "Correct a frame and train.")
        self._check_meshes(sequence_mm, "sequence")
        result = np.array(sequence_mm, dtype=np.float64)
        unexplained, depth = np.zeros(len(result)), np.zeros(len(result))
        for first in range(0, len(result), _BLOCK):
            part = slice(first, first + _BLOCK)
            aligned, (rotations, translations_mm) = self._aligned(result[part])
            y = self._trusted.gradients(aligned)
            deformation = np.linalg.norm(y - self._neutral_y, axis=1)
            share = self.regression.unexplained(y, self._neutral_y[0])
            unexplained[part] = share * deformation / np.maximum(deformation, self.scale)
            x = self.regression.predict(y)
            if self.base:
                x += self._predicted.gradients(aligned)
            if self.change is not None:
                aligned = aligned + self.change.predict(y - self._neutral_y)
            corrected = self.integrator.integrate(x, aligned)
            if crossings is not None:
                depth[part] = self._separate_lips(corrected, aligned, crossings)
            for ids in self._moved_vertices():
                moved = (corrected[:, ids] - translations_mm[:, None]) @ rotations
                result[part, self._mouth[ids]] = moved
        return Propagation(result, unexplained, depth)

    def _moved_vertices(self) -> tuple[np.ndarray, ...]:
        """Local numbers of the vertices that a correction moves."""
        if self.change is not None:
            return (np.arange(len(self._mouth)),)
        return self._local.free, self._local.followers

    def save(self, path: str | Path) -> None:
        """Write the fitted propagator as `.npz` (no pickle), whole or not at all."""
        if self.regression is None:
            raise InputError("no training to save", "a call of `fit` first", "Train first.")
        arrays: dict[str, Any] = {
            "propagator_version": np.int64(FORMAT_VERSION),
            "neutral_mm": self.neutral_mm,
            "stable": self.stable,
            "follow_mm": np.float64(self.follow_mm),
            "base": np.bool_(self.base),
            "scale": np.float64(self.scale),
            **self.regions.arrays(),
            **self.regression.arrays(),
            **({} if self.change is None else self.change.arrays()),
        }
        write_arrays(path, **arrays)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote. Raises ModelFileError on a newer or damaged file."""
        arrays = read_arrays(path, "lip propagator", error=ModelFileError, remedy="Train it again.")
        version = int(arrays.get("propagator_version", -1))
        if version != FORMAT_VERSION:
            raise ModelFileError(
                f"lip propagator format {version}",
                f"format {FORMAT_VERSION}",
                "Train it again with this version of Vermilion.",
                path=path,
            )
        regions = GuidedRegions.from_arrays(arrays)
        result = cls(arrays["neutral_mm"], regions, arrays["stable"], float(arrays["follow_mm"]))
        result.base, result.scale = bool(arrays["base"]), float(arrays["scale"])
        result.regression = ReducedRegression.from_arrays(arrays, str(path))
        result.change = MouthChange.from_arrays(arrays)
        return result

    def _separate_lips(
        self, corrected: np.ndarray, aligned: np.ndarray, crossings: LipCrossings
    ) -> np.ndarray:
        """Separate the lips of meshes (F, U, 3) in place; depths (F,) mm that are left."""
        depth, mesh = np.zeros(len(corrected)), self.neutral_mm.copy()
        for f, mouth in enumerate(corrected):
            mesh[self._mouth] = mouth
            found = separate_lips(mesh, crossings, self._energy)
            depth[f] = found.depth_mm
            mouth[:] = found.vertices_mm[self._mouth]
        self.integrator.follow(corrected, aligned)
        return depth

    def _aligned(self, meshes_mm: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """The mouths (F, U, 3) of meshes on the neutral; the motions (F, 3, 3), (F, 3) there."""
        target = self.neutral_mm[self.stable]
        stable = np.asarray(meshes_mm[:, self.stable], dtype=np.float64)
        found = [similarity_alignment(mesh, target, scale=1.0) for mesh in stable]
        motions = (np.stack([f.rotation for f in found]), np.stack([f.translation for f in found]))
        return move_frames(meshes_mm[:, self._mouth], *motions), motions

    def _check_meshes(self, meshes_mm: np.ndarray, name: str) -> None:
        expected = self.neutral_mm.shape
        if np.ndim(meshes_mm) != 3 or meshes_mm.shape[1:] != expected:
            raise InputError(
                f"{name} of shape {np.shape(meshes_mm)}",
                f"(frames, {expected[0]}, 3), the topology of the neutral",
                "Resample the meshes onto the neutral's topology.",
            )
        # A sum is finite where all of its terms are: one pass without an array of flags.
        sums = [meshes_mm[:, ids].sum(axis=(1, 2)) for ids in (self._mouth, self.stable)]
        bad = np.flatnonzero(~np.isfinite(sums).all(axis=0))
        if len(bad):
            raise InputError(
                f"{name} with frames {bad[:10].tolist()} that are not finite",
                "finite vertices round the mouth",
                "Leave these frames out.",
            )
