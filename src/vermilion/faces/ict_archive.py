"""Reading ICT-FaceKit (MIT licence) from a folder or archive; downloading the pinned archive.

The model is 26,719 vertices in centimetres: a neutral, one OBJ for each expression and identity
mode (absolute positions), and `vertex_indices.json`. It is never part of this repository.
"""

from __future__ import annotations

import json
import lzma
import tarfile
import urllib.request
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_path, sha256_of

NEUTRAL = "generic_neutral_mesh"
N_VERTICES = 26719
MM_PER_UNIT = 10.0


@dataclass(frozen=True)
class IctData:
    """ICT-FaceKit as its files have it, in millimetres.

    Attributes:
        neutral_mm: (26719, 3) float64.
        polygons: (P, 4) int32 vertices of each polygon; a triangle repeats its third corner.
        polygon_uv: (P, 4) int32 into `uv`.
        uv: (U, 2) float64; each material lies in a tile of its own.
        materials: (P,) material name of each polygon.
        expression_names: K names.
        expressions_mm: (K, 26719, 3) float32 displacements.
        identities_mm: (I, 26719, 3) float32 displacements.
        landmarks68: (68,) int32 vertices of the 68-point scheme.
    """

    neutral_mm: np.ndarray
    polygons: np.ndarray
    polygon_uv: np.ndarray
    uv: np.ndarray
    materials: np.ndarray
    expression_names: tuple[str, ...]
    expressions_mm: np.ndarray
    identities_mm: np.ndarray
    landmarks68: np.ndarray


def download_archive(url: str, sha256: str, path: str | Path) -> None:
    """Download the archive under a temporary name, check its SHA-256, rename.

    Raises InputError where the checksum differs or the address cannot be read.
    """
    with atomic_path(path) as temporary:
        try:
            urllib.request.urlretrieve(url, temporary)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no answer from {url} ({error})",
                "the pinned ICT-FaceKit archive",
                "Fetch the archive by hand and name it in `face_model.path`.",
            ) from error
        check_archive(temporary, sha256, named=url)


def check_archive(path: str | Path, sha256: str, named: str | None = None) -> None:
    """Raise InputError unless the file has the SHA-256 given."""
    found = sha256_of(path)
    if found != sha256.lower():
        raise InputError(
            f"SHA-256 {found}",
            sha256,
            "The file is damaged or of another version: fetch it again, or correct the checksum.",
            path=named or path,
        )


def read_ict(path: str | Path, n_identities: int = 100) -> IctData:
    """Read the model from its `FaceXModel` folder, a folder above it, or an archive of it.

    Raises InputError where a file is missing or of another vertex count.
    """
    with _opened(Path(path)) as read:
        try:
            indices = json.loads(read("vertex_indices.json"))
            neutral = read(f"{NEUTRAL}.obj")
            names = tuple(indices["expressions"])
            expressions = [_positions(read(f"{name}.obj"), name, path) for name in names]
            identities = [
                _positions(read(f"identity{i:03d}.obj"), f"identity{i:03d}", path)
                for i in range(n_identities)
            ]
        except KeyError as error:
            raise InputError(
                f"no {error.args[0]}",
                "the FaceXModel folder of ICT-FaceKit, or an archive of it",
                "Correct `face_model.path`.",
                path=path,
            ) from error
    base = _positions(neutral, NEUTRAL, path)
    polygons, polygon_uv, uv, materials = _faces(neutral)
    return IctData(
        neutral_mm=base,
        polygons=polygons,
        polygon_uv=polygon_uv,
        uv=uv,
        materials=materials,
        expression_names=names,
        expressions_mm=_displacements(expressions, base),
        identities_mm=_displacements(identities, base),
        landmarks68=np.array(indices["idx_to_landmark_verts"], dtype=np.int32),
    )


def _displacements(shapes: list[np.ndarray], base: np.ndarray) -> np.ndarray:
    return np.stack([(shape - base).astype(np.float32) for shape in shapes])


@contextmanager
def _opened(path: Path) -> Iterator[Callable[[str], bytes]]:
    """Yield a function from a file name to its content; KeyError where there is no such file."""
    if path.is_dir():
        folders = [path, path / "FaceXModel"]
        folder = next((f for f in folders if (f / "vertex_indices.json").is_file()), path)

        def read_file(name: str) -> bytes:
            try:
                return (folder / name).read_bytes()
            except OSError as error:
                raise KeyError(name) from error

        yield read_file
        return
    yield archive_contents(path).__getitem__


def archive_contents(path: Path) -> dict[str, bytes]:
    """Files of `FaceXModel/` in an archive, by name.

    Raises InputError where it cannot be read.
    """
    try:
        return _zip_contents(path) if zipfile.is_zipfile(path) else _tar_contents(path)
    except (OSError, EOFError, tarfile.TarError, zipfile.BadZipFile, lzma.LZMAError) as error:
        raise InputError(
            f"an unreadable archive ({error})",
            "FaceXModel of ICT-FaceKit as a folder, or a .tar.xz, .tar.gz or .zip archive of it",
            "Correct `face_model.path`.",
            path=path,
        ) from error


def _tar_contents(path: Path) -> dict[str, bytes]:
    """Files of the archive by name, in one pass (a compressed archive cannot seek cheaply)."""
    with tarfile.open(path) as archive:
        return {
            Path(member.name).name: content.read()
            for member in archive
            if Path(member.name).parent.name == "FaceXModel"
            and member.isfile()
            and (content := archive.extractfile(member)) is not None
        }


def _zip_contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {
            Path(name).name: archive.read(name)
            for name in archive.namelist()
            if Path(name).parent.name == "FaceXModel"
        }


def _positions(content: bytes, name: str, path: str | Path) -> np.ndarray:
    """Vertex positions of an OBJ, (26719, 3) mm."""
    start = content.find(b"\nv ") + 1
    last = content.rfind(b"\nv ") + 1
    block = content[start : content.find(b"\n", last)]
    values = np.array(block.replace(b"v ", b" ").split(), dtype=np.float64)
    if len(values) != 3 * N_VERTICES:
        raise InputError(
            f"{len(values) // 3} vertices in {name}",
            f"{N_VERTICES} (ICT-FaceKit, FaceXModel)",
            "Use the pinned version of ICT-FaceKit.",
            path=path,
        )
    return values.reshape(-1, 3) * MM_PER_UNIT


def _faces(content: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Polygons, their texture corners, texture coordinates and materials of the neutral OBJ."""
    polygons, corners, uv, materials = [], [], [], []
    material = ""
    for line in content.decode("ascii").splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "vt":
            uv.append(rest.split()[:2])
        elif kind == "usemtl":
            material = rest.strip()
        elif kind == "f":
            pairs = [part.split("/")[:2] for part in rest.split()]
            pairs += [pairs[-1]] * (4 - len(pairs))
            polygons.append([pair[0] for pair in pairs])
            corners.append([pair[1] for pair in pairs])
            materials.append(material)
    return (
        np.array(polygons, dtype=np.int32) - 1,
        np.array(corners, dtype=np.int32) - 1,
        np.array(uv, dtype=np.float64),
        np.array(materials),
    )
