"""Points that several cameras see at one moment: features matched near the epipolar lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pycolmap
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vermilion.geometry.camera import Camera
from vermilion.imaging.draw import to_display


@dataclass(frozen=True)
class Features:
    """Salient points of an image.

    Attributes:
        points_px: (N, 2).
        descriptors: (N, 128) float32 of unit length.
        grey: (h, w) uint8, the image; None where it is not known.
    """

    points_px: np.ndarray
    descriptors: np.ndarray
    grey: np.ndarray | None = None


@dataclass(frozen=True)
class Tracks:
    """Observations of points: K observations of `count` points.

    Attributes:
        cameras: names.
        track: (K,) int index of the point, 0 to `count` - 1.
        camera: (K,) int index into `cameras`; a point has at most one observation a camera.
        pixels: (K, 2) places.
        frame: (K,) int frame of the observation.
    """

    cameras: tuple[str, ...]
    track: np.ndarray
    camera: np.ndarray
    pixels: np.ndarray
    frame: np.ndarray

    @property
    def count(self) -> int:
        """Number of points."""
        return len(np.unique(self.track))

    def kept(self, observations: np.ndarray) -> Tracks:
        """The `observations` (K,) bool whose point keeps at least two of them; points renumbered."""
        sizes = np.bincount(self.track, weights=observations, minlength=1)
        keep = observations & (sizes[self.track] >= 2)
        track = np.unique(self.track[keep], return_inverse=True)[1]
        return Tracks(self.cameras, track, self.camera[keep], self.pixels[keep], self.frame[keep])

    def per_camera(self) -> np.ndarray:
        """Number of observations (C,) of each camera."""
        return np.bincount(self.camera, minlength=len(self.cameras))


@dataclass(frozen=True)
class FeatureMatchSettings:
    """How features are found and matched.

    Attributes:
        contrast: smallest contrast of a feature, in [0, 1].
        max_features: of one image.
        gate_deg: largest angle of a match to the epipolar plane of the given poses.
        max_angle_deg: largest angle between the axes of two cameras that are matched.
        ratio: largest ratio of descriptor distances, best over second best within the gate.
        verify_px: largest distance at which a match agrees with its pair's essential matrix.
        min_pair: fewest agreeing matches of a pair of cameras that is used.
        seed: of the random samples and of the held-out tracks.
    """

    contrast: float = 0.002
    max_features: int = 6000
    gate_deg: float = 1.0
    max_angle_deg: float = 40.0
    ratio: float = 0.85
    verify_px: float = 2.0
    min_pair: int = 15
    seed: int = 0


def find_features(linear_rgb: np.ndarray, contrast: float, max_features: int) -> Features:
    """SIFT features of an image `linear_rgb` (h, w, 3).

    `contrast` and `max_features` as in `FeatureMatchSettings`.
    """
    grey = np.rint(to_display(linear_rgb) @ [0.299, 0.587, 0.114]).astype(np.uint8)
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads, options.use_gpu = 1, False
    options.sift.peak_threshold = contrast
    options.sift.max_num_features = max_features
    options.sift.max_num_orientations = 1
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    points, found = extractor.extract(pycolmap.Bitmap.from_array(np.ascontiguousarray(grey)))
    descriptors = np.asarray(found.data, np.float32).reshape(len(points), -1)
    descriptors /= np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-9)
    return Features(np.array([(p.x, p.y) for p in points]).reshape(-1, 2), descriptors, grey)


def match_frame(
    cameras: Mapping[str, Camera],
    features: Mapping[str, Features],
    settings: FeatureMatchSettings,
    frame: int = 0,
) -> Tracks:
    """Tracks of one frame: connected components of the verified matches of all pairs of cameras.

    A component with two features of one camera is left out.
    """
    names = tuple(cameras)
    starts = np.cumsum([0] + [len(features[n].points_px) if n in features else 0 for n in names])
    matches = [np.zeros((0, 2), int)]
    for i, j in combinations(range(len(names)), 2):
        a, b = names[i], names[j]
        if a not in features or b not in features:
            continue
        cosine = cameras[a].rotation[2] @ cameras[b].rotation[2]
        if cosine < np.cos(np.radians(settings.max_angle_deg)):
            continue
        pairs = match_features(cameras[a], cameras[b], features[a], features[b], settings)
        matches.append(pairs + np.array([starts[i], starts[j]]))
    links = np.concatenate(matches)
    n = starts[-1]
    graph = coo_matrix((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n))
    component = connected_components(graph, directed=False)[1]
    camera = np.repeat(np.arange(len(names)), np.diff(starts))
    pixels = np.concatenate(
        [features[m].points_px if m in features else np.zeros((0, 2)) for m in names]
    )
    _, place, count = np.unique(
        component * len(names) + camera, return_inverse=True, return_counts=True
    )
    clash = np.zeros(component.max(initial=0) + 1, bool)
    clash[component[count[place] > 1]] = True
    everything = Tracks(names, component, camera, pixels, np.full(n, frame))
    return everything.kept(~clash[component])


def concatenate_tracks(parts: list[Tracks]) -> Tracks:
    """Tracks of several frames as one; frames do not share points."""
    offsets = np.cumsum([0] + [part.count for part in parts])
    track = [part.track + offset for part, offset in zip(parts, offsets[:-1], strict=True)]
    return Tracks(
        parts[0].cameras,
        np.concatenate(track),
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in ("camera", "pixels", "frame")
        ),
    )


def match_features(
    a: Camera, b: Camera, of_a: Features, of_b: Features, settings: FeatureMatchSettings
) -> np.ndarray:
    """Indices (M, 2) of the matching features of two cameras.

    Matches have the nearest descriptor in both directions, lie near each other's epipolar line and
    agree with one essential matrix. There are none where fewer than `min_pair` do.
    """
    none = np.zeros((0, 2), int)
    if min(len(of_a.points_px), len(of_b.points_px)) < settings.min_pair:
        return none
    alike = of_a.descriptors @ of_b.descriptors.T
    alike[
        epipolar_sine(a, b, of_a.points_px, of_b.points_px) > np.sin(np.radians(settings.gate_deg))
    ] = -1
    best = alike.argmax(axis=1)
    rows = np.arange(len(best))
    first = alike[rows, best]
    mutual = (alike.argmax(axis=0)[best] == rows) & (first > 0)
    alike[rows, best] = -1
    second = alike.max(axis=1)
    clear = 1 - first < settings.ratio**2 * (1 - second)  # distance² = 2 - 2 cosine
    pairs = np.stack([rows, best], axis=1)[mutual & clear]
    if len(pairs) < settings.min_pair:
        return none
    ransac = pycolmap.RANSACOptions()
    ransac.max_error, ransac.random_seed, ransac.num_threads = settings.verify_px, settings.seed, 1
    ransac.min_num_trials, ransac.max_num_trials = 200, 2000
    found = pycolmap.estimate_essential_matrix(
        of_a.points_px[pairs[:, 0]], of_b.points_px[pairs[:, 1]], a.colmap(), b.colmap(), ransac
    )
    if found is None or found["num_inliers"] < settings.min_pair:
        return none
    return pairs[np.asarray(found["inlier_mask"], bool)]


def epipolar_sine(a: Camera, b: Camera, px_a: np.ndarray, px_b: np.ndarray) -> np.ndarray:
    """Sine (Na, Nb) of the angle between rays of `b` and the epipolar planes of rays of `a`.

    Args:
        a, b: the cameras.
        px_a: (Na, 2) pixels of `a`.
        px_b: (Nb, 2) pixels of `b`.
    """
    normals = np.cross(b.centre_mm - a.centre_mm, a.rays(px_a)[1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return np.abs(normals.astype(np.float32) @ b.rays(px_b)[1].T.astype(np.float32))
