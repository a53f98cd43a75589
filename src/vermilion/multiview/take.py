"""One take's images and reference at every resolution; each frame's final registration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera, read_cameras
from vermilion.geometry.mesh import Mesh, vertex_normals
from vermilion.imaging.frames import FrameSource, open_frames
from vermilion.imaging.source import Source
from vermilion.multiview.cloud import near_mesh
from vermilion.multiview.contact import Contact, Lips, lips_of, resolve_contact
from vermilion.multiview.motion import CloudData, ReferenceFrame, cloud_planes
from vermilion.multiview.neutral import skin_of, stereo_cloud
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.refine import FrameMatchSettings, Registered, register_frame
from vermilion.multiview.solver import ThinPlate
from vermilion.multiview.stereo import Cloud, StereoSettings
from vermilion.multiview.views import Frame, load_frame, shrunk
from vermilion.storage.errors import InputError
from vermilion.storage.quality import QualityRow


@dataclass(frozen=True)
class ImageSettings:
    """See `vermilion.config.multiview` for meanings and units."""

    window_px: float
    floor: float

    def window_at(self, scale: float) -> float:
        """Small images keep a somewhat wider window than their scale says."""
        return self.window_px * np.sqrt(scale)


@dataclass(frozen=True)
class RefineSettings:
    """See `vermilion.config.multiview` for meanings and units."""

    scales: Sequence[float]
    lengths_mm: Sequence[float]
    sigma_px: float
    min_agreement: float
    max_step_mm: float
    ray_stride_px: int
    cloud_scale: float
    cloud_gate_mm: float
    max_residual_px: float
    min_seen_percent: float


@dataclass(frozen=True)
class MultiviewImages:
    """Reads a take's frames at any resolution."""

    source: FrameSource
    cameras: Mapping[str, Camera]
    settings: ImageSettings

    @classmethod
    def open(
        cls,
        source: Source,
        cameras: str | Path,
        settings: Mapping[str, float],
        subject: str = "",
        take: str = "",
    ) -> MultiviewImages:
        """The images of a take's source, seen by a folder of cameras (COLMAP text)."""
        frames = open_frames(source, subject, take)
        return cls(frames, read_cameras(cameras), ImageSettings(**settings))

    def load(self, number: int, scale: float = 1.0) -> Frame:
        """All views of a frame; see `views.load_frame`."""
        window = self.settings.window_at(scale)
        return load_frame(self.source, self.cameras, number, window, self.settings.floor, scale)

    def at(self, frame: Frame, scale: float) -> Frame:
        """A full-size frame at another size."""
        if scale == 1.0:
            return frame
        return shrunk(frame, scale, self.settings.window_at(scale), self.settings.floor)


#: Frames whose small images are kept in memory, about 3 MB each for ten cameras.
KEPT_FRAMES = 100


def open_coarse(
    images: MultiviewImages,
    number: int,
    vertices_mm: np.ndarray,
    triangles: np.ndarray,
    scale: float,
) -> tuple[ReferenceFrame, Callable[[int], Frame]]:
    """A frame whose mesh is known, at a smaller size, and a reader of frames of that size.

    Args:
        images: of the take.
        number: of the frame.
        vertices_mm: (V, 3) its mesh, world, mm.
        triangles: (T, 3).
        scale: of the images.
    """

    @lru_cache(maxsize=KEPT_FRAMES)
    def load(number: int) -> Frame:
        return images.load(number, scale)

    return ReferenceFrame.of(load(number), vertices_mm, triangles), load


@dataclass(frozen=True)
class AccurateFrame:
    """A frame of H.

    Attributes:
        registered: positions and how well they are known.
        contact: between the lips.
        cloud: the frame's stereo points near the mesh.
        quality: its quality row.
    """

    registered: Registered
    contact: Contact
    cloud: Cloud
    quality: QualityRow


def frame_cloud(
    images: MultiviewImages,
    frame: Frame,
    vertices_mm: np.ndarray,
    model: FaceModel,
    stereo: StereoSettings,
    settings: RefineSettings,
) -> Cloud:
    """Stereo points of a frame near vertices_mm (V, 3), world; none if off or without a pair."""
    scale = settings.cloud_scale
    if not scale:
        return Cloud.join([])
    stereo = replace(stereo, speckle_px=round(stereo.speckle_px * scale**2))
    try:
        raw = stereo_cloud(images.at(frame, scale), vertices_mm.mean(axis=0), stereo)
    except InputError:  # the cameras left make no stereo pair
        return Cloud.join([])
    mesh = Mesh(np.asarray(vertices_mm, dtype=np.float64), model.triangles)
    return near_mesh(raw, mesh, 2 * settings.cloud_gate_mm, skin_of(model))


class Refiner:
    """Registers any frame of a take to its neutral; frames do not depend on each other."""

    def __init__(
        self,
        images: MultiviewImages,
        model: FaceModel,
        neutral_frame: int,
        neutral_mm: np.ndarray,
        stereo: StereoSettings,
        settings: RefineSettings,
        matcher: FlowMatcher,
    ):
        """Read the neutral's frame.

        Args:
            images: of the take.
            model: the template, V vertices.
            neutral_frame: its number.
            neutral_mm: (V, 3) its mesh, world, mm.
            stereo, settings: see their classes.
            matcher: of images.
        """
        self.images, self.model, self.settings, self.matcher = images, model, settings, matcher
        self.neutral_mm = np.asarray(neutral_mm, dtype=np.float64)
        frame = images.load(neutral_frame)
        self.plate = ThinPlate.of(self.neutral_mm, model.triangles)
        self.references = {
            scale: ReferenceFrame.of(
                images.at(frame, scale), self.neutral_mm, model.triangles, self.plate
            )
            for scale in set(settings.scales)
        }
        self.stereo = stereo

    @cached_property
    def lips(self) -> Lips:
        return lips_of(self.model)

    @cached_property
    def seen_at_neutral(self) -> np.ndarray:
        """Vertices (V,) that two or more cameras see at the neutral."""
        sights = self.references[self.settings.scales[-1]].sights.values()
        return np.sum([sight.visible for sight in sights], axis=0) >= 2

    def refine(self, number: int, start_mm: np.ndarray) -> AccurateFrame:
        """Register a frame from start_mm (V, 3), world; a failure is flagged, not raised.

        The neutral's frame is the neutral.
        """
        try:
            frame = self.images.load(number)
        except InputError as error:
            return self._failed(number, start_mm, str(error))
        finest = self.references[self.settings.scales[-1]]
        if number == finest.frame.number:
            return self._neutral(frame, finest)
        return self.register(frame, start_mm)

    def register(
        self, frame: Frame, start_mm: np.ndarray, *, from_afar: bool = False
    ) -> AccurateFrame:
        """Register the images of a frame, be it of this take or of another one of the person.

        Args:
            frame: full-size images of cameras named as those of the neutral.
            start_mm: (V, 3).
            from_afar: begin with a round of twice the stiffness.
        """
        number, finest = frame.number, self.references[self.settings.scales[-1]]
        if not set(frame.views) & set(finest.sights):
            return self._failed(number, start_mm, "no camera in common with the neutral's frame")
        cloud = self._cloud(frame, start_mm)
        rounds = list(zip(self.settings.scales, self.settings.lengths_mm, strict=True))
        if from_afar:
            rounds.insert(0, (rounds[0][0], 2 * rounds[0][1]))
        levels = [
            (self.references[scale], self.images.at(frame, scale), length)
            for scale, length in rounds
        ]
        settings = self.settings
        match = FrameMatchSettings(
            settings.sigma_px, settings.max_step_mm, settings.min_agreement, settings.ray_stride_px
        )
        registered = register_frame(levels, start_mm, self.matcher, match, self._data(cloud))
        if not np.isfinite(registered.vertices_mm).all():
            return self._failed(number, start_mm, "the solve gave no finite positions")
        mobility = np.where(registered.cameras_seeing >= 2, 0.2, 1.0)
        contact = resolve_contact(registered.vertices_mm, self.model.triangles, self.lips, mobility)
        registered = replace(registered, vertices_mm=contact.vertices_mm)
        quality = self._quality(number, frame, registered, contact, cloud)
        return AccurateFrame(registered, contact, cloud, quality)

    def _neutral(self, frame: Frame, reference: ReferenceFrame) -> AccurateFrame:
        seeing = np.sum([sight.visible for sight in reference.sights.values()], axis=0)
        residual = np.where(seeing > 0, 0.0, np.nan)
        registered = Registered(self.neutral_mm, seeing.astype(np.uint8), residual)
        cloud = self._cloud(frame, self.neutral_mm)
        contact = Contact(self.neutral_mm, 0, 0.0, 0.0)
        quality = self._quality(frame.number, frame, registered, contact, cloud)
        return AccurateFrame(registered, contact, cloud, quality)

    def _cloud(self, frame: Frame, vertices_mm: np.ndarray) -> Cloud:
        return frame_cloud(self.images, frame, vertices_mm, self.model, self.stereo, self.settings)

    def _data(self, cloud: Cloud) -> CloudData:
        return CloudData(cloud, skin_of(self.model), self.settings.cloud_gate_mm)

    def _quality(self, number, frame, registered, contact, cloud) -> QualityRow:
        measured = self.seen_at_neutral & np.isfinite(registered.residual_px)
        residual = float(np.median(registered.residual_px[measured])) if measured.any() else np.nan
        seen = registered.cameras_seeing > 0
        share = 100.0 * float((seen & self.seen_at_neutral).sum() / self.seen_at_neutral.sum())
        reasons = []
        if not share >= self.settings.min_seen_percent:
            reasons.append(f"only {share:.0f} % of the visible vertices could be measured")
        if not residual <= self.settings.max_residual_px:
            reasons.append(f"median residual of {residual:.2f} px")
        valid = not reasons
        reasons += [f"camera {name}: {why}" for name, why in frame.missing.items()]
        figures = {
            "residual_px": residual,
            "cloud_distance_mm": self._cloud_distance(registered, cloud),
            "visible_vertices": int((registered.cameras_seeing >= 2).sum()),
            "measured_percent": share,
            "missing_cameras": len(frame.missing),
            "contact_vertices": contact.penetrating,
            "contact_deepest_mm": contact.deepest_mm,
            "contact_left_mm": contact.left_mm,
        }
        return QualityRow(number, valid, "; ".join(reasons), figures)

    def _cloud_distance(self, registered: Registered, cloud: Cloud) -> float:
        normals = vertex_normals(registered.vertices_mm, self.model.triangles)
        planes = cloud_planes(registered.vertices_mm, normals, self._data(cloud), sigma_mm=1.0)
        near = planes.weights > 0
        return float(np.median(np.abs(planes.heights_mm[near]))) if near.any() else np.nan

    def _failed(self, number: int, start_mm: np.ndarray, reason: str) -> AccurateFrame:
        start = np.asarray(start_mm, dtype=np.float64)
        unknown = np.full(len(start), np.nan)
        registered = Registered(start, np.zeros(len(start), dtype=np.uint8), unknown)
        quality = QualityRow(number, False, reason, {})
        return AccurateFrame(registered, Contact(start, 0, 0.0, 0.0), Cloud.join([]), quality)
