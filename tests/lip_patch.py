"""A small mouth with known images, with and without tattoo, for the tests of inpainting.

A ring mesh: the inner loop is the mouth opening, the first rows turn inwards (mouth_inner), then
come the lips (vermilion), then skin. Its chart is polar, so that nothing overlaps.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from vermilion.faces.model import REGIONS, FaceModel
from vermilion.geometry.camera import Camera, look_at, pinhole
from vermilion.geometry.mesh import normalised, vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import to_display
from vermilion.imaging.images import srgb_to_linear
from vermilion.inpaint.fields import sample

#: Opening (mm) and pucker of a few mouths.
POSES = {"rest": (0.0, 0.0), "open": (7.0, 0.1), "pucker": (1.0, 1.0)}

ROWS, COLUMNS = 28, 96
INNER_ROWS, LIP_ROWS = 3, 11  # rows before the lips, rows before the skin
LIGHT = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
TEXTURE_PX = 512


def face_model() -> FaceModel:
    """The mouth at rest, slightly open."""
    vertices, uv, row = _shape(0.0, 0.0)
    regions = {name: np.zeros(len(vertices), dtype=bool) for name in REGIONS}
    lips = (row >= INNER_ROWS) & (row <= LIP_ROWS)
    regions["mouth_inner"] = row < INNER_ROWS
    regions["vermilion_upper"] = lips & (vertices[:, 1] > 0)
    regions["vermilion_lower"] = lips & (vertices[:, 1] <= 0)
    regions["face"] = row >= INNER_ROWS
    loop = np.arange(COLUMNS, dtype=np.int32)
    nothing = np.zeros((0, len(vertices), 3), np.float32)
    return FaceModel(
        "patch", vertices, _triangles(), (), nothing, nothing, uv.astype(np.float32),
        np.zeros(66, np.int32), LIP_ROWS * COLUMNS + loop, INNER_ROWS * COLUMNS + loop, regions,
    )  # fmt: skip


def _shape(opening: float, pucker: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    row, column = (a.reshape(-1) for a in np.mgrid[:ROWS, :COLUMNS])
    angle = 2 * np.pi * column / COLUMNS
    outwards = np.clip((row - INNER_ROWS) / (LIP_ROWS - INNER_ROWS), 0, None)  # 0 to 1 over lips
    width = (21.0 + 5.0 * outwards) * (1 - 0.3 * pucker)
    height = 1.2 + 0.6 * pucker + 8.0 * outwards
    x, y = width * np.cos(angle), height * np.sin(angle)
    bulge = 5.0 * np.sin(np.pi * np.clip(outwards, 0, 1)) * (1 + 0.5 * pucker)
    z = (
        bulge * np.abs(np.sin(angle))
        + 4.0 * pucker * np.exp(-outwards)
        - 0.004 * x**2
        - 0.002 * y**2
    )
    inside = np.clip(INNER_ROWS - row, 0, None)
    z = z - 1.5 * inside  # the inner rows go straight back
    y = y + np.where(y < 0, -opening, 0.0) * np.exp(-np.clip(outwards - 1, 0, None) / 2)
    radius = 0.12 + 0.33 * row / (ROWS - 1)
    uv = 0.5 + np.stack([radius * np.cos(angle), 0.75 * radius * np.sin(angle)], axis=1)
    return np.stack([x, y, z], axis=1), uv, row


def _triangles() -> np.ndarray:
    row, column = (a.reshape(-1) for a in np.mgrid[: ROWS - 1, :COLUMNS])
    a, b = row * COLUMNS + column, row * COLUMNS + (column + 1) % COLUMNS
    c, d = a + COLUMNS, b + COLUMNS
    return np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)]).astype(np.int32)


def vertices_at(opening_mm: float, pucker: float) -> np.ndarray:
    """(V, 3) mm of an expression."""
    return _shape(opening_mm, pucker)[0]


def cameras() -> dict[str, Camera]:
    """A frontal camera and one to each side, 0.33 mm a pixel."""
    up, places = (
        np.array([0.0, 1.0, 0.0]),
        {"front": (0, 0), "left": (180, 40), "right": (-180, -40)},
    )
    return {
        name: pinhole(name, 1500.0, 240, 180, look_at(np.array([*xy, 500.0]), np.zeros(3), up))
        for name, xy in places.items()
    }


@cache
def albedo(tattoo: bool, seed: int = 5) -> np.ndarray:
    """Linear albedo over the whole chart (512, 512, 3); the tattoo reaches 1 mm past the lips."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:TEXTURE_PX, :TEXTURE_PX]
    u, v = (x + 0.5) / TEXTURE_PX - 0.5, 0.5 - (y + 0.5) / TEXTURE_PX
    row = (np.hypot(u, v / 0.75) - 0.12) / 0.33 * (ROWS - 1)
    fine = cv2.GaussianBlur(rng.normal(size=u.shape), (0, 0), 3)
    fine *= 0.03 / fine.std()
    lips = np.clip((LIP_ROWS + 0.5 - row) / 1.5, 0, 1)[..., None]
    image = (1 - lips) * [0.66, 0.55, 0.46] + lips * [0.80, 0.50, 0.50] + fine[..., None]
    if tattoo:
        pattern = cv2.GaussianBlur(rng.normal(size=u.shape), (0, 0), 5) > 0
        ink = np.where(pattern[..., None], [0.9, 0.9, 0.85], [0.25, 0.3, 0.45])
        image = np.where((row < LIP_ROWS + 1.2)[..., None], ink, image)
    return srgb_to_linear(np.clip(image, 0, 1))


def render(
    model: FaceModel, vertices: np.ndarray, camera: Camera, tattoo: bool, light: float = 1.0
) -> np.ndarray:
    """Linear image (h, w, 3): diffuse light, dark behind the mouth opening; 16 rays a pixel."""
    lens = (camera.model, camera.params, camera.width_px, camera.height_px)
    seen = (vertices.tobytes(), *lens, camera.cam_from_world.tobytes())
    if seen not in _SEEN:
        _SEEN[seen] = _see(model, vertices, camera)
    key = (*seen, tattoo)
    if key not in _RENDERED:
        hit, texel, shade = _SEEN[seen]
        colour = np.zeros((*hit.shape, 3), dtype=np.float32)
        colour[hit] = sample(albedo(tattoo), texel) * shade[:, None]
        size = (camera.width_px, camera.height_px)
        _RENDERED[key] = cv2.resize(colour, size, interpolation=cv2.INTER_AREA)
        _HOLES[seen] = cv2.resize(np.float32(~hit), size, interpolation=cv2.INTER_AREA)[..., None]
    return light * _RENDERED[key] + 0.004 * _HOLES[seen]


#: What was rendered: tests see the same few mouths. Without light behind the opening, which `_HOLES` shows.
_RENDERED: dict[tuple, np.ndarray] = {}
_HOLES: dict[tuple, np.ndarray] = {}
_SEEN: dict[tuple, tuple[np.ndarray, ...]] = {}


def _see(
    model: FaceModel, vertices: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What 16 rays a pixel meet: hit (4 h, 4 w); of those that hit, texel (n, 2) and shade (n,) under light 1."""
    over = 4
    size = (camera.width_px, camera.height_px)
    x, y = np.meshgrid(*(np.arange(n * over) + 0.5 for n in size))
    caster = RayCaster(vertices, model.triangles)
    hits = caster.cast(*camera.rays(np.stack([x, y], axis=-1) / over))
    corners = model.triangles[hits.triangle[hits.hit]]
    weights = hits.barycentric[hits.hit]
    normals = normalised(vertex_normals(vertices, model.triangles))
    u, v, facing = (
        (values[corners] * weights).sum(axis=1)
        for values in (model.uv[:, 0], model.uv[:, 1], normals @ LIGHT)
    )
    shade = 0.25 + 0.75 * np.clip(facing, 0, 1)
    return hits.hit, np.stack([u, 1 - v], axis=-1) * TEXTURE_PX, shade


def psnr_db(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> float:
    """Signal to noise of display colours of two linear images (dB)."""
    error = (to_display(a)[where].astype(float) - to_display(b)[where].astype(float)) / 255
    return float(-10 * np.log10((error**2).mean()))
