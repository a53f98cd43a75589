"""The corrected mesh made to agree with the image: pose, contours, contact, in that order; folds are taken out.

Layers give detail and displacements the position over long ranges. The image shows where the lips lie, so
neither decides that (Lips16 section 7 names contours as constraints of the solve as future work).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vermilion.correction.coarse_take import CoarseTake
from vermilion.correction.constraints import ConstraintSolver, LinearConstraints
from vermilion.correction.folds import LipFolds
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.integration import LayerIntegrator
from vermilion.correction.lip_constraints import (
    LipSamples,
    contact_constraints,
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
        closed_gap_iod: lips touch where the inner contour is lower than this, per inter-ocular distance.
        contact: whether lips that touch in the image meet, and never pass through each other.
        folded_deg: of `LipFolds`: what counts as a fold of the lips, which is taken out.
        crease_deg: of `LipFolds`: what is a crease of the base track.
    """

    repose: bool
    repose_frames: float
    contour_weight: float
    bending_mm: float
    contour_robust_mm: float
    closed_gap_iod: float
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
        head_mm = np.array(head_mm)
        found = [
            self._constrained(
                head_mm[f], rotation[f], translation_mm[f], image, f,
                tuple(part[f] for part in lines), seen[f], float(unit_px[f]),
            )
            for f in frames
        ]  # fmt: skip
        if found:
            constraints, forces = zip(*found, strict=True)
            head_mm[:, self._free] += self._solver.displacements(constraints, forces)
        coarse_mm = head_from_world(take.coarse_mm, take.rotation, take.translation_mm)
        for f in frames:
            head_mm[f] = self._unfolder.unfold(head_mm[f], coarse_mm[f])
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

    def _constrained(
        self, vertices, rotation, translation_mm, image, f, lines, seen, unit_px
    ) -> tuple[LinearConstraints, np.ndarray]:
        """Constraints of a frame and the forces along them."""
        weight, n = self.settings.contour_weight, image.inner_px.shape[1]
        place = rotation, translation_mm
        robust_mm = self.settings.contour_robust_mm

        def on_contours(samples: LipSamples, now: np.ndarray) -> LinearConstraints:
            return contour_constraints(
                samples, vertices, *place, image.camera, lines, weight or 1.0, robust_mm, now
            )

        constraints = on_contours(seen, vertices)
        # Which points form the inner contour, and which are far off: found again at about the result.
        if weight > 0:
            now = np.array(vertices)
            forces = self._solver.forces(constraints)
            now[self._lips] += self._solver.displacements_at(self._lips, constraints, forces)
            constraints = on_contours(self._seen(now, *place, image, f), now)
        else:
            constraints = constraints[:0]
        if not self.settings.contact:
            return constraints, self._solver.forces(constraints)
        if weight > 0:
            view = vertices[self._eyes].mean(axis=0) @ rotation.T + translation_mm
            view = (view - image.camera.centre_mm) @ rotation
            constraints += contact_constraints(
                self._samples, vertices, image.inner_px[f], lines[2][n:], unit_px,
                view / np.linalg.norm(view), weight, self.settings.closed_gap_iod,
            )  # fmt: skip
        return self._separated(vertices, constraints)

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
                now[ids] = vertices[ids] + self._solver.displacements_at(ids, both, forces)
                through, deepest_mm = separation_constraints(self._crossings, vertices, now)
                if deepest_mm < least:
                    least, best = deepest_mm, (both, forces)
                if len(through) == 0:
                    return both, forces
                both += through
                if len(both) > _MOST_CONSTRAINTS:
                    break
        return best
