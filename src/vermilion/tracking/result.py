"""Files of the tracking stage: the person (`identity.npz`) and the take's motion (`fit.npz`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.landmarks.sets import IBUG66, LandmarkSet
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.tracking.identity.landmark_identity import IdentityFit, TakeSample
from vermilion.tracking.identity.lip_offset import OwnLips, lip_offset
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.places import LandmarkPlaces


@dataclass(frozen=True)
class Identity:
    """One person in the tracker's model.

    Attributes:
        identity: (I,) in standard deviations.
        neutral_mm: (V, 3) in the head frame: the model's, and what it cannot show of the person.
        landmark_offset_mm: (N, 3) in the head frame: the neutral's landmarks as detected, minus
            the model's.
        takes: (T,) str, all of the subject's takes that were used.
        focal_px: (T,) focal lengths, known or estimated.
        calibrated: (T,) bool, whether the focal length was known.
        places: where the N landmarks lie on the model; None: the 66 vertices that it names.
    """

    identity: np.ndarray
    neutral_mm: np.ndarray
    landmark_offset_mm: np.ndarray
    takes: np.ndarray
    focal_px: np.ndarray
    calibrated: np.ndarray
    places: LandmarkPlaces | None = None

    @property
    def landmark_set(self) -> LandmarkSet:
        """The landmarks that the person was found in."""
        return IBUG66 if self.places is None else self.places.landmark_set

    @classmethod
    def of(
        cls,
        fit: IdentityFit,
        model: FaceModel,
        samples: Sequence[TakeSample],
        places: LandmarkPlaces | None = None,
        own_lips: OwnLips | None = None,
    ) -> Identity:
        """Of a fit to the samples of some takes; `places` as for the fit.

        `own_lips`: the neutral has the person's own mouth, as far as the landmark offsets tell it; None: the model's.
        """
        neutral = model.neutral_of(fit.identity)
        if own_lips is not None:
            neutral = neutral + lip_offset(model, neutral, fit.landmark_offset_mm, own_lips)
        return cls(
            identity=fit.identity,
            neutral_mm=neutral,
            landmark_offset_mm=fit.landmark_offset_mm,
            takes=np.array([sample.name for sample in samples], dtype=str),
            focal_px=np.array([fit.focal_px[sample.name] for sample in samples]),
            calibrated=np.array([sample.calibrated for sample in samples]),
            places=places,
        )

    def has_own_lips(self, model: FaceModel) -> bool:
        """Whether the neutral has a mouth that the model cannot show, known from dense landmarks."""
        return not np.allclose(self.neutral_mm, model.neutral_of(self.identity), atol=1e-3)

    def vertices(self, model: FaceModel, weights: np.ndarray) -> np.ndarray:
        """The person's meshes (..., V, 3) mm of blend weights (..., K), head frame."""
        own = self.neutral_mm - model.neutral_of(self.identity)
        return model.vertices(self.identity, weights) + own

    def focal_of(self, take: str) -> float | None:
        """Estimated focal length of a take; None where the take is unknown or calibrated."""
        for name, focal, known in zip(self.takes, self.focal_px, self.calibrated, strict=True):
            if name == take and not known:
                return float(focal)
        return None

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        arrays = {name: np.asarray(getattr(self, name)) for name in _names(Identity)}
        places = {} if self.places is None else self.places.arrays()
        places = {f"places/{key}": value for key, value in places.items()}
        write_arrays(path, compressed=False, **arrays, **places)

    @classmethod
    def load(cls, path: str | Path) -> Identity:
        """Read what `save` wrote."""
        arrays = _load(path, cls)
        everything = read_arrays(path, "Identity of the tracker")
        start = "places/"
        places = {k.removeprefix(start): v for k, v in everything.items() if k.startswith(start)}
        return cls(**arrays, places=LandmarkPlaces.from_arrays(places) if places else None)


@dataclass(frozen=True)
class TrackedTake:
    """Pose and blend weights of every frame of a take, in the world.

    C_f = vertices(weights_f) @ world_from_head_rotation_f.T + world_from_head_translation_f.

    Attributes:
        frames: (F,) int.
        weights: (F, K) blend weights in [0, 1], in the order of `expression_names`.
        expression_names: (K,) str.
        world_from_head_rotation: (F, 3, 3).
        world_from_head_translation_mm: (F, 3).
        valid: (F,) bool; poses and weights of the others are interpolated.
        reprojection_px: (F,) RMS over all landmarks except the jaw's; NaN where none were found.
        camera_name, camera_model, camera_params, camera_size_px, cam_from_world: the camera of the
            images, with the focal length that was used.
        piece: (F,) int piece between cuts of each frame, counted from 0; None: all in one.
    """

    frames: np.ndarray
    weights: np.ndarray
    expression_names: np.ndarray
    world_from_head_rotation: np.ndarray
    world_from_head_translation_mm: np.ndarray
    valid: np.ndarray
    reprojection_px: np.ndarray
    camera_name: np.ndarray
    camera_model: np.ndarray
    camera_params: np.ndarray
    camera_size_px: np.ndarray
    cam_from_world: np.ndarray
    piece: np.ndarray | None = None

    @classmethod
    def of(
        cls,
        frames: np.ndarray,
        motion: HeadMotion,
        valid: np.ndarray,
        camera: Camera,
        model: FaceModel,
        piece: np.ndarray | None = None,
    ) -> TrackedTake:
        """Motion relative to the camera, carried to the world.

        Args:
            frames: (F,) int numbers.
            motion: of these frames, camera from head.
            valid: (F,) bool, frames that can be trusted.
            camera: of the images, with the focal length that was used.
            model: the tracker's.
            piece: (F,) int piece of each frame; None: all in one.
        """
        to_world = camera.rotation.T
        return cls(
            frames=np.asarray(frames),
            weights=motion.weights,
            expression_names=np.array(model.expression_names, dtype=str),
            world_from_head_rotation=to_world @ motion.rotation,
            world_from_head_translation_mm=(motion.translation_mm - camera.translation)
            @ to_world.T,
            valid=np.asarray(valid, dtype=bool),
            reprojection_px=motion.reprojection_px,
            **camera_arrays(camera),
            piece=None if piece is None else np.asarray(piece),
        )

    @property
    def pieces(self) -> np.ndarray:
        """(F,) int piece between cuts of each frame: what follows time stops where it changes."""
        none = np.zeros(len(self.frames), dtype=np.int64)
        return none if self.piece is None else np.asarray(self.piece)

    def piece_span(self, frame: int) -> tuple[int, int]:
        """First and last frame of the piece that a frame is in, frame numbers."""
        own = self.frames[self.pieces == self.pieces[self.index_of([frame])[0]]]
        return int(own[0]), int(own[-1])

    @property
    def camera(self) -> Camera:
        """The camera of the images."""
        width, height = (int(n) for n in self.camera_size_px)
        params = tuple(float(p) for p in self.camera_params)
        return Camera(
            str(self.camera_name),
            str(self.camera_model),
            params,
            width,
            height,
            self.cam_from_world,
        )

    def index_of(self, frames: np.ndarray | Sequence[int]) -> np.ndarray:
        """Rows (n,) of `frames` (n,), their numbers. Raises KeyError where one is not in the take."""
        rows = {int(frame): row for row, frame in enumerate(self.frames)}
        return np.array([rows[int(frame)] for frame in frames], dtype=np.int64)

    def vertices_mm(
        self,
        model: FaceModel,
        identity: Identity,
        rows: np.ndarray,
        offsets_mm: np.ndarray | None = None,
    ) -> np.ndarray:
        """Meshes (n, V, 3) mm of some rows (n,) int, world.

        `offsets_mm` (n, V, 3) in the head frame are added to the model's vertices.
        """
        local = identity.vertices(model, self.weights[rows])
        if offsets_mm is not None:
            local = local + offsets_mm
        turned = local @ np.swapaxes(self.world_from_head_rotation[rows], 1, 2)
        return turned + self.world_from_head_translation_mm[rows, None]

    def save(self, path: str | Path) -> None:
        """Write `.npz`, whole or not at all."""
        arrays = {name: np.asarray(getattr(self, name)) for name in _names(TrackedTake)}
        write_arrays(path, compressed=False, **arrays, piece=self.pieces)

    @classmethod
    def load(cls, path: str | Path) -> TrackedTake:
        """Read what `save` wrote."""
        piece = read_arrays(path, "TrackedTake of the tracker").get("piece")
        return cls(**_load(path, cls), piece=piece)


def camera_arrays(camera: Camera) -> dict[str, np.ndarray]:
    """The fields of `TrackedTake` that say what its camera is: size (2,), pose (3, 4), ..."""
    return {
        "camera_name": np.array(camera.name),
        "camera_model": np.array(camera.model),
        "camera_params": np.array(camera.params, dtype=np.float64),
        "camera_size_px": np.array([camera.width_px, camera.height_px]),
        "cam_from_world": np.asarray(camera.cam_from_world, dtype=np.float64),
    }


def _names(kind: type) -> list[str]:
    """The fields of a record that are arrays."""
    return [item.name for item in fields(kind) if item.name not in ("places", "piece")]


def _load(path: str | Path, kind: type) -> dict[str, np.ndarray]:
    return read_arrays(path, f"{kind.__name__} of the tracker", _names(kind))
