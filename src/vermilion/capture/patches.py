"""Subpixel observations of a track: least-squares matching of surface patches (Gruen 1985).

A feature detector finds a point in each image independently, with an error of about a quarter of a
pixel. Here the patch around a point in one image is put on the tangent plane of the surface, projected
into each other image of the track, and shifted there until the images agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np
from scipy.spatial import cKDTree

from vermilion.capture.tracks import Tracks
from vermilion.geometry.camera import Camera

Greys = Mapping[int, Mapping[str, np.ndarray]]  # frame -> camera -> (h, w) float32
#: Nearest points that determine a tangent plane, and Gauss-Newton steps of an alignment.
_NEIGHBOURS, _ROUNDS = 12, 10
#: Observations whose patch moves farther, or whose patches correlate less, are dropped.
_MAX_SHIFT_PX, _MIN_CORRELATION = 2.0, 0.8


def align_patches(
    cameras: Mapping[str, Camera],
    tracks: Tracks,
    points_mm: np.ndarray,
    greys: Greys,
    *,
    radius_px: int = 8,
) -> Tracks:
    """The tracks with every observation aligned to that of the most frontal camera.

    Args:
        cameras: accurate to a few pixels.
        tracks: observations.
        points_mm: (P, 3) of the tracks, world.
        greys: the images.
        radius_px: half the width of a patch.
    """
    normals = _normals(tracks, points_mm)
    towards = np.stack([cameras[n].centre_mm for n in tracks.cameras])[tracks.camera]
    towards = towards - points_mm[tracks.track]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    frontal = np.abs((towards * normals[tracks.track]).sum(axis=1))
    order = np.lexsort((-frontal, tracks.track))
    first = np.unique(tracks.track[order], return_index=True)[1]
    base = order[first]  # observation that each track is aligned to
    pixels, good = tracks.pixels.copy(), np.zeros(len(tracks.pixels), dtype=bool)
    good[base] = True
    others = np.setdiff1d(np.arange(len(pixels)), base)
    cells = np.stack(
        [tracks.frame[others], tracks.camera[base[tracks.track[others]]], tracks.camera[others]]
    )
    for frame, source, target in np.unique(cells, axis=1).T:
        rows = others[(cells == np.array([[frame], [source], [target]])).all(axis=0)]
        a, b = (tracks.cameras[k] for k in (source, target))
        at = base[tracks.track[rows]]
        where, patch = _projected_patches(
            cameras[a], cameras[b], greys[frame][a], tracks.pixels[at],
            points_mm[tracks.track[rows]], normals[tracks.track[rows]], radius_px,
        )  # fmt: skip
        shift, correlation = _shifts(greys[frame][b], where, patch)
        middle = where.shape[1] // 2
        pixels[rows] = where[:, middle] + shift
        near = np.linalg.norm(shift, axis=1) < _MAX_SHIFT_PX
        good[rows] = (correlation >= _MIN_CORRELATION) & near
    return replace(tracks, pixels=pixels).kept(good)


def _normals(tracks: Tracks, points_mm: np.ndarray) -> np.ndarray:
    """Unit normal (P, 3), up to its sign, of the plane through the nearest points of the frame."""
    frames = np.zeros(len(points_mm), dtype=int)
    frames[tracks.track] = tracks.frame
    normals = np.zeros_like(points_mm)
    for frame in np.unique(frames):
        rows = np.flatnonzero(frames == frame)
        near = cKDTree(points_mm[rows]).query(points_mm[rows], k=min(_NEIGHBOURS, len(rows)))[1]
        around = points_mm[rows][near.reshape(len(rows), -1)]
        around = around - np.median(around, axis=1, keepdims=True)
        # Wrong points are far away: weights that fall with the distance make the plane robust.
        distance = np.linalg.norm(around, axis=2, keepdims=True)
        around = around / np.maximum(distance, np.median(distance, axis=1, keepdims=True)) ** 2
        normals[rows] = np.linalg.svd(around, full_matrices=False)[2][:, -1]
    return normals


def _projected_patches(source, target, grey, pixels, points_mm, normals, radius_px):
    """Patches of an image on tangent planes: target pixels (N, S, 2) and values (N, S)."""
    step = np.arange(-radius_px, radius_px + 1)
    grid = np.stack(np.meshgrid(step, step), axis=-1).reshape(-1, 2)
    at = pixels[:, None] + grid
    origins, directions = source.rays(at.reshape(-1, 2))
    origins = np.broadcast_to(origins, directions.shape).reshape(*at.shape[:2], 3)
    directions = directions.reshape(*at.shape[:2], 3)
    height = ((points_mm[:, None] - origins) * normals[:, None]).sum(axis=2)
    along = height / np.where(
        np.abs(slope := (directions * normals[:, None]).sum(axis=2)) > 0.1, slope, np.nan
    )
    there = target.project((origins + along[..., None] * directions).reshape(-1, 3))
    return there.reshape(at.shape), _sampled(grey, at)


def _shifts(grey, where, patch):
    """Shifts (N, 2) px that make an image agree with patches up to gain and offset; correlation."""
    y_slope, x_slope = np.gradient(grey.astype(np.float32))
    wanted = _standardised(patch)[0]
    shift = np.zeros((len(where), 2))
    for _ in range(_ROUNDS):
        at = where + shift[:, None]
        values, scale = _standardised(_sampled(grey, at))
        slopes = np.stack([_sampled(s, at) for s in (x_slope, y_slope)], axis=2)
        slopes = (slopes - slopes.mean(axis=1, keepdims=True)) / scale[..., None]
        # The component of a slope along the patch itself is gain.
        slopes = (
            slopes - (slopes * values[..., None]).sum(axis=1, keepdims=True) * values[..., None]
        )
        left = slopes.transpose(0, 2, 1) @ slopes + 1e-9 * np.eye(2)
        right = (slopes * (wanted - values)[..., None]).sum(axis=1)
        step = np.linalg.solve(
            np.nan_to_num(left) + 1e-9 * np.eye(2), np.nan_to_num(right)[..., None]
        )
        shift = np.clip(shift + step[..., 0], -_MAX_SHIFT_PX, _MAX_SHIFT_PX)
    values, _ = _standardised(_sampled(grey, where + shift[:, None]))
    return shift, np.nan_to_num((values * wanted).sum(axis=1))


def _standardised(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, S) with mean zero and unit norm, and the norms (N, 1)."""
    values = values - values.mean(axis=1, keepdims=True)
    scale = np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-6)
    return values / scale, scale


def _sampled(grey: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Cubic values (N, S) at pixels (N, S, 2); NaN pixels give NaN."""
    where = (pixels - 0.5).astype(np.float32)
    values = cv2.remap(
        grey.astype(np.float32), where[..., 0], where[..., 1], cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    return np.where(np.isfinite(where).all(axis=2), values, np.nan)
