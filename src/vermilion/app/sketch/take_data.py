"""One take in memory: its face, cameras and neutral; meshes and images frame by frame."""

from __future__ import annotations

import threading
from collections import OrderedDict
from pathlib import Path

import cv2
import numpy as np

from vermilion.app.sketch.refusal import RefusedRequest
from vermilion.app.sketch.take_files import TakeFiles, existing
from vermilion.contours.maps import read_maps
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import Similarity, similarity_alignment
from vermilion.geometry.camera import Camera, read_cameras
from vermilion.guided.inputs import sketch_cameras
from vermilion.guided.regions import GuidedRegions, regions_of_face
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.multiview.files import read_neutral
from vermilion.storage.chunks import read_frames
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import rows_of_frames
from vermilion.tracking.result import Identity, TrackedTake

_JPEG_QUALITY = 92
_KEPT_IMAGES = 64


class TakeData:
    """What the page shows of a take.

    Attributes:
        files: where everything lies.
        face: the model of the sequence's topology.
        regions: inner lips and mouth region.
        neutral_mm: (V, 3) of the person.
        fit: the track.
        cameras: by name, those with images first of all.
        frames: numbers of the take's frames.
    """

    def __init__(self, files: TakeFiles):
        """Read what does not change. Raises InputError where the sequence was not made yet."""
        self.files = files
        missing = [str(p) for p in (files.face, files.neutral, files.fit) if not p.exists()]
        if missing or not files.sequence_chunks:
            raise InputError(
                f"no sequence of take {files.take.name} yet",
                f"the files {', '.join(missing) or files.sequence_pattern}",
                f"Run `snakemake guided --configfile {files.configuration}` first.",
            )
        self.face = FaceModel.load(files.face)
        self.fit = TrackedTake.load(files.fit)
        self.regions: GuidedRegions = regions_of_face(
            self.face, **files.guided.regions.model_dump()
        )
        is_rig = files.sequence == "H"
        self.neutral_mm = (
            read_neutral(files.neutral, self.face.n_vertices)
            if is_rig
            else Identity.load(files.neutral).neutral_mm
        )
        cameras = read_cameras(files.cameras)
        self.cameras: dict[str, Camera] = sketch_cameras(cameras, self.fit.camera, not is_rig)
        self.frames = files.take.frames
        self._source = open_frames(files.source, files.take.subject, files.take.take)
        self._stable = np.flatnonzero(self.face.regions["rigid"])
        self._images: OrderedDict[tuple[str, int], bytes] = OrderedDict()
        self._lock = threading.Lock()

    def camera(self, name: str) -> Camera:
        """A camera by name. Raises RefusedRequest (404)."""
        if name not in self.cameras:
            raise RefusedRequest(404, f"The take has no camera {name:.60}.")
        return self.cameras[name]

    def check_frame(self, frame: int) -> None:
        """Raises RefusedRequest (404) where the take has no such frame."""
        if frame not in self.frames:
            first, last = self.frames[0], self.frames[-1]
            raise RefusedRequest(404, f"The take has no frame {frame}; it has {first} to {last}.")

    def base(self, frame: int) -> np.ndarray:
        """The sequence's mesh (V, 3) float64, world. Raises RefusedRequest (404)."""
        self.check_frame(frame)
        return _finite(_mesh_of(self.files.sequence_chunks, frame), frame)

    def propagated(self, frame: int) -> np.ndarray:
        """The propagated mesh (V, 3) float64, world. Raises RefusedRequest (404) where there is none."""
        self.check_frame(frame)
        chunks = self.files.guided_chunks
        if frame not in rows_of_frames(chunks, [frame]):
            raise RefusedRequest(404, f"Frame {frame} was not propagated yet.")
        return _finite(_mesh_of(chunks, frame), frame)

    def head_from_world(self, mesh_mm: np.ndarray) -> Similarity:
        """The rigid motion that brings a mesh (V, 3), world, onto the neutral."""
        stable = self._stable
        return similarity_alignment(mesh_mm[stable], self.neutral_mm[stable], scale=1.0)

    def jpeg(self, camera: str, frame: int) -> bytes:
        """The image of a frame. Raises RefusedRequest (404), or InputError where it is unreadable."""
        self.camera(camera)
        self.check_frame(frame)
        key = (camera, frame)
        with self._lock:
            if key not in self._images:
                try:
                    image = to_display(self._source.read(camera, frame))
                except InputError as error:
                    raise RefusedRequest(404, f"Frame {frame} has no image: {error}") from error
                settings = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
                done, data = cv2.imencode(".jpg", image[..., ::-1], settings)
                if not done:
                    raise RefusedRequest(404, f"The image of frame {frame} cannot be shown.")
                self._images[key] = data.tobytes()
                if len(self._images) > _KEPT_IMAGES:
                    self._images.popitem(last=False)
            self._images.move_to_end(key)
            return self._images[key]

    @property
    def has_maps(self) -> bool:
        """Whether the stage `contours` drew likelihood maps of the take."""
        return bool(existing(self.files.maps_pattern))

    def likelihood(self, camera: str, frame: int, part: str) -> np.ndarray:
        """Map (h, w) of the `inner` or `outer` contour. Raises RefusedRequest (404) without one."""
        self.check_frame(frame)
        if camera == self.fit.camera.name:
            for folder in existing(self.files.maps_pattern):
                path = Path(folder) / f"{frame:06d}.exr"
                if path.is_file():
                    inner, outer = read_maps(path)
                    return inner if part == "inner" else outer
        raise RefusedRequest(404, f"No contour was detected in camera {camera}, frame {frame}.")


def _mesh_of(chunks: list[Path], frame: int) -> np.ndarray:
    return read_frames(chunks, [frame])[0].astype(np.float64)


def _finite(mesh: np.ndarray, frame: int) -> np.ndarray:
    if not np.isfinite(mesh).all():
        raise RefusedRequest(404, f"Frame {frame} has no mesh: it was not reconstructed.")
    return mesh
