"""A studio actor with a mouth of their own: colours of teeth, gums and tongue, wetness, light, a moving tongue.

The truth is the visible border of the opening, as a person would draw it: a tongue on a lip hides that lip.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import Camera
from vermilion.imaging.display import srgb8
from vermilion.studio.kernels import TONGUE
from vermilion.studio.labels import lip_contours
from vermilion.studio.lighting import AreaLight, Lighting
from vermilion.studio.look import Look, look_of
from vermilion.studio.own_expressions import with_own_expressions
from vermilion.studio.performance import generated_weights, head_motion
from vermilion.studio.render import Scene, render
from vermilion.studio.rig import MULTIVIEW_CAMERAS, RigSettings, video_camera
from vermilion.studio.sensor import sensor_noise
from vermilion.studio.surface import StudioSurface, surface_of

FPS, SIZE_PX = 12.0, (1280, 720)
#: What a tongue does, and how often: it lies, touches the upper teeth, stands between the rows, hangs out.
PLACES = ("low", "raised", "between", "out")
OFTEN = (0.4, 0.25, 0.2, 0.15)
#: The tongue's surface: places along it and round it, half its width (mm), thickness (mm).
ALONG, ROUND, HALF_WIDTH_MM, THICK_MM = 40, 36, 17.0, 10.0
#: Where its tip is in each of `PLACES`: from the lower and the upper front teeth, between them, the lower lip.
TIP_MM = np.array([[0.0, -6.0, -9.0], [0.0, 1.0, -8.0], [0.0, 0.0, 1.0], [0.0, 1.0, 7.0]])
ROOT_MM = (0.0, -14.0, -48.0)  # from the edge of the lower front teeth
LEAST_GAP_MM = 3.0  # between the rows of teeth, for the tongue to leave its place


def varied_look(seed: int) -> Look:
    """The look of the actor with this seed, with lips, mouth and wetness drawn from it."""
    random, look = np.random.default_rng([seed, 7020]), look_of(seed, False)

    def between(low: tuple[float, ...], high: tuple[float, ...]) -> np.ndarray:
        low_rgb, high_rgb = np.array(low), np.array(high)
        return (low_rgb + random.uniform() * (high_rgb - low_rgb)).astype(np.float32)

    painted = random.uniform() < 0.3
    tint = random.uniform(0.85, 1.1, 3) if not painted else random.uniform(0.25, 0.9, 3)
    flesh = random.uniform(0.75, 1.25)
    return look._replace(
        lips=(look.lips * tint).astype(np.float32),
        inside=flesh * between((0.20, 0.06, 0.06), (0.36, 0.14, 0.13)),
        gums=flesh * between((0.24, 0.07, 0.07), (0.46, 0.22, 0.21)),
        tongue=flesh * between((0.30, 0.10, 0.10), (0.50, 0.28, 0.26)),
        teeth=between((0.34, 0.27, 0.17), (0.72, 0.69, 0.62)),
        wet=float(random.uniform(0.4, 3.0)),
    )


def varied_lighting(seed: int) -> Lighting:
    """A key light from the front or a side, above or a little below, and a sky of any strength."""
    random = np.random.default_rng([seed, 7021])
    turn, height = np.radians(random.uniform(-75, 75)), np.radians(random.uniform(-10, 60))
    towards = np.array(
        [np.sin(turn) * np.cos(height), np.sin(height), np.cos(turn) * np.cos(height)]
    )
    warm = np.array([1.0, 0.93, 0.85]) ** random.uniform(-1, 1)
    key, above = random.uniform(0.3, 1.0) * warm, random.uniform(0.12, 0.55)
    light = AreaLight(tuple(900.0 * towards), random.uniform(40, 300), tuple(key))
    below = above * random.uniform(0.2, 0.7)
    wall = tuple(np.full(3, random.uniform(0.05, 0.4)))
    return Lighting((light,), (above,) * 3, (below,) * 3, wall)


@dataclass(frozen=True)
class VariedMouth:
    """An actor in front of a camera.

    Attributes:
        base: the face model, with teeth (V vertices).
        seed: of the person, the performance, the light, the camera.
        n_frames: of the take.
    """

    base: FaceModel
    seed: int
    n_frames: int

    @cached_property
    def _random(self) -> np.random.Generator:
        return np.random.default_rng([self.seed, 7022])

    @cached_property
    def _own(self) -> FaceModel:
        return with_own_expressions(self.base, self.seed, 1.0)

    @cached_property
    def model(self) -> FaceModel:
        """The base with this actor's expressions, and the tongue's triangles after its own."""
        own = self._own
        return replace(own, triangles=np.concatenate([own.triangles, self._tongue_triangles]))

    @cached_property
    def surface(self) -> StudioSurface:
        """Texture coordinates, the tongue's included."""
        surface, n = surface_of(self.base), ALONG * ROUND
        place = self._tongue_mm(0).astype(np.float32)
        return replace(
            surface,
            solid_mm=np.concatenate([surface.solid_mm, place]),
            lip_mm=np.concatenate([surface.lip_mm, np.full(n, -30, np.float32)]),
            inside_mm=np.concatenate([surface.inside_mm, np.full(n, 30, np.float32)]),
            upper=np.concatenate([surface.upper, np.zeros(n, dtype=bool)]),
            material=np.concatenate(
                [surface.material, np.full(len(self._tongue_triangles), TONGUE, np.uint8)]
            ),
        )

    @cached_property
    def _identity(self) -> np.ndarray:
        drawn = np.random.default_rng([self.seed, 1]).standard_normal(self.base.n_identities)
        return np.clip(drawn, -2, 2)

    @cached_property
    def weights(self) -> np.ndarray:
        """(F, K) of the actor's shapes."""
        return generated_weights(self.base.expression_names, self.n_frames, FPS, self.seed, 1.0)

    @cached_property
    def _motion(self) -> tuple[np.ndarray, np.ndarray]:
        neck = self.base.neutral_mm[self.base.landmarks[8]] + [0.0, -40.0, -70.0]
        return head_motion(self.n_frames, FPS, self.seed, 25.0, 10.0, neck)

    @cached_property
    def _head_mm(self) -> np.ndarray:
        """(F, V, 3) without the tongue, head frame."""
        return np.stack([self._own.vertices(self._identity, row) for row in self.weights])

    @cached_property
    def _front_teeth(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices of the upper and of the lower front teeth's edges."""
        neutral, teeth = self.base.neutral_mm, np.flatnonzero(self.base.regions["teeth"])
        front = teeth[np.abs(neutral[teeth, 0]) < 8.0]
        moved = np.abs(self._jaw_shape[front]).sum(axis=1) > 1.0
        upper, lower = front[~moved], front[moved]
        low = np.argsort(neutral[upper, 1])[: len(upper) // 6]
        high = np.argsort(-neutral[lower, 1])[: len(lower) // 6]
        return upper[low], lower[high]

    @cached_property
    def _jaw_shape(self) -> np.ndarray:
        names = self.base.expression_names
        return self.base.expressions_mm[names.index("jawOpen")]

    @cached_property
    def places(self) -> np.ndarray:
        """(F, 4) shares of `PLACES`, smooth over time."""
        steps = np.arange(0, self.n_frames + 6, 6)
        drawn = np.eye(len(PLACES))[self._random.choice(len(PLACES), len(steps), p=OFTEN)]
        time = np.arange(self.n_frames)
        return np.stack([np.interp(time, steps, column) for column in drawn.T], axis=1)

    def _tongue_mm(self, frame: int) -> np.ndarray:
        """The tongue's vertices (ALONG * ROUND, 3), head frame: a tapering tube about a bent line."""
        head = self._head_mm[frame]
        upper, lower = (head[ids].mean(axis=0) for ids in self._front_teeth)
        lower_lip = head[self.base.inner_contour]
        lower_lip = lower_lip[np.abs(lower_lip[:, 0]) < 6.0]
        lip = lower_lip[np.argmin(lower_lip[:, 1])]
        places = np.stack([lower, upper, 0.5 * (upper + lower), lip])
        tips = places + TIP_MM
        free = np.clip((upper[1] - lower[1]) / LEAST_GAP_MM - 1.0, 0.0, 1.0)
        share = self.places[frame] * free
        share[0] += 1.0 - share.sum()
        tip, root = share @ tips, lower + ROOT_MM
        middle = np.array([0.0, max(root[1], tip[1]) + 3.0, 0.4 * root[2] + 0.6 * tip[2]])
        u = np.linspace(0.0, 1.0, ALONG)[:, None]
        line = (1 - u) ** 2 * root + 2 * u * (1 - u) * middle + u**2 * tip
        ahead = np.gradient(line, axis=0)
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        up = np.cross(ahead, [1.0, 0.0, 0.0])
        taper = np.sqrt(np.clip(1.0 - u**4, 0.0, 1.0)) + 1e-3
        angle = np.linspace(0.0, 2 * np.pi, ROUND, endpoint=False)
        across = HALF_WIDTH_MM * taper * np.cos(angle)
        high = 0.5 * THICK_MM * taper * np.sin(angle)
        points = line[:, None] + across[..., None] * [1.0, 0.0, 0.0] + high[..., None] * up[:, None]
        return points.reshape(-1, 3)

    @cached_property
    def _tongue_triangles(self) -> np.ndarray:
        """(T, 3) of the tube and its tip, after the base's vertices."""
        ring, step = np.arange(ROUND), np.roll(np.arange(ROUND), -1)
        rows = ROUND * np.arange(ALONG - 1)[:, None]
        a, b = (rows + ring).ravel(), (rows + step).ravel()
        walls = np.concatenate(
            [np.stack([a, b, b + ROUND], axis=1), np.stack([a, b + ROUND, a + ROUND], axis=1)]
        )
        last = ROUND * (ALONG - 1)
        tip = np.stack([np.full(ROUND - 2, last), last + ring[1:-1], last + ring[2:]], axis=1)
        return (np.concatenate([walls, tip]) + self.base.n_vertices).astype(
            self.base.triangles.dtype
        )

    def vertices_mm(self, frame: int) -> np.ndarray:
        """True mesh (V', 3) with the tongue, world."""
        turns, shifts = self._motion
        head = np.concatenate([self._head_mm[frame], self._tongue_mm(frame)])
        return head @ turns[frame].T + shifts[frame]

    @cached_property
    def camera(self) -> Camera:
        """In front of the face; mouths are some 70 to 150 px wide."""
        view = np.random.default_rng([self.seed, 7023]).uniform(250.0, 480.0)
        settings = RigSettings(
            MULTIVIEW_CAMERAS, 800.0, SIZE_PX, SIZE_PX, SIZE_PX, view, view, view
        )
        return video_camera(self.base, self.base.neutral_of(self._identity), settings)["cam"]

    def image(self, frame: int) -> np.ndarray:
        """Image (h, w, 3) uint8, display sRGB, blurred, noisy and compressed as of this actor's camera."""
        scene = Scene(
            self.model.triangles, self.surface, varied_look(self.seed), varied_lighting(self.seed), 64, 8, 4
        )  # fmt: skip
        drawn = render(scene, self.vertices_mm(frame), {"cam": self.camera})["cam"]
        random = np.random.default_rng([self.seed, 7024])
        blur, noise, quality = (
            random.uniform(0.4, 1.4),
            random.uniform(0.3, 2.5),
            random.integers(60, 96),
        )
        drawn = cv2.GaussianBlur(drawn, (0, 0), blur)
        noisy = sensor_noise(drawn, 0.0015 * noise, 0.00004 * noise, self.seed, "mouth", frame)
        coded = cv2.imencode(
            ".jpg", srgb8(noisy)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, int(quality)]
        )[1]
        return cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1]

    def borders_px(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """True upper and lower inner border (n, 2) px, from the right corner of the mouth to the left one."""
        loop = lip_contours(self.model, self.surface, self.vertices_mm(frame), self.camera)["inner"]
        start, end = np.argmin(loop[:, 0]), np.argmax(loop[:, 0])
        loop = np.roll(loop, -start, axis=0)
        end = (end - start) % len(loop)
        return loop[: end + 1], np.concatenate([loop[end:], loop[:1]])[::-1]
