"""A studio actor whose skin folds with the expression: images, the smooth mesh, and the true one.

Forehead, glabella, the corners of the eyes, and the folds beside the nose are displaced along the
normals, as deep as the expression that folds them is strong. The first frames show the neutral without
folds. The smooth mesh is what a perfect tracker would give: the tracker's topology on the true surface
without folds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import sparse

from vermilion.detail.relief.subdivision import loop_subdivision
from vermilion.faces.model import FaceModel
from vermilion.faces.procedural import studio_model, tracker_model
from vermilion.geometry.camera import Camera
from vermilion.geometry.closest_points import Surface as ClosestSurface
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.rotations import rotation_matrix
from vermilion.imaging.display import srgb8
from vermilion.imaging.images import srgb_to_linear
from vermilion.studio.lighting import LIGHTINGS
from vermilion.studio.look import look_of
from vermilion.studio.render import Scene, render
from vermilion.studio.rig import MULTIVIEW_CAMERAS, RigSettings, video_camera
from vermilion.studio.sensor import sensor_noise
from vermilion.studio.surface import StudioSurface, surface_of

#: Frames of the neutral, before any fold comes.
STILL = 10
#: Folds: the shapes that make them, depth (mm) at weight 1, half width (mm).
FOLDS = {
    "forehead": (("browInnerUp", "browOuterUp_L", "browOuterUp_R"), 0.9, 2.2),
    "glabella": (("browDown_L", "browDown_R"), 0.9, 1.8),
    "eyes": (("cheekSquint_L", "cheekSquint_R"), 0.6, 1.5),
    "cheeks": (("mouthSmile_L", "mouthSmile_R"), 1.5, 2.5),
}
_LEVELS = 2
_NOISE = (0.0015, 0.00004)  # read and shot noise of the sensor


@dataclass(frozen=True)
class WrinkledActor:
    """An actor in front of a camera.

    Attributes:
        seed: of the person and the skin.
        lights: name of the studio's light.
        standing: folds that are there in all frames, instead of with the expression (share of their depth).
        n_frames: of the take; from frame 10 on brows, eyes and mouth move.
        size_px: (width, height) of the images.
    """

    seed: int = 3
    lights: str = "room"
    standing: float = 0.0
    n_frames: int = 34
    size_px: tuple[int, int] = (960, 720)

    @cached_property
    def studio(self) -> FaceModel:
        """The actor's model, without folds."""
        return studio_model()

    @cached_property
    def tracker(self) -> FaceModel:
        """The tracker's topology."""
        return tracker_model()

    @cached_property
    def _finer(self) -> tuple[sparse.csr_matrix, np.ndarray, np.ndarray]:
        """Finer vertices of the front of the head, their triangles, and which ones these come from."""
        front = self.studio.neutral_mm[self.studio.triangles][:, :, 2].max(axis=1) > 0.0
        points, everywhere = self.studio.neutral_mm, np.ones(self.studio.n_vertices, dtype=bool)
        finer, fine = loop_subdivision(
            points, self.studio.triangles[front], _LEVELS, 0.0, everywhere
        )
        return finer, fine, np.flatnonzero(front)

    @property
    def triangles(self) -> np.ndarray:
        """Triangles (T, 3) of the true mesh."""
        return self._finer[1]

    @cached_property
    def _identity(self) -> np.ndarray:
        drawn = np.random.default_rng([self.seed, 1]).standard_normal(self.studio.n_identities)
        return 0.7 * np.clip(drawn, -2, 2)

    def weights(self, frame: int) -> np.ndarray:
        """Weights (K,) of the studio's shapes: neutral first, then brows, frown, smile in turn."""
        names = self.studio.expression_names
        weights = np.zeros(len(names))
        if frame < STILL:
            return weights
        time = (frame - STILL) / 8.0
        for k, (shapes, _, _) in enumerate(FOLDS.values()):
            strength = max(0.0, np.sin(np.pi * (time - 0.55 * k)))
            for name in shapes:
                weights[names.index(name)] = 0.8 * strength
        return weights

    def _pose(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        swing = np.array([np.sin(frame / 9.0), np.sin(frame / 7.0), np.sin(frame / 11.0)])
        return rotation_matrix(np.radians([4.0, 10.0, 3.0]) * swing), 4.0 * swing

    def _posed(self, points_mm: np.ndarray, frame: int) -> np.ndarray:
        rotation, shift = self._pose(frame)
        return points_mm @ rotation.T + shift

    def _smooth(self, frame: int) -> np.ndarray:
        """(V, 3) of the studio's topology without folds, head frame."""
        return self.studio.vertices(self._identity, self.weights(frame))

    @cached_property
    def _folds(self) -> dict[str, np.ndarray]:
        """Height (V',) mm of each fold at weight 1 on the fine vertices."""
        at = self._finer[0] @ self.studio.neutral_mm
        marks = self.studio.neutral_mm[self.studio.landmarks]
        return {
            name: depth * _profile(at, lines_of(name, marks), width)
            for name, (_, depth, width) in FOLDS.items()
        }

    def height_mm(self, frame: int) -> np.ndarray:
        """Height (V',) of the folds of a frame on the fine vertices."""
        names, weights = self.studio.expression_names, self.weights(frame)
        if self.standing > 0:
            return self.standing * sum(self._folds.values())
        return sum(
            weights[names.index(FOLDS[name][0][0])] * height for name, height in self._folds.items()
        )

    def true_mm(self, frame: int) -> np.ndarray:
        """True mesh (V', 3) with its folds, world."""
        fine = self._finer[0] @ self._smooth(frame)
        normals = vertex_normals(fine, self.triangles)
        return self._posed(fine + self.height_mm(frame)[:, None] * normals, frame)

    @cached_property
    def _places(self) -> sparse.csr_matrix:
        """Vertices of the tracker as points on the studio's mesh without folds."""
        surface = ClosestSurface(self.studio.neutral_mm, self.studio.triangles)
        normals = vertex_normals(self.tracker.neutral_mm, self.tracker.triangles)
        found = surface.closest(self.tracker.neutral_mm, normals, 0.0)
        return found.matrix(self.studio.triangles, self.studio.n_vertices)

    def tracked_mm(self, frame: int) -> np.ndarray:
        """What a perfect tracker gives (V, 3), world."""
        return self._posed(self._places @ self._smooth(frame), frame)

    @cached_property
    def camera(self) -> Camera:
        """In front of the face."""
        size = self.size_px
        settings = RigSettings(MULTIVIEW_CAMERAS, 735.0, size, size, size, 245.0, 105.0, 250.0)
        return video_camera(self.studio, self.studio.neutral_of(self._identity), settings)["cam"]

    @cached_property
    def _scene(self) -> Scene:
        finer, triangles, front = self._finer
        coarse = surface_of(self.studio)
        material = coarse.material[front]
        for _ in range(_LEVELS):
            material = np.repeat(material, 4)
        surface = StudioSurface(
            solid_mm=(finer @ coarse.solid_mm).astype(np.float32),
            lip_mm=(finer @ coarse.lip_mm).astype(np.float32),
            inside_mm=(finer @ coarse.inside_mm).astype(np.float32),
            upper=finer @ coarse.upper.astype(float) > 0.5,
            material=material,
            brows_mm=coarse.brows_mm,
            chin_mm=coarse.chin_mm,
        )
        return Scene(
            triangles, surface, look_of(self.seed, False), LIGHTINGS[self.lights], 64, 8, 4
        )

    def image(self, frame: int) -> np.ndarray:
        """Image (h, w, 3) of a frame with the sensor's noise, linear RGB that was 8 bits."""
        if frame not in self._images:
            self._images[frame] = self._rendered(frame)
        return srgb_to_linear(self._images[frame].astype(np.float32) / 255)

    @cached_property
    def _images(self) -> dict[int, np.ndarray]:
        return {}

    def _rendered(self, frame: int) -> np.ndarray:
        drawn = render(self._scene, self.true_mm(frame), {"cam": self.camera})["cam"]
        noisy = sensor_noise(drawn, *_NOISE, self.seed, "wrinkled", frame)
        return srgb8(noisy)


def lines_of(name: str, marks: np.ndarray) -> list[np.ndarray]:
    """Polylines (n, 3) mm of a kind of fold, by the 66 landmarks `marks` (66, 3) of the neutral."""
    if name == "forehead":
        brows = marks[[17, 19, 21, 22, 24, 26]]
        return [brows + np.array([0.0, up, 0.0]) for up in (12.0, 20.0, 28.0)]
    if name == "glabella":
        middle = 0.5 * (marks[21] + marks[22])
        return [
            middle + np.array([[x, -9.0, 0.0], [1.2 * x, 3.0, 0.0], [1.6 * x, 11.0, 0.0]])
            for x in (-3.5, 3.5)
        ]
    sides = ((36, 31, 48, -1.0), (45, 35, 54, 1.0))
    if name == "eyes":
        return [
            marks[eye] + np.array([[5.0 * s, 0.2 * up, -2.0], [19.0 * s, up, -12.0]])
            for eye, _, _, s in sides
            for up in (6.0, 0.0, -6.0)
        ]
    return [
        np.stack(
            [
                marks[nose] + [6.0 * s, 6.0, -3.0],
                0.5 * (marks[nose] + marks[corner]) + [10.0 * s, 1.0, -3.0],
                marks[corner] + [9.0 * s, -2.0, -4.0],
            ]
        )
        for _, nose, corner, s in sides
    ]


def _profile(points_mm: np.ndarray, lines: list[np.ndarray], width_mm: float) -> np.ndarray:
    """Height (V,) of grooves of depth 1 with raised edges along polylines, mean about zero."""
    height = np.zeros(len(points_mm))
    for line in lines:
        distance = np.full(len(points_mm), np.inf)
        for start, end in pairwise(line):
            way = end - start
            share = np.clip((points_mm - start) @ way / (way @ way), 0.0, 1.0)
            beside = np.linalg.norm(points_mm - start - share[:, None] * way, axis=1)
            distance = np.minimum(distance, beside)
        at = (distance / width_mm) ** 2
        height -= (1.0 - 0.5 * at) * np.exp(-0.5 * at)
    return height
