"""Reading the database."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from vermilion.database.schema import FORMAT, FORMAT_VERSION, TakeEntry
from vermilion.regression.training_set import TrainingSet
from vermilion.storage.errors import InputError
from vermilion.storage.hdf5 import DAMAGE, open_hdf5

#: Fewer frames cannot be cross-validated.
MIN_FRAMES = 5


class LipDatabase:
    """`lips.h5`, open for reading; use as a context manager.

    Attributes:
        triangles: (T, 3) int32 topology of the coarse mesh.
        topology: its hash.
        mask: (M,) int32 ids of the triangles that the layers cover.
        vertices: (N,) int32 ids of their corners, ascending.
        area_mm2: (M,) mean area of each over the subjects' neutrals.
        feature_names: names of the features.
        takes: (subject, take) pairs, sorted.
    """

    def __init__(self, path: str | Path):
        def unreadable(why: str) -> InputError:
            return InputError(
                f"no readable database ({why})",
                "an HDF5 that the rule `database` wrote",
                "Remove the file and run again.",
                path=path,
            )

        self._file = open_hdf5(path, unreadable)
        found = tuple(self._file.attrs.get(key) for key in ("format", "format_version"))
        if found != (FORMAT, FORMAT_VERSION):
            self._file.close()
            raise InputError(
                f"format {found[0]!r}, version {found[1]}",
                f"{FORMAT!r}, version {FORMAT_VERSION}",
                "Rebuild it with this version of Vermilion.",
                path=path,
            )
        try:
            self._read_facts()
        except DAMAGE as error:
            self._file.close()
            raise unreadable(f"{error}") from error

    def _read_facts(self) -> None:
        file = self._file
        self.triangles = file["topology/triangles"][:]
        self.topology = str(file["topology/triangles"].attrs["sha256"])
        self.mask = file["mask/triangles"][:]
        self.vertices = file["mask/vertices"][:]
        self.area_mm2 = file["mask/area_mm2"][:]
        self.feature_names = tuple(name.decode() for name in file["features/names"][:])
        self.takes = tuple((s, t) for s in sorted(file["takes"]) for t in sorted(file["takes"][s]))

    def __enter__(self) -> LipDatabase:
        return self

    def __exit__(self, *_) -> None:
        self._file.close()

    @property
    def subjects(self) -> tuple[str, ...]:
        """Their names, sorted."""
        return tuple(sorted({subject for subject, _ in self.takes}))

    def neutral_mm(self, subject: str) -> np.ndarray:
        """(V, 3) coarse neutral of a subject in the head frame."""
        return self._file[f"subjects/{subject}/neutral_mm"][:]

    def neutral_features(self, subject: str) -> np.ndarray | None:
        """(M,) features of a subject's neutral frame; None where it has none."""
        found = self._file[f"subjects/{subject}"].get("neutral_features")
        return None if found is None else found[:]

    def read_take(self, subject: str, take: str) -> TakeEntry:
        """All frames of a take."""
        group = self._file[f"takes/{subject}/{take}"]
        arrays = {name: values[:] for name, values in group.items()}
        fps, split = float(group.attrs["fps"]), str(group.attrs["split"])
        return TakeEntry(subject, take, fps, split, **arrays)

    def training_set(self, subjects: Collection[str]) -> TrainingSet:
        """The valid training frames of some subjects.

        Raises InputError where there are fewer than `MIN_FRAMES`.
        """
        chosen = [(s, t) for s, t in self.takes if s in subjects]
        groups = [self._file[f"takes/{subject}/{take}"] for subject, take in chosen]
        rows = [np.flatnonzero(group["valid"][:] & group["train"][:]) for group in groups]
        total = sum(len(r) for r in rows)
        if total < MIN_FRAMES:
            raise InputError(
                f"{total} valid training frames of {', '.join(sorted(subjects)) or 'no subject'}",
                f"at least {MIN_FRAMES}",
                "Give a take of role `tattoo` with split `train` or `test:A-B`, and look at the "
                "quality table for frames that failed.",
            )

        def gathered(name: str, width: int, dtype: type = np.float32) -> np.ndarray:
            """(total, width) of a data set's rows, read take by take into one array."""
            result: np.ndarray = np.empty((total, width), dtype=dtype)
            for group, part, end in zip(
                groups, rows, np.cumsum([len(r) for r in rows]), strict=True
            ):
                if len(part):
                    result[end - len(part) : end] = group[name][part].reshape(len(part), -1)
            return result

        trained = sorted({s for (s, _), part in zip(chosen, rows, strict=True) if len(part)})
        rests = {s: self.neutral_features(s) for s in trained}
        return TrainingSet(
            features=gathered("features", len(self.feature_names)),
            layers=gathered("layers", 9 * len(self.mask)),
            displacements_mm=gathered("displacement_mm", 3 * len(self.vertices)),
            sequences=np.repeat(np.arange(len(chosen)), [len(part) for part in rows]),
            takes=tuple(f"{s}/{t}" for s, t in chosen),
            frames=gathered("frames", 1, np.int32)[:, 0],
            neutrals_mm={s: self.neutral_mm(s) for s in trained},
            neutral_features={s: found for s, found in rests.items() if found is not None},
        )
