"""RigRefinement of a rig whose calibration is off, from the images of the take themselves.

Features are matched near the epipolar lines of the given poses, the poses adjusted over their
tracks, and the matching repeated with the better poses. Patches of the surface round the points,
matched by least squares, bring the observations and with them the poses to a small part of a pixel.
Part of the tracks is held out: what is said of the result is measured on these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vermilion.capture.bundle_adjust import (
    align_to_given,
    bundle_adjust,
    residuals_px,
    triangulate_tracks,
)
from vermilion.capture.patches import Greys, align_patches
from vermilion.capture.tracks import (
    FeatureMatchSettings,
    Features,
    Tracks,
    concatenate_tracks,
    match_frame,
)
from vermilion.geometry.camera import Camera

MultiviewImages = Mapping[int, Mapping[str, Features]]  # frame -> camera -> its features


@dataclass(frozen=True)
class RigRefinementSettings:
    """How a rig is refined.

    Attributes:
        fine_gate_deg: as `FeatureMatchSettings.gate_deg`, once the poses are better.
        max_residual_px: observations that lie farther from their point at the end are outliers.
        loss_px: residual at which the robust loss turns from squared to linear.
        patch_radius_px: half the width of the patches that are matched last; 0 for none.
        patch_residual_px, patch_loss_px: as the two above, over patches.
        min_tracks: tracks without which nothing is refined.
        min_camera_tracks: a camera with fewer keeps its given pose.
        held_out: part of the tracks that the adjustment never sees, in (0, 1).
        threshold_px: given cameras whose median error is below are left alone.
        improvement: largest ratio of the held-out median errors, refined over given, at which the
            refined cameras are taken.
        turn_deg, shift_mm: expected error of a given pose (see `align_to_given`).
        refine_focal: adjust focal lengths too.
    """

    fine_gate_deg: float = 0.1
    max_residual_px: float = 1.0
    loss_px: float = 0.3
    patch_radius_px: int = 8
    patch_residual_px: float = 0.3
    patch_loss_px: float = 0.1
    min_tracks: int = 100
    min_camera_tracks: int = 30
    held_out: float = 0.2
    threshold_px: float = 1.0
    improvement: float = 0.7
    turn_deg: float = 0.3
    shift_mm: float = 1.0
    refine_focal: bool = False


@dataclass(frozen=True)
class RigRefinement:
    """What became of a rig.

    Attributes:
        cameras: refined, or as given.
        applied: whether they are refined.
        reason: why, or why not.
        tracks: number of tracks adjusted and held out.
        before_px, after_px: {median, rms} over the held-out tracks, each triangulated with those
            cameras; the rms is of observations within 20 px, as no match is sure. Where the rig
            was refined over patches, both are over the held-out tracks' patches.
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
    images: MultiviewImages,
    matching: FeatureMatchSettings,
    settings: RigRefinementSettings,
    only_if_off: bool = True,
) -> RigRefinement:
    """Adjust the poses of a rig to what its images show.

    The world stays: the refined rig is turned, shifted and scaled onto the given poses.

    Args:
        given: the rig; any COLMAP models.
        only_if_off: leave the rig alone where its median error is under `threshold_px`.

    The given cameras come back, with the reason, where there are too few tracks, where they are
    good already, or where the refined ones do not lower the error on held-out tracks clearly.
    """
    given = dict(given)
    found = _match(given, images, matching)
    if found.count < settings.min_tracks:
        reason = f"{found.count} tracks; at least {settings.min_tracks} are needed"
        return RigRefinement(given, False, reason, {"found": found.count})
    held, fitted = _split(found, settings.held_out, matching.seed)
    expected, before = _measured(given, held, settings)
    tracks = {"found": found.count, "held_out": held.count}
    if only_if_off and before["median"] < settings.threshold_px:
        reason = (
            f"the given cameras are good: median error {before['median']:.2f} px, threshold "
            f"{settings.threshold_px:g} px"
        )
        shown = _shown(held, expected, None)
        return RigRefinement(given, False, reason, tracks, before, None, shown=shown)
    rough, _ = _solve(given, fitted, given, settings)
    near = replace(matching, gate_deg=settings.fine_gate_deg)
    again = _match(rough, _without(images, held), near)
    cameras, used = _solve(rough, again, given, settings) if again.count else (rough, fitted)
    greys = _greys(images) if settings.patch_radius_px else None
    if greys is not None:
        cameras, used = _solve_patches(cameras, used, given, greys, settings)
    enough = sorted(_linked(used, settings.min_camera_tracks))
    tracks["adjusted"] = used.count
    if used.count < settings.min_tracks or len(enough) < 2:
        reason = f"{used.count} consistent tracks; at least {settings.min_tracks} are needed"
        return RigRefinement(given, False, reason, tracks, before)
    laid = align_to_given(
        {n: given[n] for n in enough},
        {n: cameras[n] for n in enough},
        settings.turn_deg,
        settings.shift_mm,
    )
    cameras = given | laid
    if greys is not None:
        # laid on by the refined poses, as patches start within pixels; then held against both rigs
        held = _aligned(cameras, _consistent(cameras, held, settings), greys, settings)
        expected, before = _measured(given, held, settings)
    refined, after = _measured(cameras, held, settings)
    shown = _shown(held, expected, refined)
    seen = dict(zip(used.cameras, used.per_camera(), strict=True))
    moved = {n: _movement(given[n], cameras[n]) | {"observations": int(seen[n])} for n in given}
    change = f"held-out median {before['median']:.2f} px with the given cameras, "
    change += f"{after['median']:.2f} px refined"
    if after["median"] > settings.improvement * before["median"]:
        reason = f"no clear gain: {change}"
        return RigRefinement(given, False, reason, tracks, before, after, shown=shown)
    left = sorted(set(given) - set(enough))
    if left:
        change += f"; too few tracks in {', '.join(left)}, kept as given"
    return RigRefinement(cameras, True, change, tracks, before, after, moved, shown)


def _match(
    cameras: dict[str, Camera], images: MultiviewImages, matching: FeatureMatchSettings
) -> Tracks:
    frames = sorted(images)
    return concatenate_tracks([match_frame(cameras, images[f], matching, f) for f in frames])


def _split(tracks: Tracks, part: float, seed: int) -> tuple[Tracks, Tracks]:
    held = np.random.default_rng(seed).random(tracks.count) < part
    return tracks.kept(held[tracks.track]), tracks.kept(~held[tracks.track])


def _without(images: MultiviewImages, tracks: Tracks) -> MultiviewImages:
    """The features that are in none of these tracks."""
    rest = {}
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


def _solve(
    cameras: dict[str, Camera],
    tracks: Tracks,
    given: dict[str, Camera],
    settings: RigRefinementSettings,
    rounds: int = 8,
) -> tuple[dict[str, Camera], Tracks]:
    """Poses over the tracks that agree: outliers leave in rounds, at thrice the median."""
    centres = {name: camera.centre_mm for name, camera in given.items()}
    points = triangulate_tracks(cameras, tracks)
    for _ in range(rounds):
        distance = residuals_px(cameras, tracks, points)
        limit = max(settings.max_residual_px, 3 * float(np.median(distance)))
        tracks = tracks.kept(distance < limit)
        if tracks.count < 10:
            break
        cameras, points = bundle_adjust(
            cameras,
            tracks,
            triangulate_tracks(cameras, tracks),
            free_poses=True,
            free_focal=settings.refine_focal,
            loss_px=settings.loss_px,
            centres_mm=centres,
            shift_mm=settings.shift_mm,
        )
    return cameras, tracks


def _greys(images: MultiviewImages) -> Greys | None:
    """The images of all features; None where one is not known."""
    greys = {
        frame: {name: features.grey for name, features in views.items()}
        for frame, views in images.items()
    }
    known = all(grey is not None for views in greys.values() for grey in views.values())
    return greys if known else None


def _solve_patches(
    cameras: dict[str, Camera],
    tracks: Tracks,
    given: dict[str, Camera],
    greys: Greys,
    settings: RigRefinementSettings,
) -> tuple[dict[str, Camera], Tracks]:
    """Poses over the patches of tracks; the poses and tracks as they were where few agree."""
    aligned = _aligned(cameras, tracks, greys, settings)
    if aligned.count < settings.min_tracks:
        return cameras, tracks
    fine = replace(
        settings, max_residual_px=settings.patch_residual_px, loss_px=settings.patch_loss_px
    )
    return _solve(cameras, aligned, given, fine)


def _aligned(cameras, tracks: Tracks, greys: Greys, settings: RigRefinementSettings) -> Tracks:
    points = triangulate_tracks(cameras, tracks)
    return align_patches(cameras, tracks, points, greys, radius_px=settings.patch_radius_px)


def _consistent(cameras, tracks: Tracks, settings: RigRefinementSettings) -> Tracks:
    """Tracks without the observations that are no match by any measure."""
    distance = residuals_px(cameras, tracks, triangulate_tracks(cameras, tracks))
    return tracks.kept(distance < 3 * settings.max_residual_px)


def _linked(tracks: Tracks, least: int) -> set[str]:
    """The largest set of cameras that tracks tie together, each with `least` observations."""
    enough = tracks.per_camera() >= least
    shared = coo_matrix(
        (np.ones(len(tracks.track)), (tracks.camera, tracks.track)),
        shape=(len(tracks.cameras), max(tracks.count, 1)),
    ).tocsr()
    ties = (shared @ shared.T).toarray() * enough[:, None] * enough
    component = connected_components(ties > 0, directed=False)[1]
    component[~enough] = -1
    if not enough.any():
        return set()
    largest = np.bincount(component[enough]).argmax()
    return {n for n, c in zip(tracks.cameras, component, strict=True) if c == largest}


def _measured(
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
