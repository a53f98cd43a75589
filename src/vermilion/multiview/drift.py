"""Drift against the anchor: the neutral's images carried through the mesh, against the real ones.

Wherever the mesh stays on its material points, the neutral's texture, carried to a frame by the
mesh, is the frame's own. What differs, and how far it would have to move, is the drift.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.multiview.motion import see_all
from vermilion.multiview.pairs import convergence_deg, density
from vermilion.multiview.photometric import (
    Comparison,
    FlowMatcher,
    Motion,
    Sight,
    compare,
    motion_at,
    rasterise,
    sight,
)
from vermilion.multiview.views import DEVIATION, Frame

#: Rows of all cameras of a frame together.
ALL = "all"
REGIONS = ("skin", "vermilion")


@dataclass(frozen=True)
class DriftSettings:
    """See `vermilion.config.multiview` for meanings and units."""

    scale: float
    min_agreement: float
    ray_stride_px: int


@dataclass(frozen=True)
class NeutralImages:
    """The neutral's images, at the size at which frames are compared with them.

    Attributes:
        frame: its images.
        sights: camera name -> what it sees of the neutral.
        triangles: (T, 3).
        regions: name of `REGIONS` -> (V,) bool.
    """

    frame: Frame
    sights: dict[str, Sight]
    triangles: np.ndarray
    regions: dict[str, np.ndarray]

    @classmethod
    def of(cls, frame: Frame, neutral_mm: np.ndarray, model: FaceModel) -> NeutralImages:
        """From the neutral's frame and its mesh neutral_mm (V, 3), world."""
        neutral_mm = np.asarray(neutral_mm, dtype=np.float64)
        named = model.regions
        regions = {
            "skin": ~(named["mouth_inner"] | named["eyes"] | named["teeth"]),
            "vermilion": named["vermilion_upper"] | named["vermilion_lower"],
        }
        return cls(frame, see_all(frame, neutral_mm, model.triangles), model.triangles, regions)


@dataclass(frozen=True)
class Carried:
    """The neutral's image in one camera of a frame.

    Attributes:
        seen: (V,) bool, vertices that the camera sees in both frames.
        comparison: None where it sees nothing of the mesh.
        motion: what is left to move, at the vertices, px of the compared size.
        px_per_mm: (V,) across the line of sight.
    """

    seen: np.ndarray
    comparison: Comparison | None
    motion: Motion
    px_per_mm: np.ndarray

    def difference(self) -> np.ndarray:
        """(h, w) of the window: absolute difference in local deviations, zero without prediction."""
        found = self.comparison
        assert found is not None, "nothing is compared where the camera sees nothing"
        return np.abs(found.predicted.astype(np.float32) - found.real) / DEVIATION


def carry(
    origin: NeutralImages,
    frame: Frame,
    vertices_mm: np.ndarray,
    matcher: FlowMatcher,
    settings: DriftSettings,
    sources: Mapping[str, str] | None = None,
) -> dict[str, Carried]:
    """Compare each camera of a frame, that the neutral has too, with the neutral's image.

    Args:
        vertices_mm: (V, 3) of the frame.
        sources: camera -> camera whose image of the neutral is carried; its own by default.
    """
    vertices_mm = np.asarray(vertices_mm, dtype=np.float64)
    caster = RayCaster(vertices_mm, origin.triangles)
    normals = vertex_normals(vertices_mm, origin.triangles)
    found = {}
    for name, view in frame.views.items():
        source = name if sources is None else sources.get(name)
        if source not in origin.sights:
            continue
        before, now = origin.sights[source], sight(caster, view.camera, vertices_mm, normals)
        raster = rasterise(caster, view.camera, now, settings.ray_stride_px)
        comparison = None
        motion = Motion(np.zeros_like(now.pixels), np.zeros(len(now.pixels)))
        if raster is not None:
            comparison = compare(matcher, raster, view, origin.frame.views[source], before)
            motion = motion_at(comparison, now, before, settings.min_agreement)
        depth = view.camera.to_camera(vertices_mm)[:, 2]
        px_per_mm = view.camera.calibration[0, 0] / np.maximum(depth, 1e-6)
        found[name] = Carried(now.visible & before.visible, comparison, motion, px_per_mm)
    return found


def neighbouring_cameras(frame: Frame, target_mm: np.ndarray) -> dict[str, str]:
    """Camera -> the other camera of a frame that sees target_mm (3,) from the nearest direction.

    Cameras of like resolution go first.
    """
    cameras = {name: view.camera for name, view in frame.views.items()}

    def unlike(a: str, b: str) -> float:
        ratio = density(cameras[a], target_mm) / density(cameras[b], target_mm)
        return convergence_deg(cameras[a], cameras[b], target_mm) * max(ratio, 1 / ratio) ** 4

    return {
        name: min((other for other in cameras if other != name), key=partial(unlike, name))
        for name in cameras
    }


def drift_rows(
    origin: NeutralImages, frame: Frame, carried: Mapping[str, Carried], scale: float
) -> list[dict]:
    """A row of all cameras together, then one a camera: camera, figures, reason.

    Figures, NaN where nothing could be measured:
        measured_percent: share of the vertices seen in both frames whose texture was found again.
        difference_{region}: mean absolute difference of the images in local deviations; 0 for
            the same texture, 1.1 for unrelated ones.
        drift_px_{region}, drift_mm_{region}: median length of the flow that is left, in pixels of
            the full-size images, and in mm across the line of sight.
        drift_p95_mm_{region}: its 95th percentile.

    Args:
        scale: size of the images against the originals.
    """
    parts = {name: _samples(origin, found, scale) for name, found in carried.items()}
    rows = [_row(frame.number, ALL, list(parts.values()))]
    for name in sorted({*parts, *frame.missing, *origin.frame.missing}):
        reason = frame.missing.get(name, "")
        if not reason and name not in parts:
            reason = f"not in the neutral's frame: {origin.frame.missing[name]}"
        rows.append(_row(frame.number, name, [parts[name]] if name in parts else [], reason))
    return rows


def unread_row(number: int, reason: str) -> dict:
    """The row of a frame that cannot be read."""
    return _row(number, ALL, [], reason)


@dataclass(frozen=True)
class _Samples:
    """A camera's (seen, measured) vertices; region -> pixel differences, lengths in px and mm."""

    seen: int
    measured: int
    difference: dict[str, np.ndarray]
    length_px: dict[str, np.ndarray]
    length_mm: dict[str, np.ndarray]


def _samples(origin: NeutralImages, found: Carried, scale: float) -> _Samples:
    measured = found.seen & (found.motion.weight > 0)
    length = np.linalg.norm(found.motion.offset_px, axis=1)
    difference, length_px, length_mm = {}, {}, {}
    for name in REGIONS:
        chosen = measured & origin.regions[name]
        length_px[name] = length[chosen] / scale
        length_mm[name] = length[chosen] / found.px_per_mm[chosen]
        difference[name] = np.zeros(0)
        if found.comparison is not None:
            difference[name] = _difference_in(
                found.comparison, found.difference(), origin.regions[name]
            )
    skin = origin.regions["skin"]
    return _Samples(
        int((found.seen & skin).sum()),
        int((measured & skin).sum()),
        difference,
        length_px,
        length_mm,
    )


def _difference_in(found: Comparison, difference: np.ndarray, region: np.ndarray) -> np.ndarray:
    """Differences (h, w) at the rays (n,) that meet a region and have a prediction."""
    raster = found.raster
    rows, columns = np.nonzero(raster.hits.hit & region[raster.corners].all(axis=2))
    height, width = found.mask.shape
    stride_y, stride_x = height / raster.hits.hit.shape[0], width / raster.hits.hit.shape[1]
    y = ((rows + 0.5) * stride_y).astype(int)
    x = ((columns + 0.5) * stride_x).astype(int)
    predicted = found.mask[y, x]
    return difference[y[predicted], x[predicted]]


def _row(number: int, camera: str, parts: list[_Samples], reason: str = "") -> dict:
    seen = sum(part.seen for part in parts)
    measured = sum(part.measured for part in parts)
    share = 100.0 * measured / seen if seen else np.nan
    row = {"frame": number, "camera": camera, "measured_percent": share}
    for name in REGIONS:
        difference, px, mm = (
            np.concatenate([getattr(part, kind)[name] for part in parts] or [np.zeros(0)])
            for kind in ("difference", "length_px", "length_mm")
        )
        row[f"difference_{name}"] = difference.mean() if len(difference) else np.nan
        row[f"drift_px_{name}"] = np.median(px) if len(px) else np.nan
        row[f"drift_mm_{name}"] = np.median(mm) if len(mm) else np.nan
        row[f"drift_p95_mm_{name}"] = np.percentile(mm, 95) if len(mm) else np.nan
    return {**row, "reason": reason}
