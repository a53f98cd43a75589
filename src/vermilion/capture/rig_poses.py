"""Poses of a rig over tracks: outliers leave in rounds, patches refine the observations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vermilion.capture.bundle_adjust import bundle_adjust, residuals_px, triangulate_tracks
from vermilion.capture.patches import Greys, align_patches
from vermilion.capture.tracks import Tracks
from vermilion.geometry.camera import Camera


@dataclass(frozen=True)
class RigRefinementSettings:
    """How a rig is refined.

    Attributes:
        fine_gate_deg: as `FeatureMatchSettings.gate_deg`, after the first adjustment.
        max_residual_px: observations with a larger final residual are outliers.
        loss_px: residual at which the robust loss turns from squared to linear.
        patch_radius_px: half the width of the patches that are matched last; 0 for none.
        patch_residual_px, patch_loss_px: as the two above, over patches.
        min_tracks: fewest tracks over which a rig is refined.
        min_camera_tracks: a camera with fewer tracks keeps its given pose.
        held_out: part of the tracks that the adjustment does not use, in (0, 1).
        threshold_px: given cameras with a smaller median error are not changed.
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


def solve_poses(
    cameras: Mapping[str, Camera],
    tracks: Tracks,
    given: Mapping[str, Camera],
    settings: RigRefinementSettings,
    rounds: int = 8,
) -> tuple[dict[str, Camera], Tracks]:
    """Cameras adjusted over the tracks that agree with them, and these tracks.

    Each round drops observations whose residual is over `max_residual_px` and over three times the
    median.

    Args:
        cameras: first guess.
        tracks: of the cameras.
        given: cameras whose centres hold the rig's shape.
        settings: of the refinement.
        rounds: of dropping outliers, then adjusting.
    """
    centres = {name: camera.centre_mm for name, camera in given.items()}
    cameras, points = dict(cameras), triangulate_tracks(cameras, tracks)
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


def solve_patches(
    cameras: Mapping[str, Camera],
    tracks: Tracks,
    given: Mapping[str, Camera],
    greys: Greys,
    settings: RigRefinementSettings,
) -> tuple[dict[str, Camera], Tracks]:
    """As `solve_poses`, over aligned patches; cameras and tracks unchanged where too few agree."""
    aligned = aligned_tracks(cameras, tracks, greys, settings)
    if aligned.count < settings.min_tracks:
        return dict(cameras), tracks
    fine = replace(
        settings, max_residual_px=settings.patch_residual_px, loss_px=settings.patch_loss_px
    )
    return solve_poses(cameras, aligned, given, fine)


def aligned_tracks(
    cameras: Mapping[str, Camera], tracks: Tracks, greys: Greys, settings: RigRefinementSettings
) -> Tracks:
    """The tracks with their observations aligned by patches of the surface."""
    points = triangulate_tracks(cameras, tracks)
    return align_patches(cameras, tracks, points, greys, radius_px=settings.patch_radius_px)


def consistent_tracks(
    cameras: Mapping[str, Camera], tracks: Tracks, settings: RigRefinementSettings
) -> Tracks:
    """The tracks without observations that are clearly wrong matches."""
    distance = residuals_px(cameras, tracks, triangulate_tracks(cameras, tracks))
    return tracks.kept(distance < 3 * settings.max_residual_px)


def connected_cameras(tracks: Tracks, least: int) -> set[str]:
    """The largest set of cameras that tracks connect, each with `least` observations."""
    enough = tracks.per_camera() >= least
    if not enough.any():
        return set()
    shared = coo_matrix(
        (np.ones(len(tracks.track)), (tracks.camera, tracks.track)),
        shape=(len(tracks.cameras), max(tracks.count, 1)),
    ).tocsr()
    ties = (shared @ shared.T).toarray() * enough[:, None] * enough
    component = connected_components(ties > 0, directed=False)[1]
    component[~enough] = -1
    largest = np.bincount(component[enough]).argmax()
    return {n for n, c in zip(tracks.cameras, component, strict=True) if c == largest}
