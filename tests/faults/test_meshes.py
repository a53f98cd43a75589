"""Meshes that are damaged, or are no surface: scans, sculpts, sequences of another tracker."""

from __future__ import annotations

import json
import struct

import numpy as np

from tests.faults.case import Case, check, parametrized
from vermilion.external.read import read_tracked
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import read_mesh, read_polygons, write_ply
from vermilion.guided.inputs import read_sculpt
from vermilion.scan.read import read_scan


def sheet(n: int = 12) -> Mesh:
    """A bent sheet of n x n vertices, about a face in size."""
    y, x = np.mgrid[:n, :n] / (n - 1) * 200.0
    vertices = np.stack([x, y, 0.002 * (x - 100) ** 2], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + n], axis=1)
    upper = np.stack([corner + 1, corner + n + 1, corner + n], axis=1)
    return Mesh(vertices, np.concatenate([lower, upper]).astype(np.int32))


GOOD = sheet()


def obj(mesh: Mesh, base: int = 1) -> str:
    lines = ["v {} {} {}".format(*vertex) for vertex in mesh.vertices_mm]
    lines += ["f {} {} {}".format(*(face + base)) for face in mesh.triangles]
    return "\n".join(lines) + "\n"


def file(name: str, data: bytes | str):
    def make(folder, rng):
        path = folder / name
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        return path

    return make


def changed(name: str, change):
    """A good mesh whose vertices or triangles `change` spoils."""

    def make(folder, rng):
        mesh = change(Mesh(GOOD.vertices_mm.copy(), GOOD.triangles.copy()), rng)
        path = folder / name
        if path.suffix == ".ply":
            write_ply(path, mesh)
        else:
            path.write_text(obj(mesh))
        return path

    return make


def with_nan(mesh, rng):
    mesh.vertices_mm[rng.integers(len(mesh.vertices_mm)), rng.integers(3)] = np.nan
    return mesh


def beyond(mesh, rng):
    mesh.triangles[rng.integers(len(mesh.triangles)), 1] = len(mesh.vertices_mm) + 7
    return mesh


def unreferenced(mesh, rng):
    return Mesh(np.concatenate([mesh.vertices_mm, rng.normal(0, 1e4, (30, 3))]), mesh.triangles)


def non_manifold(mesh, rng):
    """A fin of 40 triangles on one edge, one triangle twice, one without area."""
    a, b, _ = mesh.triangles[5]
    fin = np.stack([[a, b, k] for k in rng.integers(0, len(mesh.vertices_mm), 40)])
    more = np.concatenate([fin, mesh.triangles[:1], [[3, 3, 4]]])
    return Mesh(mesh.vertices_mm, np.concatenate([mesh.triangles, more]).astype(np.int32))


def fewer(mesh, rng):
    return sheet(11)


def other_order(mesh, rng):
    return Mesh(mesh.vertices_mm, np.roll(mesh.triangles, 1, axis=0))


def one_point(mesh, rng):
    return mesh.with_vertices(np.zeros_like(mesh.vertices_mm))


def truncated(folder, rng):
    path = folder / "000000.ply"
    write_ply(path, GOOD)
    path.write_bytes(path.read_bytes()[: int(rng.integers(400, path.stat().st_size - 10))])
    return path


def ply(count: int, kind: str = "float", extra: str = "") -> str:
    header = f"ply\nformat ascii 1.0\nelement vertex {count}\n"
    axes = "".join(f"property {kind} {axis}\n" for axis in "xyz")
    return (
        f"{header}{axes}element face 1\nproperty list uchar int vertex_indices\nend_header\n{extra}"
    )


BINARY_BOMB = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
    b"property float y\nproperty float z\nelement face 2000000000\n"
    b"property list uchar int vertex_indices\nend_header\n" + bytes(100)
)
STL_BOMB = bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50)


def sculpt(path):
    return read_sculpt(path, GOOD.triangles, len(GOOD.vertices_mm))


# Sequences


def sequence(second):
    """Two frames, of which `second` makes the other; returns the folder."""

    def make(folder, rng):
        take = folder / "meshes"
        take.mkdir()
        write_ply(take / "000000.ply", GOOD)
        write_ply(take / "000001.ply", second(Mesh(GOOD.vertices_mm.copy(), GOOD.triangles), rng))
        return take

    return make


def two(path):
    return read_tracked(path, [0, 1], fps=25.0)


def archive(**arrays):
    def make(folder, rng):
        path = folder / "track.npz"
        good = {"vertices_mm": np.stack([GOOD.vertices_mm] * 2), "triangles": GOOD.triangles}
        kept = {**good, **arrays}
        np.savez(path, **{name: value for name, value in kept.items() if value is not None})
        return path

    return make


def gltf(change=None):
    """A triangle as glTF with its buffer inside; `change` edits the document."""
    points = np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]], dtype="<f4")
    ids = np.array([0, 1, 2], dtype="<u2")
    import base64

    data = points.tobytes() + ids.tobytes()
    document = {
        "asset": {"version": "2.0"},
        "buffers": [
            {
                "byteLength": len(data),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
            }
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0, "name": "face"}],
    }
    if change:
        change(document)
    return file("track.gltf", json.dumps(document))


def set_in(*keys, value):
    def change(document):
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value

    return change


def outside(folder, rng):
    """A buffer that lies outside of the file's folder."""
    (folder / "private.bin").write_bytes(bytes(64))
    (folder / "take").mkdir()
    make = gltf(set_in("buffers", 0, "uri", value="../private.bin"))
    return make(folder / "take", rng)


def itself(document):
    document["nodes"] = [{"mesh": 0, "name": "face", "children": [1]}, {"children": [0]}]


MESH = "unreadable mesh|mesh that can be read"
CASES = [
    Case("obj: NaN", changed("000000.obj", with_nan), read_polygons, "not finite"),
    Case("obj: empty", file("000000.obj", ""), read_polygons, "no face"),
    Case("obj: face beyond", changed("000000.obj", beyond), read_polygons, "beyond"),
    Case("obj: face 0", file("000000.obj", obj(GOOD, 0)), read_polygons, "counts from 1"),
    Case("obj: words", file("000000.obj", "v one two three\nf 1 1 1\n"), read_polygons, MESH),
    Case("obj: huge numbers", file("000000.obj", "v 0 0 0\n" * 3 + "f 1 2 99999999999999999999\n"),
         read_polygons, MESH),
    Case("obj: noise", lambda folder, rng: file("000000.obj", rng.bytes(5000))(folder, rng),
         read_polygons, MESH),
    Case("obj: two numbers a vertex", file("000000.obj", "v 0 0\nf 1 1 1\n"), read_polygons, MESH),
    Case("ply: truncated", truncated, read_polygons, MESH),
    Case("ply: NaN", changed("000000.ply", with_nan), read_polygons, "not finite"),
    Case("ply: text of 10^10 vertices", file("000000.ply", ply(10**10)), read_polygons, MESH, heavy=True),
    Case("ply: binary of 4 10^9 vertices", file("000000.ply", BINARY_BOMB), read_polygons, MESH,
         heavy=True),
    Case("ply: negative count", file("000000.ply", ply(-5)), read_polygons, MESH),
    Case("ply: unknown type", file("000000.ply", ply(1, "quaternion")), read_polygons, MESH),
    Case("ply: header alone", file("000000.ply", "ply\n"), read_polygons, MESH),
    Case("ply: half a header", file("000000.ply", "ply\nelement\nproperty\nend_header\n"),
         read_polygons, MESH),
    Case("stl: 4 10^9 triangles", file("000000.stl", STL_BOMB), read_polygons, MESH, heavy=True),
    Case("stl: empty", file("000000.stl", ""), read_polygons, MESH),
    Case("scan: empty", file("scan.obj", ""), read_scan, "mesh"),
    Case("scan: NaN", changed("scan.ply", with_nan), read_scan, "no numbers"),
    Case("scan: face beyond", changed("scan.obj", beyond), read_scan),
    Case("scan: truncated", lambda folder, rng: truncated(folder, rng), read_scan, MESH),
    Case("scan: one point", changed("scan.ply", one_point), read_scan, "area"),
    Case("scan: a folder", lambda folder, rng: sequence(fewer)(folder, rng), read_scan, "no such file"),
    Case("scan: binary of 4 10^9 vertices", file("scan.ply", BINARY_BOMB), read_scan, MESH, heavy=True),
    Case("scan: unreferenced vertices", changed("scan.obj", unreferenced), read_scan,
         right=lambda mesh: len(mesh.vertices_mm) == len(GOOD.vertices_mm)),
    Case("scan: not manifold", changed("scan.ply", non_manifold), read_scan,
         right=lambda mesh: len(mesh.triangles) >= len(GOOD.triangles)),
    Case("mesh: NaN is for its reader", changed("000000.ply", with_nan), sculpt, "not finite"),
    Case("mesh: other vertex count", changed("000000.obj", fewer), sculpt, "121 vertices"),
    Case("mesh: other order", changed("000000.ply", other_order), sculpt, "order"),
    Case("mesh: empty", file("000000.ply", ""), sculpt, MESH),
    Case("mesh: truncated", truncated, read_mesh, MESH),
    Case("mesh: a folder", lambda folder, rng: sequence(fewer)(folder, rng), sculpt, MESH),
    Case("sequence: other vertex count", sequence(fewer), two, "another topology", names="000001.ply"),
    Case("sequence: other triangles", sequence(other_order), two, "another topology", names="000001.ply"),
    Case("sequence: NaN costs its frame", sequence(with_nan), two,
         right=lambda found: list(found.lost) == [1] and len(found.frames) == 2),
    Case("archive: other shape", archive(vertices_mm=GOOD.vertices_mm), two, "vertices"),
    Case("archive: no triangles", archive(triangles=None), two, "triangles"),
    Case("archive: face beyond", archive(triangles=np.array([[0, 1, 999]])), two, "999"),
    Case("archive: words", archive(vertices_mm=np.full((2, 144, 3), "x")), two, "numbers"),
    Case("archive: triangles of fractions", archive(triangles=np.full((3, 3), 0.5)), two, "whole"),
    Case("archive: frames of another shape", archive(frames=np.zeros((2, 2))), two, "frames"),
    Case("archive: object arrays", archive(vertices_mm=np.array([{}, None], dtype=object)), two),
    Case("archive: all NaN", archive(vertices_mm=np.full((2, 144, 3), np.nan)), two, "finite"),
    Case("gltf: as it should be", gltf(), lambda path: read_tracked(path, [0], fps=25.0),
         right=lambda found: found.vertices_mm.shape == (1, 3, 3)),
    Case("gltf: 10^12 vertices", gltf(set_in("accessors", 0, "count", value=10**12)), two, "glTF",
         heavy=True),
    Case("gltf: face beyond", gltf(set_in("accessors", 0, "count", value=2)), two, "beyond"),
    Case("gltf: buffer outside of its folder", outside, two, "outside"),
    Case("gltf: no such accessor", gltf(set_in("meshes", 0, "primitives", 0, "indices", value=9)), two,
         "glTF"),
    Case("gltf: unknown type", gltf(set_in("accessors", 0, "type", value="VEC9")), two, "glTF"),
    Case("gltf: no list", gltf(set_in("nodes", value=7)), two, "glTF"),
    Case("gltf: a node in itself", gltf(itself), two, "glTF"),
    Case("gltf: a list", file("track.gltf", "[]"), two, "glTF"),
    Case("glb: cut", file("track.glb", b"glTF\2\0\0\0"), two, "glTF"),
    Case("usd: cut", file("track.usdc", b"PXR-USDC" + bytes(60)), two, "USD|usd"),
    Case("usd: text of nothing", file("track.usda", "#usda 1.0\n"), two),
    Case("abc: noise", file("track.abc", b"Ogawa" + bytes(60)), two, "Alembic|alembic"),
    Case("nothing", lambda folder, rng: folder / "track.npz", two, "no such file"),
]  # fmt: skip


@parametrized(CASES)
def test_mesh(case, seed, tmp_path):
    check(case, seed, tmp_path)
