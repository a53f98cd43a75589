"""Sculpted frames: the same mesh from OBJ, PLY and USD, and what is refused."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.guided.inputs import read_sculpt
from vermilion.guided.sculpt_files import SCULPT_SUFFIXES
from vermilion.storage.errors import InputError

TRIANGLES = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]], dtype=np.int32)
#: As large as a face, so that millimetres are not mistaken.
VERTICES = np.array(
    [[0, 0, 0], [90, 5, 1], [3, 60, 4], [95, 70, 9], [8, 150, 7], [99, 160, 2]], dtype=float
)


def write_usd(path, frames):
    """One mesh, at rest or with a sample for each frame -> vertices."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.001)
    mesh = UsdGeom.Mesh.Define(stage, "/face")
    mesh.GetFaceVertexCountsAttr().Set(Vt.IntArray([3] * len(TRIANGLES)))
    mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray(TRIANGLES.ravel().tolist()))
    for time, vertices in frames.items():
        points = Vt.Vec3fArray.FromNumpy(np.asarray(vertices, dtype=np.float32))
        mesh.GetPointsAttr().Set(points, Usd.TimeCode.Default() if time is None else time)
    stage.GetRootLayer().Save()


def test_a_sculpt_reads_the_same_from_each_format(tmp_path):
    write_ply(tmp_path / "000007.ply", Mesh(VERTICES, TRIANGLES))
    lines = [f"v {x} {y} {z}" for x, y, z in VERTICES] + [
        f"f {a} {b} {c}" for a, b, c in TRIANGLES + 1
    ]
    (tmp_path / "000007.obj").write_text("\n".join(lines) + "\n")
    for suffix in (".usd", ".usda", ".usdc"):
        write_usd(tmp_path / f"000007{suffix}", {None: VERTICES})
    for suffix in SCULPT_SUFFIXES:
        if suffix != ".usdz":
            found = read_sculpt(tmp_path / f"000007{suffix}", TRIANGLES, len(VERTICES))
            np.testing.assert_allclose(found, VERTICES, atol=1e-4)


def test_an_animated_sculpt_is_read_at_its_frame(tmp_path):
    write_usd(tmp_path / "000007.usdc", {6: VERTICES, 7: VERTICES + 1.0, 8: VERTICES + 5.0})
    found = read_sculpt(tmp_path / "000007.usdc", TRIANGLES, len(VERTICES))
    np.testing.assert_allclose(found, VERTICES + 1.0, atol=1e-4)


def test_a_sculpt_of_another_topology_is_refused(tmp_path):
    write_usd(tmp_path / "000007.usda", {None: VERTICES})
    with pytest.raises(InputError, match="keep the order of vertices"):
        read_sculpt(tmp_path / "000007.usda", TRIANGLES[:, [1, 0, 2]], len(VERTICES))
