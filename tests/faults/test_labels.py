"""Labels and sketches that a person or a program drew wrongly."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.faults.case import Case, check, parametrized
from vermilion.contours.labels import check_contour_label as check_contours
from vermilion.contours.labels import read_contour_label as read_contours
from vermilion.geometry.camera import pinhole
from vermilion.guided.inputs import read_sketch_views
from vermilion.landmarks.labels import labels_by_frame, read_landmark_label

SIZE = (640, 480)
CAMERAS = {"face2": pinhole("face2", 900.0, *SIZE), "face3": pinhole("face3", 900.0, *SIZE)}


def ring(radius: float) -> list[list[float]]:
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    points = np.stack([320 + 2 * radius * np.cos(turn), 300 + radius * np.sin(turn)], axis=1)
    return points.round(2).tolist()


def contours() -> dict:
    return {
        "unit": "px",
        "image": "frames/face2/000010.jpg",
        "outer": {"closed": True, "points": ring(30)},
        "inner": {"closed": True, "points": ring(12)},
    }


def landmarks() -> dict:
    points = np.random.default_rng(0).uniform(100, 400, (66, 2)).round(1).tolist()
    return {"unit": "px", "image": "frames/face2/000010.jpg", "points": points}


def sketch() -> dict:
    curve = [[280.0 + 8 * k, 300.0 + 0.5 * (k - 5) ** 2] for k in range(11)]
    return {
        "format": "vermilion sketch",
        "version": 1,
        "unit": "px",
        "camera": "face2",
        "frame": 10,
        "image_size_px": list(SIZE),
        "curves": {"upper_inner": {"kind": "sure", "points": curve}},
    }


# Readers, as the workflow calls them


def contour_label(path: Path):
    label = read_contours(path, subject="s1", take="rom")
    check_contours(label, SIZE, path, subject="s1", take="rom")
    return label


def landmark_label(path: Path):
    return labels_by_frame([path], SIZE, subject="s1", take="rom")


def sketch_view(path: Path):
    return read_sketch_views([path], CAMERAS, 10)


KINDS = {
    "contour": ("contours", contours, contour_label),
    "landmarks": ("landmarks", landmarks, landmark_label),
    "sketch": ("sketches", sketch, sketch_view),
}


def drawn(kind: str, what: str, change=None, says="", raw=None, **options):
    """A label of which `change` edits the content, or whose bytes are `raw` of the good ones."""
    folder_name, content_of, read = KINDS[kind]

    def make(folder, rng):
        path = folder / "labels" / folder_name / "face2" / "000010.json"
        path.parent.mkdir(parents=True)
        content = content_of()
        if change:
            content = change(content, rng) or content
        data = json.dumps(content).encode()
        path.write_bytes(raw(data, rng) if raw else data)
        return path

    return Case(f"{kind}: {what}", make, read, says, **options)


def put(*keys, value):
    def change(content, rng):
        place = content
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value

    return change


def drop(*keys):
    def change(content, rng):
        place = content
        for key in keys[:-1]:
            place = place[key]
        del place[keys[-1]]

    return change


def point(*keys, value):
    """Another value for one of the points, which one by chance."""

    def change(content, rng):
        points = content
        for key in keys:
            points = points[key]
        points[int(rng.integers(len(points)))] = value

    return change


def scaled(*keys):
    """Drawn on the same image at four times the size."""

    def change(content, rng):
        place = content
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = (4 * np.array(place[keys[-1]])).tolist()

    return change


def crossing(content, rng):
    points = content["curves"]["upper_inner"]["points"]
    points[2], points[7] = points[7], points[2]


def cut(data, rng):
    return data[: int(rng.integers(5, len(data) - 2))]


def marked(data, rng):
    return b"\xef\xbb\xbf" + data


def crlf(data, rng):
    return json.dumps(json.loads(data), indent=1).replace("\n", "\r\n").encode()


DEEP = b"[" * 200_000
OUTER, INNER = ("outer", "points"), ("inner", "points")
CURVE = ("curves", "upper_inner", "points")
CASES = [
    *(drawn(kind, what, says=says, raw=raw) for kind, says in
      (("contour", "unusable contour label"), ("landmarks", "unreadable landmark"), ("sketch", "JSON|object"))
      for what, raw in (("cut", cut), ("empty", lambda data, rng: b""), ("deeply nested", lambda data, rng: DEEP),
                        ("not text", lambda data, rng: b"\xff\xd8" + data),
                        ("a list", lambda data, rng: b"[1, 2]"))),
    drawn("contour", "NaN", point(*OUTER, value=[float("nan"), 1.0]), "outer: a point that is not finite"),
    drawn("contour", "a word", point(*INNER, value=["left", 1]), "inner: a point"),
    drawn("contour", "three numbers", point(*INNER, value=[1, 2, 3]), "inner"),
    drawn("contour", "a truth value", point(*INNER, value=[True, 2]), "inner"),
    drawn("contour", "a number of 400 digits", point(*INNER, value=[10**400, 2]), "unusable|outside"),
    drawn("contour", "points as text", put(*OUTER, value="12 13"), "outer: points that are a str"),
    drawn("contour", "one point", put(*OUTER, value=[[5, 5]]), "outer: 1 point"),
    drawn("contour", "no inner", drop("inner"), "no contour 'inner'"),
    drawn("contour", "closed as text", put("outer", "closed", value="no"), "closed is 'no'"),
    drawn("contour", "millimetres", put("unit", value="mm"), "unit 'mm'"),
    drawn("contour", "outside of the image", scaled(*OUTER), "outside of the image"),
    drawn("contour", "one point outside", point(*OUTER, value=[-40, 300]), "1 of 24 points outside"),
    drawn("contour", "of another frame", put("image", value="frames/face2/000011.jpg"), "000011"),
    drawn("contour", "of another camera", put("image", value="frames/face3/000010.jpg"), "face3"),
    drawn("contour", "image as a number", put("image", value=10), "image"),
    drawn("contour", "byte order mark", raw=marked, right=lambda label: len(label.outer.points_px) == 24),
    drawn("contour", "CRLF", raw=crlf, right=lambda label: len(label.outer.points_px) == 24),
    drawn("landmarks", "65 points", drop("points", 3), "66"),
    drawn("landmarks", "NaN", point("points", value=[float("nan"), 3]), "not finite"),
    drawn("landmarks", "infinite", point("points", value=[float("inf"), 3]), "not finite"),
    drawn("landmarks", "no points", drop("points"), "points"),
    drawn("landmarks", "a word", point("points", value="nose"), "pair of numbers"),
    drawn("landmarks", "outside of the image", scaled("points"), "outside of the image"),
    drawn("landmarks", "of another camera", put("image", value="frames/face3/000010.jpg"), "face3"),
    drawn("landmarks", "byte order mark", raw=marked, right=lambda found: list(found) == [10]),
    drawn("sketch", "crossing itself", crossing, "crosses itself"),
    drawn("sketch", "NaN", point(*CURVE, value=[float("nan"), 3.0]), "not finite|is"),
    drawn("sketch", "outside of the image", point(*CURVE, value=[900.0, 300.0]), "900"),
    drawn("sketch", "a word", point(*CURVE, value=["left", 3]), "left"),
    drawn("sketch", "points as an object", put(*CURVE, value={"x": 1}), "object"),
    drawn("sketch", "no length", put(*CURVE, value=[[5.0, 5.0]] * 4), "all the same"),
    drawn("sketch", "10^5 points", put(*CURVE, value=[[5.0, 5.0]] * 100_000), "100000"),
    drawn("sketch", "a curve that is none", put("curves", value={"moustache": {}}), "moustache"),
    drawn("sketch", "no curves", put("curves", value={}), "curves"),
    drawn("sketch", "of another camera", put("camera", value="face3"), "face3"),
    drawn("sketch", "of another frame", put("frame", value=11), "frame 11"),
    drawn("sketch", "frame as text", put("frame", value="10"), "'10'"),
    drawn("sketch", "newer", put("version", value=9), "version 9"),
    drawn("sketch", "version NaN", put("version", value=float("nan")), "version"),
    drawn("sketch", "foreign", put("format", value="doodle"), "doodle"),
    drawn("sketch", "in millimetres", put("unit", value="mm"), "mm"),
    drawn("sketch", "a size of words", put("image_size_px", value=["wide", 2]), "size"),
    drawn("sketch", "byte order mark", raw=marked, right=lambda views: len(views) == 1),
]  # fmt: skip


@parametrized(CASES)
def test_label(case, seed, tmp_path):
    check(case, seed, tmp_path)


def test_a_label_named_by_no_number_is_refused(tmp_path):
    path = tmp_path / "first.json"
    path.write_text(json.dumps(landmarks()))
    check(
        Case("named", lambda folder, rng: path, read_landmark_label, "named by its frame"),
        1,
        tmp_path,
    )
