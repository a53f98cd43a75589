"""Numbered images and meshes as people have them; two sequences in one folder are named."""

from __future__ import annotations

import numpy as np
import pytest

from vermilion.external.read import read_tracked
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.imaging.frames import list_frames
from vermilion.storage.errors import InputError


@pytest.mark.parametrize(
    ("names", "frames"),
    [
        (["000000.png", "000001.png"], [0, 1]),
        (["frame0001.png", "frame0002.png", "frame0010.png"], [1, 2, 10]),
        (["IMG_0001.JPG", "IMG_0002.jpg"], [1, 2]),
        (["shot.1001.exr", "shot.1002.EXR"], [1001, 1002]),
        (["plate-4k_0007.dpx"], [7]),
        (["9.Tiff", "10.tif"], [9, 10]),
        (["notes.txt", "readme1.md", ".tmp15.png", "mask.png", "a1.png"], [1]),
        (["clip.mp4"], []),
    ],
)
def test_the_number_before_the_suffix_is_the_frame(tmp_path, names, frames):
    for name in names:
        (tmp_path / name).touch()
    assert list(list_frames(tmp_path)) == frames


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["a001.png", "a002.png", "b001.png"], "'a001.png' to 'a002.png' and 'b001.png'"),
        (["000001.png", "mask_000001.png"], "'000001.png' and 'mask_000001.png'"),
        (["f1.png", "f2.png", "f2.jpg"], "frame 2, 'f2.jpg' and 'f2.png'"),
        (["f1.png", "f0001.png"], "frame 1, 'f0001.png' and 'f1.png'"),
    ],
)
def test_two_sequences_in_a_folder_are_both_named(tmp_path, names, said):
    for name in names:
        (tmp_path / name).touch()
    with pytest.raises(InputError) as error:
        list_frames(tmp_path)
    assert said in str(error.value) and str(tmp_path) in str(error.value)


def test_meshes_are_numbered_the_same_way(tmp_path):
    triangles = np.array([[0, 1, 2]], dtype=np.int32)
    for frame in range(4):
        corners = np.array([[frame, 0, 0], [200, 0, 0], [0, 200, 0]], dtype=float)
        write_ply(tmp_path / f"tst{frame:03d}.ply", Mesh(corners, triangles))
    sequence = read_tracked(tmp_path, [0, 3])
    assert np.array_equal(sequence.vertices_mm[:, 0, 0], [0, 3])
    (tmp_path / "other000.obj").write_text("v 0 0 0\n")
    with pytest.raises(InputError, match=r"'other000\.obj' and 'tst000\.ply' to 'tst003\.ply'"):
        read_tracked(tmp_path, [0])
