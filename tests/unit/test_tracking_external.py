"""Mesh sequences of other trackers: folders, archives, USD."""

import numpy as np
import pytest

from vermilion.external.read import read_tracked
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.storage.errors import InputError

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
    (tmp_path / "t.fbx").write_text("")
    with pytest.raises(InputError, match=r"take rom, file .*t.fbx: found no mesh sequence; .*USD"):
        read_tracked(tmp_path / "t.fbx", [0], subject="s1", take="rom")
    with pytest.raises(InputError, match="found no such file or folder"):
        read_tracked(tmp_path / "nowhere", [0])
    for name in ("t.usdc", "t.glb", "t.npz"):
        (tmp_path / name).write_text("no such format")
        with pytest.raises(InputError, match=f"{name}: found an unreadable"):
            read_tracked(tmp_path / name, [0])


def test_a_missing_or_damaged_file_costs_its_frame(tmp_path):
    for frame in (0, 1, 3, 4):
        write_obj(tmp_path / f"{frame}.obj", moved(frame))
    (tmp_path / "3.obj").write_text("v 0 0\nf 1 2 3\n")
    sequence = read_tracked(tmp_path, range(5), unit_mm=1.0)
    assert np.isnan(sequence.vertices_mm[[2, 3]]).all()
    assert np.allclose(sequence.vertices_mm[[0, 1, 4]], [moved(0), moved(1), moved(4)])
    assert sorted(sequence.lost) == [2, 3]
    assert "three coordinates" in sequence.lost[3]


def test_quads_and_negative_indices_are_kept(tmp_path):
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE[:4]] + ["f -4/1 -3/2 -1/4 -2/3"]
    lines += [f"v {x} {y} {z}" for x, y, z in CUBE[4:]] + ["f -4 -3 -1", "f 1 2 6 5 7"]
    (tmp_path / "f.7.obj").write_text("\n".join(lines))
    sequence = read_tracked(tmp_path, [7], unit_mm=1.0)
    assert sequence.polygons.counts.tolist() == [4, 3, 5]
    assert sequence.polygons.corners.tolist() == [0, 1, 3, 2, 4, 5, 7, 0, 1, 5, 4, 6]


def test_text_ply_with_colours_and_mixed_polygons(tmp_path):
    header = [
        "ply", "format ascii 1.0", "comment by hand", "element vertex 4", "property float x",
        "property float y", "property float z", "property uchar red", "element face 2",
        "property list uchar int vertex_index", "property uchar flag", "end_header",
    ]  # fmt: skip
    rows = [f"{x} {y} {z} 255" for x, y, z in CUBE[:4]] + ["4 0 1 3 2 9", "3 0 1 2 9"]
    (tmp_path / "f.7.ply").write_text("\n".join(header + rows) + "\n")
    sequence = read_tracked(tmp_path, [7], unit_mm=1.0)
    assert sequence.polygons.counts.tolist() == [4, 3]
    assert np.allclose(sequence.vertices_mm[0], CUBE[:4])


def test_stl_corners_are_joined_as_in_the_first_frame(tmp_path):
    import trimesh

    for frame in range(2):
        trimesh.Trimesh(moved(frame), TRIANGLES, process=False).export(tmp_path / f"{frame}.stl")
    sequence = read_tracked(tmp_path, [0, 1], unit_mm=1.0)
    assert sequence.vertices_mm.shape == (2, 8, 3)
    corners = sequence.vertices_mm[1][sequence.triangles]
    assert np.allclose(corners, moved(1)[TRIANGLES])


@pytest.mark.parametrize(
    ("scale", "unit"), [(1.0, "millimetres"), (0.1, "centimetres"), (1e-3, "metres")]
)
def test_the_unit_is_guessed_from_the_size_and_said(tmp_path, scale, unit):
    head_mm = CUBE * [160.0, 230.0, 190.0]
    write_obj(tmp_path / "1.obj", head_mm * scale)
    sequence = read_tracked(tmp_path, [1])
    assert np.allclose(sequence.vertices_mm[0], head_mm, atol=0.01)
    said = "\n".join(sequence.understood)
    assert f"unit guessed: {unit}" in said
    assert "up axis guessed: y" in said


def test_z_up_is_turned_where_it_is_asked_for(tmp_path):
    write_obj(tmp_path / "1.obj", CUBE)
    turned = read_tracked(tmp_path, [1], unit_mm=1.0, up="z").vertices_mm[0]
    assert np.allclose(turned, CUBE[:, [0, 2, 1]] * [1, 1, -1])


def test_usd_with_two_meshes_asks_for_the_name_and_takes_it(tmp_path):
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    for name, shift in (("face", 0.0), ("hair", 5.0)):
        group = UsdGeom.Xform.Define(stage, f"/{name}")
        group.AddTranslateOp().Set(Gf.Vec3d(shift, 0, 0), 1.0)
        group.GetTranslateOp().Set(Gf.Vec3d(shift + 1, 0, 0), 2.0)
        mesh = UsdGeom.Mesh.Define(stage, f"/{name}/mesh")
        mesh.CreateFaceVertexCountsAttr([3])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
        mesh.CreatePointsAttr([Gf.Vec3f(*map(float, v)) for v in CUBE[:3]])
    stage.Save()
    with pytest.raises(
        InputError, match=r"2 meshes .*/face/mesh.*Name it in `tracking.external.mesh`"
    ):
        read_tracked(tmp_path / "two.usda", [1, 2])
    back = read_tracked(tmp_path / "two.usda", [1, 2], unit_mm=1.0, mesh="hair/mesh")
    assert np.allclose(back.vertices_mm[:, 0, 0], [5.0, 6.0])
