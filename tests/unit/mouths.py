"""A drawn mouth with known contours, for tests of contours and features."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.contours.labels import ContourLabel, Polyline
from vermilion.imaging.images import srgb_to_linear

SKIN, LIP, DARK = (0.72, 0.55, 0.45), (0.66, 0.36, 0.36), (0.12, 0.08, 0.08)


def ellipse(centre, half_width, half_height, n=120) -> np.ndarray:
    """Closed polygon (n, 2) from the right corner (image's left) over the top."""
    angle = np.pi - np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.stack(
        [centre[0] + half_width * np.cos(angle), centre[1] - half_height * np.sin(angle)], axis=1
    )


def draw_mouth(*shape, **options):
    """A mouth of `drawn_mouth`; each is drawn once, and whoever asks has a copy of the arrays."""
    image, landmarks, label = drawn_mouth(*shape, **options)
    return image.copy(), landmarks.copy(), label


@cache
def drawn_mouth(
    opening=10.0,
    height=26.0,
    width=52.0,
    size=(240, 240),
    centre=(120.0, 150.0),
    scale=1.0,
    angle=0.0,
    noise=0.01,
    seed=0,
):
    """(linear image (h, w, 3), landmarks (66, 2), label) of an elliptic mouth.

    All lengths are half-axes in pixels, before the image is scaled and turned about its centre
    (`angle` in radians). The eyes' outer corners are 200 px apart.
    """
    rotation = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = np.array(size[::-1]) / 2
    y, x = np.mgrid[0 : size[0], 0 : size[1]] + 0.5
    local = (np.stack([x, y], axis=-1) - middle) @ np.linalg.inv(rotation).T + np.array([120, 120])

    def inside(a, b):
        d = np.hypot((local[..., 0] - centre[0]) / a, (local[..., 1] - centre[1]) / b) - 1
        return np.clip(0.5 - d * min(a, b) * scale, 0, 1)[..., None]

    inner_width = 0.75 * width
    lips, mouth = inside(width, height), inside(inner_width, max(opening, 0.7))
    image = np.asarray(SKIN) * (1 - lips) + np.asarray(LIP) * lips
    image = image * (1 - mouth) + np.asarray(DARK) * mouth
    image += noise * np.random.default_rng(seed).standard_normal(image.shape)

    def place(points):
        return (np.asarray(points) - [120, 120]) @ rotation.T + middle

    outer, inner = ellipse(centre, width, height), ellipse(centre, inner_width, opening)
    landmarks = np.zeros((66, 2))
    landmarks[36], landmarks[45] = (20, 40), (220, 40)
    landmarks[[58, 48, 49, 50, 51, 52, 62, 53, 54, 55, 56, 57]] = outer[::10]
    landmarks[[59, 60, 61]] = inner[[15, 30, 45]]
    landmarks[[63, 64, 65]] = inner[[75, 90, 105]]
    label = ContourLabel(Polyline(place(inner), True), Polyline(place(outer), True))
    return srgb_to_linear(np.clip(image, 0, 1)), place(landmarks), label


def crest(line_px, size=(240, 240), width_px=1.5, height=0.8) -> np.ndarray:
    """Likelihood map (h, w) with a Gaussian crest on dense points (n, 2) of a contour."""
    reach, (y, x) = 8 * width_px, np.mgrid[: size[0], : size[1]] + 0.5
    near = np.zeros(size, dtype=np.uint8)  # a tree is slow to say that nothing is in reach
    for point in line_px:
        cv2.circle(near, [int(at) for at in point], int(reach) + 2, 1, cv2.FILLED)
    distance, where = np.full(size, np.inf), near > 0
    distance[where], _ = cKDTree(line_px).query(
        np.stack([x, y], axis=-1)[where], distance_upper_bound=reach
    )
    return (height * np.exp(-0.5 * (distance / width_px) ** 2)).astype(np.float32)


def mouth_model(opening=10.0, height=26.0, width=52.0, n=60):
    """A flat face model of the drawn mouth: 1 mm a pixel of `draw_mouth`, origin at its centre.

    Rings of `n` vertices from inside the mouth to the face's border; two expressions: `jawOpen`
    lowers what lies below the mouth's line, `mouthStretch` widens it.
    """
    from vermilion.faces.model import REGIONS, FaceModel

    middle = np.array([120.0, 120.0])
    centre = (120.0, 150.0)
    axes = [
        (0.3 * width, 0.4 * opening),
        (0.75 * width, opening),
        (0.87 * width, 0.6 * height + 0.4 * opening),
        (width, height),
        (1.4 * width, 1.6 * height),
    ]
    rings = [ellipse(centre, a, b, n) - middle for a, b in axes]
    eyes = np.array([(20.0, 40.0), (220.0, 40.0)]) - middle
    flat = np.concatenate([*rings, eyes])
    neutral = np.column_stack([flat[:, 0], -flat[:, 1], np.zeros(len(flat))])
    k = np.arange(n)
    following = (k + 1) % n
    triangles = []
    for r in range(len(rings) - 1):
        a, b, c, d = r * n + k, r * n + following, (r + 1) * n + k, (r + 1) * n + following
        triangles += [np.stack([a, b, c], 1), np.stack([b, d, c], 1)]
    below = np.clip(-30.0 - neutral[:, 1], 0, None)[:, None]
    expressions = np.stack(
        [
            below * [0.0, -0.5, 0.1],
            neutral * [0.2, 0.0, 0.0],
            below * [0.0, 0.0, 0.001],
        ]
    )
    landmarks = np.zeros(66, dtype=np.int32)
    landmarks[36], landmarks[45] = len(flat) - 2, len(flat) - 1
    outer, inner = 3 * n + k, n + k
    landmarks[[58, 48, 49, 50, 51, 52, 62, 53, 54, 55, 56, 57]] = outer[:: n // 12]
    landmarks[[59, 60, 61, 63, 64, 65]] = inner[
        [n // 8, n // 4, 3 * n // 8, 5 * n // 8, 3 * n // 4, 7 * n // 8]
    ]
    regions = {name: np.zeros(len(flat), dtype=bool) for name in REGIONS}
    regions["face"][:] = True
    return FaceModel(
        "mouth",
        neutral,
        np.concatenate(triangles).astype(np.int32),
        ("jawOpen", "mouthStretch", "nearlyNothing"),
        expressions.astype(np.float32),
        np.zeros((0, len(flat), 3), dtype=np.float32),
        np.zeros((len(flat), 2), dtype=np.float32),
        landmarks,
        outer.astype(np.int32),
        inner.astype(np.int32),
        regions,
    )


def facing_camera(scale=1.0, angle=0.0, shift=(0.0, 0.0), size=(240, 240), distance_mm=1000.0):
    """A camera that sees `mouth_model` exactly as `draw_mouth` draws it."""
    from vermilion.geometry.camera import Camera

    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    rotation = turn @ np.diag([1.0, -1.0, -1.0])
    pose = np.column_stack([rotation, [0.0, 0.0, distance_mm]])
    focal = scale * distance_mm
    params = (focal, focal, size[1] / 2 + shift[0], size[0] / 2 + shift[1])
    return Camera("cam", "PINHOLE", params, size[1], size[0], pose)
