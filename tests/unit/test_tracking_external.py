"""Mesh sequences of other trackers: folders, archives, USD."""

import numpy as np
import pytest

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.storage.errors import InputError
from vermilion.tracking.external import read_tracked

CUBE = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]], dtype=np.int32)


def moved(frame):
    return CUBE + np.array([frame, 0, 0])


def write_obj(path, vertices):
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in TRIANGLES]
    path.write_text("\n".join(lines) + "\n")


def test_folders_of_obj_and_ply_are_read_by_number(tmp_path):
    for frame in range(3):
        write_obj(tmp_path / f"head.{frame:04d}.obj", moved(frame))
    write_ply(tmp_path / "head.0003.ply", Mesh(moved(3), TRIANGLES))
    sequence = read_tracked(tmp_path, [1, 2, 3], unit_mm=10.0)
    assert sequence.vertices_mm.dtype == np.float32
    assert np.allclose(sequence.vertices_mm[2], 10 * moved(3))
    assert np.array_equal(sequence.triangles, TRIANGLES)


def test_archives_are_read_by_frame_number(tmp_path):
    vertices = np.stack([moved(f) for f in (5, 6, 7)])
    path = tmp_path / "t.npz"
    np.savez(path, vertices_mm=vertices, triangles=TRIANGLES, frames=[5, 6, 7])
    assert np.allclose(read_tracked(path, [7, 5]).vertices_mm, vertices[[2, 0]])
    with pytest.raises(InputError, match="frames 5 to 7; expected frame 8"):
        read_tracked(path, [8])


def test_usd_is_read_in_its_own_unit_and_polygons_become_triangles(tmp_path):
    from pxr import Gf, Usd, UsdGeom

    path = tmp_path / "head.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    mesh = UsdGeom.Mesh.Define(stage, "/head")
    mesh.CreateFaceVertexCountsAttr([4, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 3, 2, 4, 6, 5])
    points = mesh.CreatePointsAttr()
    for frame in (1, 2):
        points.Set([Gf.Vec3f(*map(float, v)) for v in moved(frame)], frame)
    stage.Save()
    sequence = read_tracked(path, [1, 2])
    assert np.allclose(sequence.vertices_mm, [10 * moved(1), 10 * moved(2)])
    assert sorted(map(sorted, sequence.triangles.tolist())) == [[0, 1, 3], [0, 2, 3], [4, 5, 6]]


def test_a_change_of_topology_names_the_frame(tmp_path):
    write_obj(tmp_path / "0.obj", moved(0))
    write_ply(tmp_path / "1.ply", Mesh(moved(1), TRIANGLES[:3]))
    with pytest.raises(InputError, match="frame 1"):
        read_tracked(tmp_path, [0, 1])


def test_what_is_no_sequence_is_refused(tmp_path):
    (tmp_path / "t.abc").write_text("")
    with pytest.raises(InputError, match="USD"):
        read_tracked(tmp_path / "t.abc", [0], subject="s1", take="rom")
