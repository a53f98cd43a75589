"""Refinement of a rig whose calibration is off, from the images of the take.

1. Match features near the epipolar lines of the given poses; adjust the poses over their tracks.
2. Match again with the better poses and a finer gate; adjust again.
3. Align patches of the surface around the points by least squares; adjust over these observations.

Part of the tracks is held out: the reported errors are measured on them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vermilion.capture.bundle_adjust import (
    align_to_given,
    bundle_adjust,
    residuals_px,
    triangulate_tracks,
)
from vermilion.capture.patches import Greys
from vermilion.capture.rig_poses import (
    RigRefinementSettings,
    aligned_tracks,
    connected_cameras,
    consistent_tracks,
    solve_patches,
    solve_poses,
)
from vermilion.capture.tracks import (
    FeatureMatchSettings,
    Features,
    Tracks,
    concatenate_tracks,
    match_frame,
)
from vermilion.geometry.camera import Camera

FrameFeatures = Mapping[int, Mapping[str, Features]]  # frame -> camera -> its features


@dataclass(frozen=True)
class RigRefinement:
    """The result of a refinement.

    Attributes:
        cameras: refined, or as given.
        applied: whether they are refined.
        reason: why, or why not.
        tracks: numbers of tracks found, held out and adjusted.
        before_px, after_px: {median, rms} error over the held-out tracks, triangulated with the given
            and the refined cameras. The rms leaves out observations over 20 px, which are wrong
            matches. A rig refined over patches is measured over the patches of the held-out tracks.
        moved: camera -> {turned_deg, moved_mm, observations}.
        shown: camera -> (seen (n, 2), given (n, 2), refined (n, 2)) pixels of the held-out tracks
            of the first frame, for overlays.
    """

    cameras: dict[str, Camera]
    applied: bool
    reason: str
    tracks: dict[str, int] = field(default_factory=dict)
    before_px: dict[str, float] | None = None
    after_px: dict[str, float] | None = None
    moved: dict[str, dict] = field(default_factory=dict)
    shown: dict[str, tuple] = field(default_factory=dict)

    def summary(self) -> dict:
        """What `capture/cameras.json` holds of it."""
        return {
            "applied": self.applied,
            "reason": self.reason,
            "tracks": self.tracks,
            "held_out_before_px": self.before_px,
            "held_out_after_px": self.after_px,
            "cameras": self.moved,
        }


def refine_cameras(
    given: Mapping[str, Camera],
    images: FrameFeatures,
    matching: FeatureMatchSettings,
    settings: RigRefinementSettings,
    only_if_off: bool = True,
) -> RigRefinement:
    """Adjust the poses of a rig to the images of a take.

    The world does not change: the refined rig is rotated, shifted and scaled onto the given poses.
    The given cameras are returned, with the reason, where there are too few tracks, where the given
    cameras are accurate, or where the refined cameras do not clearly reduce the held-out error.

    Args:
        given: the rig; any COLMAP models.
        images: features of some frames.
        matching: how features are matched.
        settings: how poses are refined.
        only_if_off: do not change a rig whose median error is under `threshold_px`.
    """
    given = dict(given)
    found = _match(given, images, matching)
    if found.count < settings.min_tracks:
        reason = f"{found.count} tracks; at least {settings.min_tracks} are needed"
        return RigRefinement(given, False, reason, {"found": found.count})
    held, fitted = _split(found, settings.held_out, matching.seed)
    expected, before = _held_out_error(given, held, settings)
    counts = {"found": found.count, "held_out": held.count}
    if only_if_off and before["median"] < settings.threshold_px:
        reason = (
            f"the given cameras are good: median error {before['median']:.2f} px, threshold "
            f"{settings.threshold_px:g} px"
        )
        shown = _shown(held, expected, None)
        return RigRefinement(given, False, reason, counts, before, None, shown=shown)
    greys = _greys(images) if settings.patch_radius_px else None
    cameras, used = _adjusted(given, fitted, _without(images, held), greys, matching, settings)
    connected = sorted(connected_cameras(used, settings.min_camera_tracks))
    counts["adjusted"] = used.count
    if used.count < settings.min_tracks or len(connected) < 2:
        reason = f"{used.count} consistent tracks; at least {settings.min_tracks} are needed"
        return RigRefinement(given, False, reason, counts, before)
    aligned = align_to_given(
        {n: given[n] for n in connected},
        {n: cameras[n] for n in connected},
        settings.turn_deg,
        settings.shift_mm,
    )
    cameras = given | aligned
    if greys is not None:
        # Patches must start within a few pixels: align them by the refined poses, then compare.
        held = aligned_tracks(cameras, consistent_tracks(cameras, held, settings), greys, settings)
    return _compared(given, cameras, used, held, counts, settings)


def _adjusted(
    given: dict[str, Camera],
    fitted: Tracks,
    images: FrameFeatures,
    greys: Greys | None,
    matching: FeatureMatchSettings,
    settings: RigRefinementSettings,
) -> tuple[dict[str, Camera], Tracks]:
    """Cameras after the three steps above, and the tracks that they were adjusted over."""
    rough, _ = solve_poses(given, fitted, given, settings)
    again = _match(rough, images, replace(matching, gate_deg=settings.fine_gate_deg))
    cameras, used = solve_poses(rough, again, given, settings) if again.count else (rough, fitted)
    if greys is not None:
        cameras, used = solve_patches(cameras, used, given, greys, settings)
    return cameras, used


def _compared(
    given: dict[str, Camera],
    cameras: dict[str, Camera],
    used: Tracks,
    held: Tracks,
    counts: dict[str, int],
    settings: RigRefinementSettings,
) -> RigRefinement:
    """The refined cameras, or the given ones where the held-out error is not clearly smaller."""
    expected, before = _held_out_error(given, held, settings)
    refined, after = _held_out_error(cameras, held, settings)
    shown = _shown(held, expected, refined)
    seen = dict(zip(used.cameras, used.per_camera(), strict=True))
    moved = {n: _movement(given[n], cameras[n]) | {"observations": int(seen[n])} for n in given}
    change = f"held-out median {before['median']:.2f} px with the given cameras, "
    change += f"{after['median']:.2f} px refined"
    if after["median"] > settings.improvement * before["median"]:
        reason = f"no clear gain: {change}"
        return RigRefinement(given, False, reason, counts, before, after, shown=shown)
    unchanged = sorted(name for name in given if cameras[name] is given[name])
    if unchanged:
        change += f"; too few tracks in {', '.join(unchanged)}, kept as given"
    return RigRefinement(cameras, True, change, counts, before, after, moved, shown)


def _match(
    cameras: dict[str, Camera], images: FrameFeatures, matching: FeatureMatchSettings
) -> Tracks:
    frames = sorted(images)
    return concatenate_tracks([match_frame(cameras, images[f], matching, f) for f in frames])


def _split(tracks: Tracks, part: float, seed: int) -> tuple[Tracks, Tracks]:
    held = np.random.default_rng(seed).random(tracks.count) < part
    return tracks.kept(held[tracks.track]), tracks.kept(~held[tracks.track])


def _without(images: FrameFeatures, tracks: Tracks) -> FrameFeatures:
    """The features that are in none of these tracks."""
    rest: dict[int, dict[str, Features]] = {}
    for frame, views in images.items():
        rest[frame] = {}
        for i, name in enumerate(tracks.cameras):
            if name not in views:
                continue
            mine = (tracks.frame == frame) & (tracks.camera == i)
            taken = {tuple(xy) for xy in tracks.pixels[mine]}
            free = np.array([tuple(xy) not in taken for xy in views[name].points_px], bool)
            old = views[name]
            rest[frame][name] = Features(old.points_px[free], old.descriptors[free], old.grey)
    return rest


def _greys(images: FrameFeatures) -> Greys | None:
    """The images of all features; None where one is missing."""
    greys: dict[int, dict[str, np.ndarray]] = {}
    for frame, views in images.items():
        greys[frame] = {}
        for name, features in views.items():
            if features.grey is None:
                return None
            greys[frame][name] = features.grey
    return greys


def _held_out_error(
    cameras: dict[str, Camera], tracks: Tracks, settings: RigRefinementSettings
) -> tuple[np.ndarray, dict[str, float]]:
    """Expected pixels (K, 2) of tracks triangulated with these cameras; their error."""
    points = triangulate_tracks(cameras, tracks)
    _, points = bundle_adjust(cameras, tracks, points, free_poses=False, loss_px=settings.loss_px)
    expected = np.zeros((len(tracks.track), 2))
    for i, name in enumerate(tracks.cameras):
        mine = tracks.camera == i
        expected[mine] = cameras[name].project(points[tracks.track[mine]])
    distance = residuals_px(cameras, tracks, points)
    near = distance[distance < 20.0]
    rms = float(np.sqrt((near**2).mean())) if len(near) else float("inf")
    return expected, {"median": float(np.median(distance)), "rms": rms}


def _shown(tracks: Tracks, given: np.ndarray, refined: np.ndarray | None) -> dict[str, tuple]:
    shown = {}
    for i, name in enumerate(tracks.cameras):
        mine = (tracks.camera == i) & (tracks.frame == tracks.frame.min(initial=0))
        after = None if refined is None else refined[mine]
        shown[name] = (tracks.pixels[mine], given[mine], after)
    return shown


def _movement(given: Camera, refined: Camera) -> dict[str, float]:
    cosine = (np.trace(refined.rotation @ given.rotation.T) - 1) / 2
    return {
        "turned_deg": float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))),
        "moved_mm": float(np.linalg.norm(refined.centre_mm - given.centre_mm)),
    }
