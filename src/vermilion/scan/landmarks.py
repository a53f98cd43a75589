"""The landmarks of a scan: found in rendered views, or given by hand."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from vermilion.geometry.alignment import Similarity, similarity_alignment
from vermilion.geometry.mesh import Mesh
from vermilion.landmarks.detector import LandmarkDetector
from vermilion.landmarks.scheme import JAW, N_LANDMARKS
from vermilion.scan.views import ScanViews, camera_towards
from vermilion.storage.errors import InputError
from vermilion.storage.tables import read_table, write_table

INNER = np.arange(len(JAW), N_LANDMARKS)  # the jaw line is a silhouette: another one in each view
LEAST_GIVEN = 6
#: A sure face so near to the model's ends the search: 200 drawn people differ by up to 3, one seen on its side by 33.
_LIKE_A_FACE_MM = 8.0
#: Widths of a first view over the scan's size, with turns to the side: closer only where nothing was found.
_DISTANCES = ((1.1, (0.0,)), (0.75, (-15.0, 0.0, 15.0)), (0.5, (-15.0, 0.0, 15.0)))
_SIZE_PX = 480
_YAWS_DEG, _PITCHES_DEG = (-20.0, -10.0, 0.0, 10.0, 20.0), (-10.0, 0.0, 10.0)


@dataclass(frozen=True)
class ScanLandmarks:
    """Landmarks on a scan.

    Attributes:
        points: (66, 3) in the scan's units and frame, NaN where unknown.
        spread: (66,) how far views differ, same unit; zero where given by hand.
    """

    points: np.ndarray
    spread: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """(66,) bool."""
        return np.isfinite(self.points).all(axis=1)


def find_landmarks(
    scan: Mesh, detector: LandmarkDetector, generic: np.ndarray, subject: str | None = None
) -> ScanLandmarks:
    """Landmarks of a scan of unknown size and orientation.

    A face is looked for from six sides with four ways up each, then from closer and a little from the
    side where none was found; then around the best of them, in fifteen views. A landmark is the median of
    the places on the surface that the views' rays meet.

    Args:
        scan: in any unit and frame.
        detector: works on images.
        generic: (66, 3) mm landmarks of the face model's neutral, which say what is front and up.

    Raises:
        InputError: no face found.
    """
    views = ScanViews(scan)
    for distance in _DISTANCES:
        for points in _first_looks(views, detector, generic, *distance):
            found = _from_near(views, detector, generic, points)
            if found is not None:
                return found
    raise InputError(
        f"no face in {24 * sum(len(turns) for _, turns in _DISTANCES)} views of the scan",
        "a head or face whose surface the landmark detector knows",
        "Look at the scan in a viewer; cut off what hides the face, or give the landmarks by "
        "hand (tracking.scan_landmarks).",
        subject=subject,
    )


def read_scan_landmarks(path: str | Path, subject: str | None = None) -> ScanLandmarks:
    """Landmarks given by hand: a table with the columns landmark (0 to 65), x, y, z.

    Raises InputError where there are fewer than six, or numbers that are no landmarks.
    """
    table = read_table(path, ["landmark", "x", "y", "z"])
    numbers = pd.to_numeric(table["landmark"], errors="coerce").to_numpy()
    wrong = sorted(set(numbers.tolist()) - set(range(N_LANDMARKS)))
    if wrong or len(set(numbers)) < LEAST_GIVEN:
        raise InputError(
            f"landmarks {wrong}" if wrong else f"{len(set(numbers))} landmarks",
            f"at least {LEAST_GIVEN} of the numbers 0 to {N_LANDMARKS - 1}",
            "See docs/scan.md for what the numbers mean.",
            subject=subject,
            path=path,
        )
    places = table[["x", "y", "z"]].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    if len(set(numbers)) < len(numbers) or not np.isfinite(places).all():
        raise InputError(
            "a landmark twice, or a coordinate that is no number",
            "one row a landmark with x, y and z in the scan's units",
            "Correct the table.",
            subject=subject,
            path=path,
        )
    points = np.full((N_LANDMARKS, 3), np.nan)
    points[numbers.astype(int)] = places
    return ScanLandmarks(points, np.zeros(N_LANDMARKS))


def write_scan_landmarks(path: str | Path, landmarks: ScanLandmarks) -> None:
    """Write what `read_scan_landmarks` reads, so that found landmarks can be corrected by hand."""
    numbers = np.flatnonzero(landmarks.known)
    x, y, z = landmarks.points[numbers].T
    write_table(path, pd.DataFrame({"landmark": numbers, "x": x, "y": y, "z": z}))


def _first_looks(
    views: ScanViews,
    detector: LandmarkDetector,
    generic: np.ndarray,
    width: float,
    turns_deg: Sequence[float],
) -> list[np.ndarray]:
    """Points (66, 3) of the views with a face, the one most like the model's face first.

    A detector may be surer of a face that lies on its side than of the upright one, and its points then
    have another shape; so what counts is how far they lie from `generic` (66, 3) mm after alignment.
    """
    low, high = views.mesh.vertices_mm.min(axis=0), views.mesh.vertices_mm.max(axis=0)
    middle, size = (low + high) / 2, width * float((high - low).max())
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    # z to the front and y up first: most scans stand so, and a sure face ends the search.
    pairs = sorted(
        ((f, u) for f, u in itertools.permutations(range(6), 2) if f % 3 != u % 3),
        key=lambda pair: pair != (2, 1),
    )
    seen = []
    for (front, up), turn_deg in itertools.product(pairs, turns_deg):
        turn = Rotation.from_rotvec(np.radians(turn_deg) * axes[up])
        camera = camera_towards(middle, size, turn.apply(axes[front]), axes[up], _SIZE_PX)
        found, points = views.landmarks(camera, detector)
        if not found.found or _known(points).mean() < 0.8:
            continue
        away = _away_mm(points, generic)
        seen.append((away, points))
        if away < _LIKE_A_FACE_MM and found.confidence.mean() > 0.75:
            break
    return [points for _, points in sorted(seen, key=lambda entry: entry[0])]


def _from_near(
    views: ScanViews, detector: LandmarkDetector, generic: np.ndarray, points: np.ndarray
) -> ScanLandmarks | None:
    """Landmarks from views round a face whose points (66, 3) were seen from afar; None: it is no face."""
    spread = np.zeros(len(points))
    for _ in range(2):  # the second time the views are where they should be
        points, spread = _all_views(views, detector, points, _aligned(points, generic))
        if _known(points).sum() < LEAST_GIVEN:
            return None
    return ScanLandmarks(points, spread)


def _known(points: np.ndarray) -> np.ndarray:
    """Which inner landmarks of points (66, 3) are known, bool."""
    return np.isfinite(points[INNER]).all(axis=1)


def _aligned(points: np.ndarray, generic: np.ndarray) -> Similarity:
    """What takes the known inner landmarks of points (66, 3) to the model's (66, 3) mm."""
    known = INNER[_known(points)]
    return similarity_alignment(points[known], generic[known])


def _away_mm(points: np.ndarray, generic: np.ndarray) -> float:
    """Root mean square distance of the aligned inner landmarks from the model's, mm."""
    known = INNER[_known(points)]
    away = _aligned(points, generic).apply(points[known]) - generic[known]
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def _all_views(
    views: ScanViews,
    detector: LandmarkDetector,
    points: np.ndarray,
    head_from_scan: Similarity,
) -> tuple[np.ndarray, np.ndarray]:
    """Median (66, 3) and spread (66,) over views round the face."""
    middle, seen = np.nanmedian(points, axis=0), []
    scale, rotation = head_from_scan.scale, head_from_scan.rotation
    for yaw, pitch in itertools.product(np.radians(_YAWS_DEG), np.radians(_PITCHES_DEG)):
        front = [np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)]
        camera = camera_towards(
            middle, 260.0 / scale, np.array(front) @ rotation, rotation[1], _SIZE_PX
        )
        seen.append(views.landmarks(camera, detector)[1])
    return _median(seen)


def _median(seen: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    stack = np.stack(seen)
    known = np.isfinite(stack).all(axis=-1)
    enough = known.sum(axis=0) >= max(len(seen) // 3, 1)
    stack = np.where((known & enough)[..., None], stack, np.nan)
    with np.errstate(all="ignore"):
        middle = np.full(stack.shape[1:], np.nan)
        middle[enough] = np.nanmedian(stack[:, enough], axis=0)
        apart = np.linalg.norm(stack - middle, axis=-1)
        spread = np.zeros(len(middle))
        spread[enough] = 1.48 * np.nanmedian(apart[:, enough], axis=0)
    return middle, spread
