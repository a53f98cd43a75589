"""The corrected mesh made to agree with the image: pose, contours, contact, in that order.

Layers give detail, displacements the place over long ranges; where the lips lie in the image is seen,
so it is not left to either (Lips16 section 7 names contours as constraints of the solve as future work).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vermilion.correction.constraints import ConstraintSolver, Rows
from vermilion.correction.image_contours import ImageContours, ImageContourSettings
from vermilion.correction.integration import LayerIntegrator
from vermilion.correction.lip_constraints import LipSamples, contour_rows, parting_rows, touch_rows
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.correction.repose import ANCHORS, moved, repose_motion, smoothed_motion
from vermilion.faces.model import FaceModel
from vermilion.features.contour_features import interocular_px
from vermilion.features.occluding import OccludingContour
from vermilion.features.rings import lip_rings
from vermilion.geometry.rotations import rotation_matrix
from vermilion.landmarks.scheme import EYE_CORNERS

#: Least share of known contour points for a frame's own motion.
_LEAST_KNOWN = 0.3
#: Rounds of parting the lips, with how much of the contours' weight.
_ROUNDS, _CONTOURS_COUNT = 8, (1.0, 0.1, 0.01)
_MOST_ROWS = 800


class ImageAgreement:
    """Binds the lips of a person's mesh to an integrator; build it once."""

    def __init__(
        self,
        integrator: LayerIntegrator,
        neutral_mm: np.ndarray,
        face: FaceModel,
        n_samples: int,
        settings: ImageContourSettings,
    ):
        self.settings = settings
        self._samples = LipSamples.of(*lip_rings(face, n_samples), neutral_mm, face.triangles)
        self._anchors = face.landmarks[ANCHORS]
        self._eyes = face.landmarks[EYE_CORNERS]
        self._pivot = neutral_mm.mean(axis=0)
        self._free = integrator.free
        self._crossings = LipCrossings(face)
        self._occluding = OccludingContour.of(face)
        lips = np.union1d(
            *(part.points.vertices(face.triangles) for part in (self._samples, self._occluding))
        )
        self._lips = np.intersect1d(lips, integrator.free)
        self._solver = ConstraintSolver(integrator, np.union1d(lips, self._crossings.vertices))

    @classmethod
    def of(
        cls, integrator: LayerIntegrator, neutral_mm: np.ndarray, image: ImageContours
    ) -> ImageAgreement:
        """Bound to the face and the number of samples of an image."""
        n_samples = image.outer_px.shape[1]
        return cls(integrator, neutral_mm, image.face, n_samples, image.settings)

    def fit(
        self,
        corrected: np.ndarray,
        coarse_mm: np.ndarray,
        rotation: np.ndarray,
        translation_mm: np.ndarray,
        image: ImageContours,
    ) -> np.ndarray:
        """Meshes (F, V, 3) in the world that agree with the image.

        Args:
            corrected: (F, V, 3) head frame, as the integrator leaves them.
            coarse_mm: (F, V, 3) C in the world; rotation, translation_mm: its `world_from_head`.
            image: of the same frames.
        """
        lines = image.lines()
        unit_px = np.array([interocular_px(v[self._eyes], image.camera) for v in coarse_mm])
        seen = [
            self._seen(corrected[f], rotation[f], translation_mm[f], image, f)
            for f in range(len(corrected))
        ]
        if self.settings.repose and seen:
            rotation, translation_mm = self._reposed(
                corrected, coarse_mm, rotation, translation_mm, image, lines, seen, unit_px
            )
        corrected = np.array(corrected)
        constraints = [
            self._constrained(
                corrected[f], rotation[f], translation_mm[f], image, f,
                tuple(part[f] for part in lines), seen[f], float(unit_px[f]),
            )
            for f in range(len(corrected))
        ]  # fmt: skip
        if constraints:
            rows, forces = zip(*constraints, strict=True)
            corrected[:, self._free] += self._solver.moves(list(rows), list(forces))
        return corrected @ np.swapaxes(rotation, 1, 2) + translation_mm[:, None]

    def _reposed(self, corrected, coarse_mm, rotation, translation_mm, image, lines, seen, unit_px):
        """`world_from_head` after the corrected heads are laid on the image."""
        turn = np.swapaxes(rotation, 1, 2)
        pivot = self._pivot @ turn + translation_mm
        samples = np.stack(
            [s.points.sample(v, s.triangles) for s, v in zip(seen, corrected, strict=True)]
        )
        motion = repose_motion(
            corrected[:, self._anchors] @ turn + translation_mm[:, None],
            image.camera.project(coarse_mm[:, self._anchors]),
            samples @ turn + translation_mm[:, None],
            lines, pivot, unit_px, image.camera,
        )  # fmt: skip
        known = lines[2].mean(axis=1) >= _LEAST_KNOWN
        motion = smoothed_motion(motion, known, image.frames, self.settings.repose_frames)
        origin = moved(translation_mm[:, None], pivot, motion)[:, 0]
        return rotation_matrix(motion[:, :3]) @ rotation, origin

    def _constrained(
        self, vertices, rotation, translation_mm, image, f, lines, seen, unit_px
    ) -> tuple[Rows, np.ndarray]:
        """Rows of a frame and the forces along them."""
        weight, n = self.settings.contour_weight, image.inner_px.shape[1]
        place = rotation, translation_mm
        robust_mm = self.settings.contour_robust_mm

        def rows_of(samples: LipSamples) -> Rows:
            return contour_rows(
                samples, vertices, *place, image.camera, lines, weight or 1.0, robust_mm
            )

        rows = rows_of(seen)
        if weight > 0:  # which points form the inner contour, once more at about the result
            now = np.array(vertices)
            moves = self._solver.near_moves(rows, self._solver.multipliers(rows), self._lips)
            now[self._lips] += moves
            rows = rows_of(self._seen(now, *place, image, f))
        else:
            rows = rows[:0]
        if not self.settings.contact:
            return rows, self._solver.multipliers(rows)
        if weight > 0:
            view = vertices[self._eyes].mean(axis=0) @ rotation.T + translation_mm
            view = (view - image.camera.centre_mm) @ rotation
            rows += touch_rows(
                self._samples, vertices, image.inner_px[f], lines[2][n:], unit_px,
                view / np.linalg.norm(view), weight, self.settings.closed,
            )  # fmt: skip
        return self._parted(vertices, rows)

    def _seen(self, vertices, rotation, translation_mm, image, f) -> LipSamples:
        """Samples on the contours as they are seen: of the inner one, what hides the mouth now."""
        pixels = image.camera.project(self._occluding.on(vertices) @ rotation.T + translation_mm)
        samples, points, _ = self._occluding.match(
            pixels, image.outer_px[f], image.inner_px[f], image.inner_found[f]
        )
        return self._samples.with_inner(samples, self._occluding.points[points])

    def _parted(self, vertices: np.ndarray, rows: Rows) -> tuple[Rows, np.ndarray]:
        """Rows and forces that leave no lip in the other: an active set, found again each round.

        Should contours press the lips together so that no set is enough, they count less and less; the
        least deep result stands where nothing helps.
        """
        ids, now, least, best = self._crossings.vertices, np.array(vertices), np.inf, None
        for counts in _CONTOURS_COUNT:
            both = replace(rows, compliance=rows.compliance / counts)
            for _ in range(_ROUNDS):
                forces = self._solver.multipliers(both)
                now[ids] = vertices[ids] + self._solver.near_moves(both, forces, ids)
                through, deepest_mm = parting_rows(self._crossings, vertices, now)
                if deepest_mm < least:
                    least, best = deepest_mm, (both, forces)
                if len(through) == 0:
                    return both, forces
                both += through
                if len(both) > _MOST_ROWS:
                    break
        return best
