"""Arrays, models and databases that are cut, foreign, newer, or hold what is no array."""

from __future__ import annotations

import io
import os
import zipfile
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests import heads
from tests.faults.case import Case, check, parametrized
from vermilion.database.read import LipDatabase
from vermilion.database.schema import SubjectEntry, TakeEntry
from vermilion.database.write import write_database
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import topology_hash
from vermilion.regression.estimators import AffineRegressor
from vermilion.regression.model import LipModel, load_model, save_model
from vermilion.storage.arrays import read_arrays, write_array, write_arrays
from vermilion.storage.sequences import read_sequence, write_sequence

TRIANGLES = np.array([[0, 1, 2], [1, 3, 2]])
NAMES = ("shape_01", "shape_02")


def arrays(path):
    return read_arrays(path, "file of features", ("features", "names"))


def database(path):
    with LipDatabase(path) as found:
        return found.takes


# Good files


def npz(path: Path, rng, **more) -> Path:
    kept = {"features": rng.normal(size=(50, 8)), "names": np.array(NAMES), **more}
    np.savez_compressed(path, **{name: value for name, value in kept.items() if value is not None})
    return path


def regressor(path: Path, rng) -> Path:
    features, layers = rng.normal(size=(20, 2)), rng.normal(size=(20, 18)).astype(np.float32)
    estimator = AffineRegressor(0.1).fit(features, layers, np.zeros(20, int))
    frames = {"ana/rom": np.arange(20)}
    columns, mask = np.arange(2), np.arange(2)
    save_model(
        path, LipModel("MS", estimator, NAMES, columns, mask, topology_hash(TRIANGLES), frames)
    )
    return path


def lips(path: Path, rng) -> Path:
    take = TakeEntry(
        subject="ana", take="rom", fps=30.0, split="train", frames=np.arange(6),
        features=rng.normal(size=(6, 2)).astype(np.float32),
        layers=rng.normal(size=(6, 2, 9)).astype(np.float32),
        displacement_mm=rng.normal(size=(6, 4, 3)).astype(np.float32),
        valid=np.ones(6, bool), train=np.ones(6, bool),
    )  # fmt: skip
    person = SubjectEntry("ana", rng.normal(size=(4, 3)), np.arange(2), np.zeros(2))
    write_database(path, TRIANGLES, NAMES, [person], [take])
    return path


@cache
def saved_face() -> bytes:
    stream = io.BytesIO()
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        heads.small_tracker().save(Path(folder) / "face.npz")
        stream.write((Path(folder) / "face.npz").read_bytes())
    return stream.getvalue()


def face(path: Path, rng) -> Path:
    path.write_bytes(saved_face())
    return path


def meshes(path: Path, rng) -> Path:
    write_sequence(path, rng.normal(size=(4, 30, 3)))
    return path


KINDS = {
    "npz": ("features.npz", npz, arrays),
    "face": ("tracker.npz", face, FaceModel.load),
    "sequence": ("000000-000003.npy", meshes, read_sequence),
    "model": ("MS.h5", regressor, load_model),
    "database": ("lips.h5", lips, database),
}

# What is wrong


def cut(path: Path, rng) -> None:
    os.truncate(path, int(path.stat().st_size * rng.uniform(0.05, 0.95)))


def empty(path: Path, rng) -> None:
    path.write_bytes(b"")


def text(path: Path, rng) -> None:
    path.write_text("features\tnames\n1\t2\n")


def pickled(path: Path, rng) -> None:
    import pickle

    path.write_bytes(pickle.dumps({"features": [1, 2, 3]}))


def document(path: Path, rng) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("word/document.xml", "<xml/>")


def one_array(path: Path, rng) -> None:
    with path.open("wb") as stream:
        np.save(stream, np.zeros(3))


def folder(path: Path, rng) -> None:
    path.unlink()
    path.mkdir()


def flipped(path: Path, rng) -> None:
    """A bit of the values, not of the list of contents that zip keeps twice."""
    data = bytearray(path.read_bytes())
    data[200 + int(rng.integers(2000))] ^= 16
    path.write_bytes(data)


def spoilt(kind: str, spoil, says="", **options):
    name, make, read = KINDS[kind]

    def made(folder, rng):
        path = make(folder / name, rng)
        spoil(path, rng)
        return path

    return Case(f"{kind}: {spoil.__name__.replace('_', ' ')}", made, read, says, **options)


def with_array(what: str, says="", **more):
    def made(folder, rng):
        return npz(folder / "features.npz", rng, **more)

    return Case(f"npz: {what}", made, arrays, says)


def lying(shape: bytes):
    """A header that promises other values than the file holds."""

    def made(folder, rng):
        path = npz(folder / "good.npz", rng)
        with zipfile.ZipFile(path) as good, zipfile.ZipFile(folder / "features.npz", "w") as bad:
            for entry in good.infolist():
                data = good.read(entry)
                if entry.filename == "features.npy":
                    data = data.replace(b"(50, 8), }" + b" " * (len(shape) - 7), shape + b", }")
                bad.writestr(entry, data)
        return folder / "features.npz"

    return made


def zeros(folder, rng):
    """300 MB of zeros in 0.3 MB, as no measurement packs."""
    path = folder / "features.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("features.npy", "w") as stream,
    ):
        header = {"descr": "<f4", "fortran_order": False, "shape": (75, 10**6)}
        np.lib.format.write_array_header_1_0(stream, header)
        for _ in range(75):
            stream.write(bytes(4 * 10**6))
    return path


def edited(kind: str, what: str, edit, says="", **options):
    """An HDF5 file that `edit` changes."""
    name, make, read = KINDS[kind]

    def made(folder, rng):
        path = make(folder / name, rng)
        with h5py.File(path, "a") as file:
            edit(file)
        return path

    return Case(f"{kind}: {what}", made, read, says, **options)


def attribute(name: str, value):
    def edit(file):
        file.attrs[name] = value

    return edit


def without(name: str):
    def edit(file):
        del file[name]

    return edit


def huge(name: str):
    def edit(file):
        del file[name]
        file.create_dataset(name, shape=(10**6, 10**5), chunks=(1000, 1000), dtype="f8")

    return edit


def elsewhere(name: str):
    def edit(file):
        del file[name]
        file[name] = h5py.ExternalLink("/etc/hostname", "/values")

    return edit


def words(name: str):
    def edit(file):
        del file[name]
        file[name] = "words"

    return edit


def newer_face(path: Path, rng) -> None:
    kept = dict(np.load(path, allow_pickle=False)) | {"format_version": 99}
    np.savez(path, **kept)


def face_without_regions(path: Path, rng) -> None:
    kept = {name: value for name, value in np.load(path).items() if name != "regions"}
    np.savez(path, **kept)


UNREADABLE = "unreadable|no readable|truncated or damaged|format -1"
CASES = [
    *(spoilt(kind, spoil, UNREADABLE) for kind in KINDS
      for spoil in (cut, empty, text, pickled, document, folder)),
    spoilt("npz", one_array, UNREADABLE),
    spoilt("face", flipped, UNREADABLE),
    spoilt("face", newer_face, "format 99"),
    spoilt("face", face_without_regions, "no array 'regions'"),
    with_array("array missing", "names", names=None),
    with_array("object arrays", "Python objects", features=np.array([{}, None], dtype=object)),
    Case("npz: header says 10^12 values", lying(b"(999999999, 999)"), arrays, "its header says", heavy=True),
    Case("npz: header says fewer values", lying(b"(49, 8)"), arrays, "its header says"),
    Case("npz: zeros that unpack to 300 MB", zeros, arrays, "unpack", heavy=True),
    edited("model", "newer", attribute("format_version", 99), "version 99.*"),
    edited("model", "version as a word", attribute("format_version", "new"), UNREADABLE),
    edited("model", "foreign", attribute("format", "weather"), "'weather'"),
    edited("model", "unknown estimator", attribute("estimator", "oracle"), UNREADABLE),
    edited("model", "mask missing", without("mask/triangles"), UNREADABLE),
    edited("model", "10^11 values", huge("mask/triangles"), "unpack", heavy=True),
    edited("model", "values in another file", elsewhere("mask/triangles"), "link"),
    edited("model", "words for numbers", words("features/columns"), UNREADABLE),
    edited("database", "newer", attribute("format_version", 99), "99"),
    edited("database", "version as a word", attribute("format_version", "new"), "new"),
    edited("database", "mask missing", without("mask/triangles"), UNREADABLE),
    edited("database", "10^11 values", huge("topology/triangles"), "unpack", heavy=True),
    edited("database", "values in another file", elsewhere("mask/area_mm2"), "link"),
    edited("database", "words for names", words("features/names"), UNREADABLE),
]  # fmt: skip


@parametrized(CASES)
def test_archive(case, seed, tmp_path):
    check(case, seed, tmp_path)


@pytest.mark.parametrize(
    "write",
    [lambda path, values: write_arrays(path, values=values), write_array],
    ids=["arrays", "array"],
)
def test_python_objects_are_never_written(tmp_path, write):
    with pytest.raises(ValueError, match=r"(?i)object"):
        write(tmp_path / "a.npz", np.array([{}, print], dtype=object))
    assert not list(tmp_path.iterdir())
