"""Landmarks by supervised descent (Xiong and De la Torre 2013): linear steps in a row.

The image is brought to the mean shape's place, size and turn; gradient histograms round the
current points predict how each should move. Started from the likeliest faces, the surest wins.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vermilion.landmarks.detector import MAX_FACES, Landmarks, apart, most_prominent
from vermilion.landmarks.gradients import grey_of, orientation_channels, patch_features
from vermilion.landmarks.locate import FaceLocator
from vermilion.landmarks.scheme import face_size_px
from vermilion.landmarks.sets import IBUG66
from vermilion.storage.arrays import read_arrays, write_arrays
from vermilion.storage.errors import ModelFileError

FORMAT_VERSION = 1
CELLS = 4
#: Pixels between the cells of a patch, and blur, in the upright image.
SPACING_PX, BLUR_PX = 4.0, 1.8


def stage_sizes(n_stages: int) -> tuple[int, ...]:
    """Face size in pixels of the upright image at each stage: coarse to fine."""
    return tuple(int(s) for s in np.rint(np.geomspace(56, 112, n_stages)))


@dataclass(frozen=True)
class ImageSimilarity:
    """Image pixels = scale * turn @ upright + shift, turn by (cos, sin) in `matrix` (2, 2)."""

    matrix: np.ndarray
    shift: np.ndarray

    @classmethod
    def between(cls, source: np.ndarray, target: np.ndarray) -> ImageSimilarity:
        """Least squares, of `source` (N, 2) to `target` (N, 2)."""
        a, b = source - source.mean(axis=0), target - target.mean(axis=0)
        za, zb = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
        z = (np.conj(za) @ zb) / max(np.real(np.conj(za) @ za), 1e-12)
        matrix = np.array([[z.real, -z.imag], [z.imag, z.real]])
        return cls(matrix, target.mean(axis=0) - matrix @ source.mean(axis=0))

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return points @ self.matrix.T + self.shift


def upright_channels(grey: np.ndarray, to_image: ImageSimilarity, size_px: int) -> np.ndarray:
    """Blurred orientation channels (s, s, 8) of `grey` (h, w), resampled into the mean shape's frame.

    The mean shape has size 1 about the origin; `size_px` pixels are 1, the origin in the middle.
    """
    side = round(1.9 * size_px)
    scale = np.sqrt(abs(np.linalg.det(to_image.matrix))) / size_px
    image, shrink = grey, 1.0
    while scale * shrink > 2.0 and min(image.shape) > 32:
        image, shrink = cv2.pyrDown(image), shrink * 0.5
    matrix = to_image.matrix / size_px
    corner = to_image.shift - matrix @ np.array([side / 2, side / 2])
    # Pixel centres: OpenCV's are whole numbers, ours lie half a pixel further.
    affine = np.concatenate([matrix, (corner + matrix @ [0.5, 0.5])[:, None]], axis=1) * shrink
    affine[:, 2] -= 0.5
    upright = cv2.warpAffine(
        image,
        affine,
        (side, side),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return cv2.GaussianBlur(orientation_channels(upright), (0, 0), BLUR_PX)


def shape_features(grey: np.ndarray, shape: np.ndarray, mean: np.ndarray, size_px: int):
    """Features (66, 128) of `grey` (h, w) round `shape` (66, 2) px, and the similarity that brings
    `mean` (66, 2) to it."""
    to_image = ImageSimilarity.between(mean, shape)
    channels = upright_channels(grey, to_image, size_px)
    local = (shape - to_image.shift) @ np.linalg.inv(to_image.matrix).T
    pixels = local * size_px + channels.shape[0] / 2 - 0.5
    return patch_features(channels, pixels, CELLS, SPACING_PX), to_image


@dataclass(frozen=True)
class DescentDetector:
    """The trained regressor.

    Attributes:
        mean: (66, 2) mean shape, size 1 about the origin of its bounding box.
        steps: (S, 66 * 128 + 1, 132) float32: each stage's regression, the offset last.
        sureness: (66, 129) how near a point is, from its patch; the offset last.
        locator: finds where to start.
        found_threshold: least mean confidence.
    """

    landmark_set = IBUG66

    mean: np.ndarray
    steps: np.ndarray
    sureness: np.ndarray
    locator: FaceLocator
    found_threshold: float

    def detect(self, linear_rgb: np.ndarray) -> Landmarks:
        """Landmarks of the surest face in `linear_rgb` (h, w, 3)."""
        return most_prominent(self.faces(linear_rgb), self.landmark_set)

    def faces(self, linear_rgb: np.ndarray) -> list[Landmarks]:
        """Faces in `linear_rgb` (h, w, 3), the surest first; the others only where they are sure."""
        grey = grey_of(linear_rgb)
        sure = 0.5 * (1 + self.found_threshold)
        found: list[Landmarks] = []
        for centre, size, _ in self.locator.locate(grey, MAX_FACES):
            if any(_covers(face, centre) for face in found if face.confidence.mean() > sure):
                continue
            found.append(self.refine(grey, self.mean * size + centre))
        found = sorted((f for f in found if f.found), key=lambda face: -face.confidence.mean())
        good = [f for f in found[:1] if f.confidence.mean() >= self.found_threshold]
        good += [f for f in found[1:] if f.confidence.mean() > sure]
        return apart(good, MAX_FACES)

    def refine(self, grey: np.ndarray, shape: np.ndarray) -> Landmarks:
        """All stages on `grey` (h, w) from a starting `shape` (66, 2) px, and how sure each point is."""
        sizes = stage_sizes(len(self.steps))
        for size_px, step in zip(sizes, self.steps, strict=True):
            features, to_image = shape_features(grey, shape, self.mean, size_px)
            move = features.reshape(-1) @ step[:-1] + step[-1]
            shape = shape + move.reshape(-1, 2) @ to_image.matrix.T
            if not np.isfinite(shape).all() or face_size_px(shape) < 8:
                return Landmarks.none()
        features, _ = shape_features(grey, shape, self.mean, sizes[-1])
        sure = (features * self.sureness[:, :-1]).sum(axis=1) + self.sureness[:, -1]
        return Landmarks(shape, np.clip(sure, 0.0, 1.0).astype(np.float64), True)

    def save(self, path: str | Path) -> None:
        """Write `.npz` (no pickle), whole or not at all."""
        write_arrays(
            path,
            format_version=FORMAT_VERSION,
            mean=self.mean,
            steps=self.steps.astype(np.float16),
            sureness=self.sureness.astype(np.float32),
            locator_weights=self.locator.weights,
            locator_bias=self.locator.bias,
            found_threshold=self.found_threshold,
        )

    @classmethod
    def load(cls, path: str | Path) -> DescentDetector:
        """Read what `save` wrote. Raises ModelFileError on another or damaged file."""
        arrays = read_arrays(path, "landmark model", error=ModelFileError, version=FORMAT_VERSION)
        return cls(
            arrays["mean"],
            arrays["steps"].astype(np.float32),
            arrays["sureness"],
            FaceLocator(arrays["locator_weights"], float(arrays["locator_bias"])),
            float(arrays["found_threshold"]),
        )


def _covers(face: Landmarks, point: np.ndarray) -> bool:
    """Whether a point (2,) px lies in the box of a face's landmarks."""
    low, high = face.points_px.min(axis=0), face.points_px.max(axis=0)
    return bool(((low <= point) & (point <= high)).all())
