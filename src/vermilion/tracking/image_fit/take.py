"""A take before the image fit: its landmark fit, the data of its frames, its appearance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from vermilion.appearance.estimate import Appearance, SampleObservations, estimate_appearance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.geometry.rotations import log_about_mean, rotation_matrix
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.tracking.image_fit.frame_fit import FrameProblem, FrameView, visible_trust
from vermilion.tracking.image_fit.image_levels import image_pyramid
from vermilion.tracking.image_fit.landmark_term import LandmarkTerm
from vermilion.tracking.landmark_fit.expression import N_POSE, LandmarkFitSettings
from vermilion.tracking.landmark_fit.observation import (
    Observations,
    focal_px,
    project,
    reprojection_px,
)
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.landmark_fit.turned import as_seen_turned, turned_frames
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import landmark_fit_settings


class StartFiles(Protocol):
    """Input files of the image fit."""

    tracker: str
    identity: str
    fit: str
    landmarks: str | Sequence[str]


@dataclass(frozen=True)
class DenseLips:
    """What counts at the mouth where dense landmarks tell the person's lips.

    Teeth, tongue and shade beside real lips are taken for lips by the comparison with the image, which then
    draws the lower lip over them; landmarks that draw lips as people have them say it better.

    Attributes:
        opening_mm: samples so near to the lips' inner edge are not compared.
        noise_share: of the deviation that the mouth's landmarks have in the landmark fit.
    """

    opening_mm: float
    noise_share: float

    def hides(self, model: FaceModel, neutral_mm: np.ndarray, samples_mm: np.ndarray) -> np.ndarray:
        """(N,) bool: samples (N, 3) of a neutral (V, 3), mm, that are not compared."""
        edge = neutral_mm[model.inner_contour]
        return cKDTree(edge).query(samples_mm)[0] < self.opening_mm

    def sharpened(self, settings: LandmarkFitSettings) -> LandmarkFitSettings:
        """Settings of the landmark term."""
        mouth = self.noise_share * settings.noise.mouth
        return replace(settings, noise=replace(settings.noise, mouth=mouth))


@dataclass(frozen=True)
class TakeStart:
    """A take before the image fit.

    Attributes:
        model: the tracker's.
        identity: of the person.
        camera: of the images, with the focal length that was used.
        x: (F, 6 + K) the landmark fit: rotation vector about `reference`, translation, weights.
        reference: (3, 3) rotation, the mean of the whole take.
        seen: landmarks of the F frames, without what turned heads hide.
        settings: of the landmark fit.
        lips: what counts at the mouth of a person with own lips; None: all.
    """

    model: FaceModel
    identity: Identity
    camera: Camera
    x: np.ndarray
    reference: np.ndarray
    seen: Observations
    settings: LandmarkFitSettings
    lips: DenseLips | None = None

    @classmethod
    def of(
        cls,
        model: FaceModel,
        identity: Identity,
        fit: TrackedTake,
        track: LandmarkTrack,
        settings: LandmarkFitSettings,
        rows: np.ndarray | None = None,
        lips: DenseLips | None = None,
    ) -> TakeStart:
        """Some `rows` (n,) of a landmark fit (all by default); `track` has these frames' landmarks."""
        camera = fit.camera
        rotation = camera.rotation @ fit.world_from_head_rotation
        # The mean rotation is the whole take's, so that chunks can be smoothed together.
        vectors, reference = log_about_mean(rotation)
        translation = camera.to_camera(fit.world_from_head_translation_mm)
        x = np.concatenate([vectors, translation, fit.weights], axis=1)
        rows = np.arange(len(x)) if rows is None else np.asarray(rows)
        place = {int(frame): row for row, frame in enumerate(track.frames)}
        order = np.array([place[int(frame)] for frame in fit.frames[rows]], dtype=int)
        seen = Observations.of(track, camera)[order]
        lips = lips if identity.has_own_lips(model) else None
        start = cls(model, identity, camera, x[rows], reference, seen, settings, lips)
        turned = turned_frames(rotation[rows], translation[rows])
        visible = as_seen_turned(
            seen, model, lambda row: start.vertices(start.x[row]), turned, focal_px(camera)
        )
        return replace(start, seen=visible)

    @classmethod
    def load(
        cls,
        inputs: StartFiles,
        cfg: Mapping[str, dict[str, Any]],
        frames: Sequence[int] | None = None,
    ) -> tuple[TrackedTake, np.ndarray, TakeStart]:
        """Read some frames of a take; all frames by default.

        Args:
            inputs: paths `tracker`, `identity`, `fit` and `landmarks` (one, or one a chunk).
            cfg: sections `tracking.fit`, `tracking.motion` and `tracking.image_fit.lips`.
            frames: numbers of the frames.

        Returns:
            the take's track, the rows (n,) of the frames in it, and the frames.
        """
        fit = TrackedTake.load(inputs.fit)
        rows = np.arange(len(fit.frames)) if frames is None else fit.index_of(frames)
        track = LandmarkTrack.load(inputs.landmarks)
        settings = landmark_fit_settings(cfg["tracking.fit"], cfg["tracking.motion"])
        model, identity = FaceModel.load(inputs.tracker), Identity.load(inputs.identity)
        lips = DenseLips(**cfg["tracking.image_fit.lips"])
        return fit, rows, cls.of(model, identity, fit, track, settings, rows, lips)

    @property
    def weight_sigmas(self) -> np.ndarray:
        """(K,) deviations of the blend weights about zero."""
        names = tuple(self.model.expression_names)
        return self.settings.weight_sigmas(names, len(names))

    def face(self, samples: SurfacePoints) -> SampledFace:
        """The person at some samples."""
        return SampledFace.of(self.model, self.identity.neutral_mm, samples)

    def vertices(self, x: np.ndarray) -> np.ndarray:
        """Mesh (V, 3) mm, camera frame, of x (6 + K,): rotation vector, translation, weights."""
        local = self.identity.vertices(self.model, x[N_POSE:])
        return local @ (rotation_matrix(x[:3]) @ self.reference).T + x[3:6]

    def with_motion(self, fit: TrackedTake, x: np.ndarray) -> TrackedTake:
        """`fit` with poses and weights x (F, 6 + K) of all frames of the take."""
        rotation = rotation_matrix(x[:, :3]) @ self.reference
        to_world = self.camera.rotation.T
        shape = self.landmark_shape()
        points = shape.points(x[:, N_POSE:]) @ np.swapaxes(rotation, 1, 2) + x[:, None, 3:6]
        error = reprojection_px(project(points, focal_px(self.camera)), self.seen)
        return replace(
            fit,
            weights=x[:, N_POSE:],
            world_from_head_rotation=to_world @ rotation,
            world_from_head_translation_mm=(x[:, 3:6] - self.camera.translation) @ to_world.T,
            reprojection_px=error,
        )

    def landmark_shape(self) -> LandmarkShape:
        """The person's landmarks."""
        return LandmarkShape.of(
            self.model,
            self.identity.identity,
            self.identity.landmark_offset_mm,
            self.identity.places,
        )

    def view(
        self, row: int, image: np.ndarray, face: SampledFace, pixel_mm: float, levels: int
    ) -> FrameView:
        """Data of the frame at `row`, from its image (h, w, 3), linear RGB."""
        x, focal = self.x[row], focal_px(self.camera)
        rotation = rotation_matrix(x[:3]) @ self.reference
        points = face.points(x[N_POSE:]) @ rotation.T + x[3:6]
        normals = face.normals(x[N_POSE:]) @ rotation.T
        trust = visible_trust(self.model, self.vertices(x), points, normals)
        settings = self.settings
        if self.lips is not None:
            trust[self.lips.hides(self.model, self.identity.neutral_mm, face.neutral_mm)] = 0.0
            settings = self.lips.sharpened(settings)
        return FrameView(
            image_pyramid(image, self.camera, points, pixel_mm, levels),
            focal,
            trust,
            LandmarkTerm.of(self.landmark_shape(), self.seen[[row]], focal, x[5], settings),
            x,
            self.reference,
        )


def observe_samples(
    views: list[FrameView], xs: list[np.ndarray], gains: np.ndarray, face: SampledFace
) -> SampleObservations:
    """Colours of the samples in some frames, with poses and weights `xs`, each (6 + K,).

    They are divided by the frames' `gains` (M,): the exposure of the camera may change.
    """
    colours, normals, trust = [], [], []
    for view, x, gain in zip(views, xs, gains, strict=True):
        rotation = rotation_matrix(x[:3]) @ view.reference
        image = project(face.points(x[N_POSE:]) @ rotation.T + x[3:6], view.focal_px)
        found = [level.sample(image) for level in view.levels]
        colours.append(np.stack([values for values, _, _ in found]) / gain)
        normals.append(face.normals(x[N_POSE:]) @ rotation.T)
        trust.append(view.trust * found[0][2])
    return SampleObservations(np.stack(colours), np.stack(normals), np.stack(trust))


def learn_appearance(
    frames: np.ndarray,
    views: list[FrameView],
    face: SampledFace,
    samples: SurfacePoints,
    albedo_prior: float,
    rounds: int,
    problem_of: Callable[[Appearance], FrameProblem],
) -> Appearance:
    """Light and albedo from some frames, alternating with their poses and expressions.

    Args:
        frames: (M,) int numbers.
        views: data of these frames.
        face: the person at the samples.
        samples: places on the skin.
        albedo_prior: weight of the skin's median colour at each sample, in frames.
        rounds: of appearance, then poses and expressions.
        problem_of: the energy of a frame under an appearance.
    """
    xs, gains = [view.start for view in views], np.ones(len(views))
    for number in range(rounds):
        appearance = estimate_appearance(
            frames, samples, observe_samples(views, xs, gains, face), albedo_prior
        )
        problem = problem_of(appearance)
        if number == 0:
            fits = [problem.solve(view) for view in views]
            found = [(fit.x, fit.gain) for fit in fits]
        else:
            found = [problem.settled(view, x) for view, x in zip(views, xs, strict=True)]
        xs, gains = [x for x, _ in found], np.array([gain for _, gain in found])
        gains = gains / np.exp(np.log(gains).mean())  # nobody knows the light's own brightness
    seen = observe_samples(views, xs, gains, face)
    return estimate_appearance(frames, samples, seen, albedo_prior)
