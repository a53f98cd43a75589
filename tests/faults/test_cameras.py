"""Camera files with numbers that are no camera, or damaged."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.faults.case import Case, check, parametrized
from vermilion.capture.camera_files.read import read_given_cameras
from vermilion.geometry.camera import look_at, pinhole, write_cameras

SIZES = {"cam0": (640, 480), "cam1": (640, 480), "cam2": (640, 480)}


def rig():
    """Three good cameras round a face."""
    target, up = np.zeros(3), np.array([0.0, 1.0, 0.0])
    places = {"cam0": [-400.0, 0, 900], "cam1": [0.0, 50, 1000], "cam2": [400.0, 0, 900]}
    return {
        name: pinhole(name, 1500.0, 640, 480, look_at(np.array(place), target, up))
        for name, place in places.items()
    }


def read(path: Path):
    """The cameras of the folder that a file lies in."""
    folder = path if path.is_dir() else path.parent
    return read_given_cameras(folder, SIZES).cameras


# COLMAP's text


def colmap(change: Callable[[list[str], list[str]], None]):
    """A model in text; `change` edits the words of its second camera and of that one's image."""

    def make(folder, rng):
        write_cameras(folder / "cameras", rig())
        paths = [folder / "cameras" / f"{name}.txt" for name in ("cameras", "images")]
        lines = [path.read_text().splitlines() for path in paths]
        rows = [next(k for k, line in enumerate(text) if line.startswith("2 ")) for text in lines]
        words = [text[row].split() for text, row in zip(lines, rows, strict=True)]
        change(*words)
        for path, text, row, new in zip(paths, lines, rows, words, strict=True):
            text[row] = " ".join(new)
            path.write_text("\n".join(text) + "\n")
        return folder / "cameras"

    return make


def put(which: int, at: int, *values: str):
    """Replace words of the camera (0) or of the image (1), from `at` on."""

    def change(camera, image):
        (camera, image)[which][at : at + len(values)] = values

    return change


def lens(*values: str):
    return put(0, 4, *values)


def turn(*values: str):
    return put(1, 1, *values)


def place(*values: str):
    return put(1, 5, *values)


def shorter(camera, image):
    del camera[-1]


def without(name: str):
    def make(folder, rng):
        write_cameras(folder / "cameras", rig())
        (folder / "cameras" / name).unlink()
        return folder / "cameras"

    return make


def cut(name: str):
    def make(folder, rng):
        write_cameras(folder / "cameras", rig())
        path = folder / "cameras" / name
        lines = path.read_text().splitlines()
        path.write_text("\n".join([*lines[:-2], lines[-2][: int(rng.integers(8, 30))]]))
        return path.parent

    return make


def as_saved(change: Callable[[bytes], bytes]):
    """A good model as another editor saves it."""

    def make(folder, rng):
        write_cameras(folder / "cameras", rig())
        for path in (folder / "cameras").iterdir():
            path.write_bytes(change(path.read_bytes()))
        return folder / "cameras"

    return make


def file(name: str, data: bytes | str):
    def make(folder, rng):
        path = folder / "cameras" / name
        path.parent.mkdir()
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        return path

    return make


def nothing(folder, rng):
    (folder / "cameras").mkdir()
    return folder / "cameras"


# JSON, OpenCV, Metashape, KRT, USD


def as_json(change: Callable[[dict], None] | None = None):
    def make(folder, rng):
        entries = {
            name: {"K": camera.calibration.tolist(), "RT": camera.cam_from_world.tolist()}
            for name, camera in rig().items()
        }
        if change:
            change(entries["cam1"])
        path = folder / "cameras" / "rig.json"
        path.parent.mkdir()
        path.write_text(json.dumps({"cameras": entries}))
        return path

    return make


def entry(key: str, row: int, column: int, value: float):
    def change(camera):
        camera[key][row][column] = value

    return change


def mirrored(camera):
    camera["RT"] = (np.diag([-1.0, 1, 1]) @ np.array(camera["RT"])).tolist()


def singular_matrix(camera):
    camera["K"][1] = [0.0, 0.0, 0.0]


def singular_pose(camera):
    camera["RT"][2] = camera["RT"][1]


def no_pose(camera):
    del camera["RT"]


def ragged(camera):
    camera["RT"][1] = camera["RT"][1][:2]


def words(camera):
    camera["K"] = "a matrix"


def a_list(camera):
    camera["K"] = {"fx": 1500.0}


OPENCV = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
   {{rows: 3, cols: 3, dt: d, data: [{focal}, 0., 320., 0., 1500., 240., 0., 0., 1.]}}
R: !!opencv-matrix
   {{rows: 3, cols: 3, dt: d, data: [{turn}, 0., 0., 0., 1., 0., 0., 0., 1.]}}
T: !!opencv-matrix
   {{rows: 3, cols: 1, dt: d, data: [0., 0., 900.]}}
"""


def opencv(focal="1500.", turned="1.", until=None):
    return file("cam0.yml", OPENCV.format(focal=focal, turn=turned).partition(until or "#")[0])


METASHAPE = """<?xml version="1.0"?>
<document><chunk><sensors><sensor id="0"><resolution width="640" height="480"/>
<calibration class="adjusted"><resolution width="640" height="480"/><f>{focal}</f></calibration>
</sensor></sensors><cameras><camera id="0" sensor_id="0" label="cam0"><transform>{pose}</transform>
</camera></cameras></chunk></document>
"""
BOMB = (
    '<?xml version="1.0"?><!DOCTYPE d [<!ENTITY a "aaaaaaaaaaaaaaaa">'
    + "".join(
        f'<!ENTITY {new} "{f"&{old};" * 40}">'
        for old, new in zip("abcdefg", "bcdefgh", strict=True)
    )
    + "]><document><chunk>&h;</chunk></document>"
)


def metashape(focal="1500", pose="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"):
    return file("rig.xml", METASHAPE.format(focal=focal, pose=pose))


def usd(focal: float):
    def make(folder, rng):
        from pxr import Usd, UsdGeom

        path = folder / "cameras" / "rig.usda"
        path.parent.mkdir()
        stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.Camera.Define(stage, "/cam0").GetFocalLengthAttr().Set(focal)
        stage.Save()
        return path

    return make


NUMBERS, ROTATION = "finite", "no rotation"
CASES = [
    Case("colmap: focal NaN", colmap(lens("nan")), read, "line 3: 'nan'"),
    Case("colmap: focal 0", colmap(lens("0")), read, "cam1.*focal"),
    Case("colmap: focal negative", colmap(lens("-1500")), read, "cam1.*focal"),
    Case("colmap: principal point infinite", colmap(lens("1500", "1500", "inf")), read,
         "line 3: 'inf'"),
    Case("colmap: place NaN", colmap(place("nan")), read, "line 4: 'nan'"),
    Case("colmap: place infinite", colmap(place("inf")), read, "line 4: 'inf'"),
    Case("colmap: turn NaN", colmap(turn("nan")), read, "line 4: 'nan'"),
    Case("colmap: turn 0", colmap(turn("0", "0", "0", "0")), read, "cam1.*(rotation|finite)"),
    Case("colmap: words", colmap(lens("wide")), read, "COLMAP"),
    Case("colmap: fewer parameters", colmap(shorter), read, "COLMAP"),
    Case("colmap: unknown model", colmap(put(0, 1, "EYE")), read, "COLMAP"),
    Case("colmap: no width", colmap(put(0, 2, "0")), read, "cam1.*size"),
    Case("colmap: image of no camera", colmap(put(1, 8, "77")), read, "COLMAP"),
    Case("colmap: no cameras.txt", without("cameras.txt"), read, "cameras"),
    Case("colmap: no images.txt", without("images.txt"), read, "images"),
    Case("colmap: cut", cut("images.txt"), read, "COLMAP|images"),
    *(Case(f"colmap: {name}", as_saved(change), read, right=lambda cameras: list(cameras) == list(SIZES))
      for name, change in (("byte order mark", lambda data: b"\xef\xbb\xbf" + data),
                           ("CRLF", lambda data: data.replace(b"\n", b"\r\n")))),
    Case("colmap: empty", file("cameras.txt", ""), read),
    Case("colmap: binary of noise", file("cameras.bin", b"\xff" * 200), read),
    Case("no file", nothing, read, "empty"),
    Case("json: focal NaN", as_json(entry("K", 0, 0, np.nan)), read, "cam1.*(focal|finite)"),
    Case("json: focal 0", as_json(entry("K", 0, 0, 0.0)), read, "cam1.*focal"),
    Case("json: singular matrix", as_json(singular_matrix), read, "cam1.*focal"),
    Case("json: mirrored", as_json(mirrored), read, "cam1.*rotation"),
    Case("json: singular pose", as_json(singular_pose), read, "cam1.*rotation"),
    Case("json: place NaN", as_json(entry("RT", 0, 3, np.nan)), read, "cam1.*finite"),
    Case("json: no pose", as_json(no_pose), read, "pose"),
    Case("json: ragged", as_json(ragged), read, "cameras that cannot be read"),
    Case("json: words", as_json(words), read, "cameras that cannot be read"),
    Case("json: other type", as_json(a_list), read, "cameras that cannot be read"),
    Case("json: a list of numbers", file("rig.json", "[1, 2, 3]"), read, "cameras that cannot be read"),
    Case("json: deeply nested", file("rig.json", "[" * 100_000), read, "cameras that cannot be read"),
    Case("json: not text", file("rig.json", b"\xff\xfe\x00{}"), read, "cameras that cannot be read"),
    Case("json: byte order mark", lambda folder, rng: _marked(as_json()(folder, rng)), read,
         right=lambda cameras: list(cameras) == list(SIZES)),
    Case("opencv: focal 0", opencv(focal="0."), read, "cam0.*focal"),
    Case("opencv: mirrored", opencv(turned="-1."), read, "cam0.*rotation"),
    Case("opencv: NaN", opencv(focal=".NaN"), read, "cam0.*(focal|finite)"),
    Case("opencv: cut", opencv(until="3, dt"), read),
    Case("opencv: no pose", opencv(until="R:"), read, "lacks R, T"),
    Case("opencv: empty", file("cam0.yml", ""), read),
    Case("metashape: focal 0", metashape(focal="0"), read, "cam0.*focal"),
    Case("metashape: mirrored", metashape(pose="-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"), read, "rotation"),
    Case("metashape: words", metashape(pose="left"), read, "cameras that cannot be read|Metashape"),
    Case("metashape: entities that multiply", file("rig.xml", BOMB), read, heavy=True),
    Case("metashape: cut", file("rig.xml", METASHAPE[:200]), read),
    Case("krt: short", file("KRT", "cam0\n1500 0 320\n0 1500 240\n"), read, "KRT"),
    Case("usd: focal 0", usd(0.0), read, "cam0.*focal"),
    Case("usd: cut", file("rig.usdc", b"PXR-USDC" + bytes(40)), read, "cameras that cannot be read"),
    Case("unknown kind", file("rig.txt", "cameras"), read, "no file of cameras"),
]  # fmt: skip


def _marked(path: Path) -> Path:
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    return path


@parametrized(CASES)
def test_camera(case, seed, tmp_path):
    check(case, seed, tmp_path)
