"""Good files of every kind with bytes changed by chance: a value or a sentence, never another error.

`VERMILION_FAULT_SEEDS=200` tries many; the kept seeds are those of a short run.
"""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

from tests.faults import test_archives as archives
from tests.faults import test_cameras as cameras
from tests.faults import test_configurations as configurations
from tests.faults import test_images as images
from tests.faults import test_labels as labels
from tests.faults import test_meshes as meshes
from tests.faults import test_tables as tables
from tests.faults import test_videos as videos
from tests.faults.case import MOST_LETTERS, MOST_SECONDS
from vermilion.geometry.mesh_files import read_polygons
from vermilion.imaging.images import read_image
from vermilion.scan.read import read_scan
from vermilion.storage.errors import VermilionError

SEEDS = 4 * int(os.environ.get("VERMILION_FAULT_SEEDS", "1"))


def image(suffix: str):
    return lambda folder, rng: images.whole(folder / f"000000{suffix}", rng)


def label(kind: str):
    folder_name, content_of, _ = labels.KINDS[kind]

    def make(folder, rng):
        path = folder / "labels" / folder_name / "face2" / "000010.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(content_of()))
        return path

    return make


def archive(kind: str):
    name, make, _ = archives.KINDS[kind]
    return lambda folder, rng: make(folder / name, rng)


def colmap(name: str):
    def make(folder, rng):
        cameras.colmap(lambda *_: None)(folder, rng)
        return folder / "cameras" / name

    return make


#: Kind -> how a good file is made, how it is read.
KINDS = {
    **{suffix: (image(suffix), read_image) for suffix in
       (".png", ".jpg", ".tif", ".exr", ".dpx", ".bmp", ".tga", ".webp")},
    "mp4": (videos.content(videos.clip), videos.first_image),
    "cameras.txt": (colmap("cameras.txt"), cameras.read),
    "images.txt": (colmap("images.txt"), cameras.read),
    "rig.json": (cameras.as_json(), cameras.read),
    "opencv": (cameras.opencv(), cameras.read),
    "metashape": (cameras.metashape(), cameras.read),
    "obj": (meshes.changed("000000.obj", lambda mesh, rng: mesh), read_polygons),
    "ply": (meshes.changed("000000.ply", lambda mesh, rng: mesh), read_polygons),
    "scan.ply": (meshes.changed("scan.ply", lambda mesh, rng: mesh), read_scan),
    "scan.obj": (meshes.changed("scan.obj", lambda mesh, rng: mesh), read_scan),
    "gltf": (meshes.gltf(), meshes.two),
    "track.npz": (meshes.archive(), meshes.two),
    **{kind: (archive(kind), archives.KINDS[kind][2]) for kind in archives.KINDS},
    **{kind: (label(kind), labels.KINDS[kind][2]) for kind in labels.KINDS},
    "sheet": (tables.file("takes.tsv", tables.SHEET), tables.sheet),
    "landmarks.csv": (tables.file("a.csv", tables.tracked()), tables.landmarks),
    "curves.csv": (tables.file("a.csv", tables.CURVES), tables.curves),
    "scan.tsv": (tables.file("a.tsv", tables.SCAN), tables.read_scan_landmarks),
    "config.yaml": (configurations.file("capture:\n  frontal_camera: face2\nchunk_frames: 50\n"),
                    configurations.load),
}  # fmt: skip


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes flipped, overwritten, removed, doubled, or moved; where is by chance."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        at = int(rng.integers(max(len(changed), 1)))
        length = int(min(rng.geometric(0.1), max(len(changed) - at, 0)))
        kind = int(rng.integers(6))
        if kind == 0 and changed:
            changed[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            changed[at : at + length] = rng.bytes(length)
        elif kind == 2:
            del changed[at : at + length]
        elif kind == 3:
            changed[at:at] = changed[at : at + length]
        elif kind == 4:
            changed[at : at + length] = b"\xff" * length
        else:
            changed[at : at + length] = rng.choice(
                [b"-1", b"1e999", b"nan", b"\0\0\0\0", b"0", b"\n"]
            )
    return bytes(changed)


@pytest.mark.parametrize("kind", KINDS)
def test_changed_bytes_give_a_value_or_a_sentence(kind, tmp_path):
    make, read = KINDS[kind]
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        path = Path(make(folder, rng))
        path.write_bytes(mutate(path.read_bytes(), rng))
        start = time.process_time()
        try:
            read(path)
        except VermilionError as error:
            assert len(str(error)) < MOST_LETTERS, f"seed {seed}: {str(error)[:300]}"
        except Exception as error:
            pytest.fail(f"seed {seed}: {type(error).__name__}: {error}")
        assert time.process_time() - start < MOST_SECONDS, f"seed {seed}"
