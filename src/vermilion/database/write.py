"""Writing the database: whole or not at all, one take in memory at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import h5py
import numpy as np

import vermilion
from vermilion.database.schema import FORMAT, FORMAT_VERSION, LAYER_NUMBERS, SubjectEntry, TakeEntry
from vermilion.geometry.mesh import mesh_corners, topology_hash, triangle_areas
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path


def common_mask(subjects: Sequence[SubjectEntry], min_share: float) -> np.ndarray:
    """Triangles (M,) in every subject's mask, ascending ids.

    Raises InputError where some subject keeps less than `min_share` of its own mask.
    """
    mask = subjects[0].mask
    for entry in subjects[1:]:
        mask = np.intersect1d(mask, entry.mask)
    for entry in subjects:
        share = len(mask) / len(entry.mask)
        if share < min_share:
            raise InputError(
                f"a mask of {len(entry.mask)} triangles, of which {share:.0%} are common to all",
                f"at least {min_share:.0%}",
                "Look at the subjects' correspondence overlays: one of them misses part of the "
                "mouth. Repair it, or lower database.min_common_mask.",
                subject=entry.subject,
            )
    return mask


def write_database(
    path: str | Path,
    triangles: np.ndarray,
    feature_names: Sequence[str],
    subjects: Sequence[SubjectEntry],
    takes: Iterable[TakeEntry],
    *,
    min_common_mask: float = 0.5,
    compression: int = 1,
) -> None:
    """Write `lips.h5` (see `docs/database.md`).

    Args:
        triangles: (T, 3) topology of the coarse mesh, one for all subjects.
        feature_names: M names.
        subjects: every subject of `takes`.
        takes: their layers lie over their own subject's mask.
    """
    mask = common_mask(subjects, min_common_mask)
    corners = mesh_corners(triangles, mask)
    columns = {
        s.subject: (
            np.searchsorted(s.mask, mask),
            np.searchsorted(mesh_corners(triangles, s.mask), corners),
        )
        for s in subjects
    }
    area = np.mean([triangle_areas(s.neutral_mm, triangles[mask]) for s in subjects], axis=0)
    # HDF5 would store the time of writing; without it the same input gives the same bytes.
    with atomic_path(path) as temporary, h5py.File(temporary, "w", track_order=False) as file:
        file.attrs.update(
            format=FORMAT,
            format_version=FORMAT_VERSION,
            vermilion_version=vermilion.__version__,
            length_unit="mm",
            angle_unit="rad",
        )
        topology = _dataset(file, "topology/triangles", triangles.astype(np.int32))
        topology.attrs["sha256"] = topology_hash(triangles)
        _dataset(file, "mask/triangles", mask.astype(np.int32))
        _dataset(file, "mask/vertices", corners.astype(np.int32))
        _dataset(file, "mask/area_mm2", area.astype(np.float64))
        _dataset(file, "features/names", np.array(list(feature_names), dtype="S"))
        _dataset(file, "layers/names", np.array(LAYER_NUMBERS, dtype="S"))
        for person in subjects:
            _dataset(file, f"subjects/{person.subject}/neutral_mm", person.neutral_mm)
            if person.neutral_features is not None:
                values = person.neutral_features.astype(np.float32)
                _dataset(file, f"subjects/{person.subject}/neutral_features", values)
        for take in takes:
            _write_take(file, take, columns[take.subject], len(feature_names), compression)


def _write_take(
    file: h5py.File,
    entry: TakeEntry,
    columns: tuple[np.ndarray, np.ndarray],
    n_features: int,
    compression: int,
) -> None:
    if entry.features.shape[1] != n_features:
        raise InputError(
            f"{entry.features.shape[1]} features a frame",
            f"{n_features}, as in the other takes",
            "All takes must be tracked with one face model and one features configuration.",
            subject=entry.subject,
            take=entry.take,
        )
    group = file.create_group(f"takes/{entry.subject}/{entry.take}")
    group.attrs.update(
        subject=entry.subject, take=entry.take, fps=float(entry.fps), split=entry.split
    )
    _dataset(group, "frames", entry.frames.astype(np.int32))
    _dataset(group, "features", entry.features.astype(np.float32))
    _dataset(group, "valid", entry.valid.astype(bool))
    _dataset(group, "train", entry.train.astype(bool))
    options = {"compression": compression, "shuffle": True} if compression else {}
    for name, chosen in zip(("layers", "displacement_mm"), columns, strict=True):
        values = getattr(entry, name)[:, chosen].astype(np.float32)
        chunk = (min(16, len(values)), *values.shape[1:])
        group.create_dataset(name, data=values, chunks=chunk, track_times=False, **options)


def _dataset(group: h5py.Group, name: str, data: np.ndarray) -> h5py.Dataset:
    return group.create_dataset(name, data=data, track_times=False)
