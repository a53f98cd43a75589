"""The corrected mesh made to agree with the image: pose, contours, contact, in that order; folds are taken out.

Layers give detail and displacements the position over long ranges. The image shows where the lips lie, so
neither decides that (Lips16 section 7 names contours as constraints of the solve as future work).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.coherent_constraints import coherent_pushes, frame_correlation
from vermilion.correction.constraints import ConstraintSolver, LinearConstraints
from vermilion.correction.folds import LipFolds
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.integration import LayerIntegrator
from vermilion.correction.lip_constraints import (
    SLACK_MM,
    LipSamples,
    contour_constraints,
    separation_constraints,
)
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.correction.repose import ANCHORS, apply_motion, repose_motion, smoothed_motion
from vermilion.correction.unfold import Unfolder
from vermilion.faces.model import FaceModel
from vermilion.features.contour_features import facing_interocular_px
from vermilion.features.occluding import OccludingContour
from vermilion.features.rings import lip_rings
from vermilion.geometry.cotangents import bending_stiffness
from vermilion.geometry.head_frame import head_from_world, world_from_head
from vermilion.geometry.rotations import rotation_matrix
from vermilion.landmarks.scheme import EYE_CORNERS

#: Least share of known contour points for a frame's own motion.
_LEAST_KNOWN = 0.3
#: Rounds of parting the lips, with how much of the contours' weight.
_ROUNDS, _CONTOURS_COUNT = 8, (1.0, 0.1, 0.01)
_MOST_CONSTRAINTS = 800
#: How often parting and unfolding follow each other.
_TURNS = 3


@dataclass(frozen=True)
class ImageAgreementSettings:
    """How the image counts; all at 0 or False: not at all, as in the paper.

    Attributes:
        repose: whether the corrected head is laid on the image again.
        repose_frames: deviation of the symmetric filter over time of that motion, frames.
        contour_weight: of a millimetre of contour beside the mesh's stiffness.
        bending_mm: over shorter lengths than this the lips bend as a plate, over longer ones they stretch as
            a membrane, where contours and contact move them; 0: a membrane alone.
        contour_robust_mm: a contour point this far off counts half.
        coherence_frames: frames to either side whose displacements resemble a frame's own; 0: none.
        contact: whether lips never pass through each other.
        folded_deg: of `LipFolds`: what counts as a fold of the lips, which is taken out.
        crease_deg: of `LipFolds`: what is a crease of the base track.
    """

    repose: bool
    repose_frames: float
    contour_weight: float
    bending_mm: float
    contour_robust_mm: float
    coherence_frames: int
    contact: bool
    folded_deg: float
    crease_deg: float

    @property
    def used(self) -> bool:
        """Whether anything is asked for."""
        return self.repose or self.contour_weight > 0 or self.contact


class ImageAgreement:
    """Binds the lips of a person's mesh to an integrator; build it once.

    Args:
        integrator: of the person's mesh.
        neutral_mm: (V, 3) the person's coarse neutral, head frame.
        face: the model that the mesh is of.
        n_samples: of each contour.
        settings: how the image counts.
    """

    def __init__(
        self,
        integrator: LayerIntegrator,
        neutral_mm: np.ndarray,
        face: FaceModel,
        n_samples: int,
        settings: ImageAgreementSettings,
    ):
        self.settings = settings
        self._samples = LipSamples.of(*lip_rings(face, n_samples), neutral_mm, face.triangles)
        self._anchors = face.landmarks[ANCHORS]
        self._eyes = face.landmarks[EYE_CORNERS]
        self._pivot = neutral_mm.mean(axis=0)
        self._free = integrator.free
        folds = LipFolds(face, settings.folded_deg, settings.crease_deg)
        self._unfolder = Unfolder(folds, face.triangles, neutral_mm)
        self._crossings = LipCrossings(face)
        self._occluding = OccludingContour.of(face, with_inside=False)
        lips = np.union1d(
            *(part.points.vertices(face.triangles) for part in (self._samples, self._occluding))
        )
        self._lips = np.intersect1d(lips, integrator.free)
        named = np.union1d(lips, self._crossings.vertices)
        # A membrane that few points pull has a tip at each: the lips must bend, not tear.
        plate = settings.bending_mm**2 * bending_stiffness(
            neutral_mm, face.triangles, integrator.free
        )
        self._solver = ConstraintSolver(integrator, named, plate if settings.bending_mm else None)

    def fit(self, head_mm: np.ndarray, take: CoarseTake, image: ImageContours) -> np.ndarray:
        """Meshes that agree with their images.

        Args:
            head_mm: (F, V, 3) corrected meshes, head frame, as the integrator leaves them.
            take, image: of the same frames.

        Returns:
            (F, V, 3), world, mm.
        """
        rotation, translation_mm = take.rotation, take.translation_mm
        lines, frames = image.lines(), range(len(take))
        unit_px = np.array(
            [facing_interocular_px(v[self._eyes], image.camera) for v in take.coarse_mm]
        )
        seen = [self._seen(head_mm[f], rotation[f], translation_mm[f], image, f) for f in frames]
        if self.settings.repose and seen:
            rotation, translation_mm = self._reposed(
                head_mm, take, image.camera, lines, seen, unit_px
            )
        coarse_mm = head_from_world(take.coarse_mm, take.rotation, take.translation_mm)
        if seen and (self.settings.contour_weight > 0 or self.settings.contact):
            on_contours = [
                self._on_contours(
                    head_mm[f], rotation[f], translation_mm[f], image, f,
                    tuple(part[f] for part in lines), seen[f],
                )
                for f in frames
            ]  # fmt: skip
            head_mm = self._moved(head_mm, on_contours, take.frames_apart)
        head_mm = self._unfolder.unfold_over_time(
            head_mm, coarse_mm, take.frames_apart, self.settings.coherence_frames
        )
        if self.settings.contact:
            for f in frames:
                head_mm[f] = self._parted(head_mm[f], coarse_mm[f])
        return world_from_head(head_mm, rotation, translation_mm)

    def _reposed(self, head_mm, take, camera, lines, seen, unit_px):
        """`world_from_head` after the corrected heads are laid on the image."""
        turn = np.swapaxes(take.rotation, 1, 2)
        pivot = self._pivot @ turn + take.translation_mm
        samples = np.stack(
            [s.points.sample(v, s.triangles) for s, v in zip(seen, head_mm, strict=True)]
        )
        motion = repose_motion(
            world_from_head(head_mm[:, self._anchors], take.rotation, take.translation_mm),
            camera.project(take.coarse_mm[:, self._anchors]),
            world_from_head(samples, take.rotation, take.translation_mm),
            lines, pivot, unit_px, camera,
        )  # fmt: skip
        known = lines[2].mean(axis=1) >= _LEAST_KNOWN
        motion = smoothed_motion(motion, known, take.frames_apart, self.settings.repose_frames)
        origin = apply_motion(take.translation_mm[:, None], pivot, motion)[:, 0]
        return rotation_matrix(motion[:, :3]) @ take.rotation, origin

    def _on_contours(
        self, vertices, rotation, translation_mm, image, f, lines, seen
    ) -> LinearConstraints:
        """What lays the lips of a frame on its contours; none where they do not count."""
        weight, place = self.settings.contour_weight, (rotation, translation_mm)

        def constraints(samples: LipSamples, now: np.ndarray) -> LinearConstraints:
            return contour_constraints(
                samples, vertices, *place, image.camera, lines, weight or 1.0,
                self.settings.contour_robust_mm, now,
            )  # fmt: skip

        first = constraints(seen, vertices)
        if weight == 0:
            return first[:0]
        # Which points form the inner contour, and which are far off: found again at about the result.
        now, pushes = np.array(vertices), self._solver.pushes(first, self._solver.forces(first))
        now[self._lips] += self._solver.displacements_at(self._lips, pushes)
        return constraints(self._seen(now, *place, image, f), now)

    def _parted(self, vertices: np.ndarray, coarse: np.ndarray) -> np.ndarray:
        """A head (V, 3) whose lips unfolding laid into each other: parted and unfolded in turn."""
        nothing = LinearConstraints.none()
        for _ in range(_TURNS):
            if self._crossings.find(vertices).deepest_mm <= SLACK_MM:
                break
            vertices = np.array(vertices)
            pushes = self._solver.pushes(*self._separated(vertices, nothing))
            vertices[self._free] += self._solver.displacements([pushes])[0]
            vertices = self._unfolder.unfold(vertices, coarse)
        return vertices

    def _moved(
        self, head_mm: np.ndarray, on_contours: list[LinearConstraints], frames: np.ndarray
    ) -> np.ndarray:
        """Heads (F, V, 3) with the lips on their contours and out of each other, each frame with its neighbours."""
        moved_mm, wanted = np.array(head_mm), list(on_contours)
        through = range(len(head_mm) if self.settings.contact else 0)
        for f in through:
            found, forces = self._separated(head_mm[f], wanted[f])
            wanted[f] += found[found.one_sided & (forces > 0)]
        correlation = frame_correlation(frames, self.settings.coherence_frames)
        pushes = coherent_pushes(self._solver, wanted, correlation)
        moved_mm[:, self._free] += self._solver.displacements(pushes)
        # What is left in the other lip then is put out in its frame alone, the contours as they lie by now.
        for f in through:
            rest = replace(on_contours[f], target_mm=np.zeros(len(on_contours[f])))
            pushes[f] = self._solver.pushes(*self._separated(moved_mm[f], rest))
        if len(through):
            moved_mm[:, self._free] += self._solver.displacements(pushes)
        return moved_mm

    def _seen(self, vertices, rotation, translation_mm, image, f) -> LipSamples:
        """Samples on the contours as they are seen: of the inner one, what hides the mouth now."""
        pixels = image.camera.project(self._occluding.on(vertices) @ rotation.T + translation_mm)
        samples, points, _ = self._occluding.match(
            pixels, image.outer_px[f], image.inner_px[f], image.inner_found[f]
        )
        return self._samples.with_inner(samples, self._occluding.points[points])

    def _separated(
        self, vertices: np.ndarray, constraints: LinearConstraints
    ) -> tuple[LinearConstraints, np.ndarray]:
        """Constraints and forces that leave no lip in the other: an active set, found again each round.

        Should contours press the lips together so that no set is enough, they count less and less; the
        least deep result stands where nothing helps.
        """
        ids, now, least = self._crossings.vertices, np.array(vertices), np.inf
        best = constraints, np.zeros(len(constraints))
        for counts in _CONTOURS_COUNT:
            both = replace(constraints, compliance=constraints.compliance / counts)
            for _ in range(_ROUNDS):
                forces = self._solver.forces(both)
                pushes = self._solver.pushes(both, forces)
                now[ids] = vertices[ids] + self._solver.displacements_at(ids, pushes)
                through, deepest_mm = separation_constraints(self._crossings, vertices, now)
                if deepest_mm < least:
                    least, best = deepest_mm, (both, forces)
                if len(through) == 0:
                    return both, forces
                both += through
                if len(both) > _MOST_CONSTRAINTS:
                    break
        return best
