"""What the tests of the sketch page's server send: a visit, a sketch, a stroke."""

from tests.sketch_take import CAMERA
from tests.unit import guided_mouths as mouths

PORT = 8765
ADDRESS = f"http://127.0.0.1:{PORT}"
WIDTH, HEIGHT = mouths.IMAGE_PX
SKETCH = f"/api/sketch/{CAMERA}/2"
UPPER = [[250.0, 330.0], [320.0, 322.0], [390.0, 330.0]]


def sketch(frame=2, **changed):
    content = {
        "format": "vermilion sketch", "version": 1, "unit": "px", "camera": CAMERA, "frame": frame,
        "image_size_px": [WIDTH, HEIGHT],
        "curves": {"upper_inner": {"kind": "sure", "points": UPPER, "handles": UPPER}},
    }  # fmt: skip
    return content | changed


def curve(points, **more):
    return {"curves": {"upper_inner": {"kind": "sure", "points": points, **more}}}


def saved(take, frame=2):
    return sorted((take.labels / "sketches" / CAMERA).glob(f"{frame:06d}*"))


def drawn(take, frame):
    """What a careful person draws on a frame, as the page sends it."""
    curves = mouths.drawn(take.true_mm[frame], mouths.camera(CAMERA)).curves
    points = {name: c.points_px.tolist() for name, c in curves.items()}
    return sketch(frame, curves={n: {"kind": "sure", "points": p} for n, p in points.items()})
