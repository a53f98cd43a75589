"""The studio on a tiny take: known facts of its images, labels and truth."""

import json

import cv2
import numpy as np
import pytest

from vermilion.faces.procedural import studio_model
from vermilion.geometry.camera import read_cameras, write_cameras
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import read_image
from vermilion.storage.files import sha256_of
from vermilion.storage.sequences import read_sequence
from vermilion.studio.capture_writer import (
    image_path,
    label_path,
    write_images,
    write_labels,
    write_truth,
)
from vermilion.studio.label_frames import label_frames
from vermilion.studio.labels import lip_contours, view_mouth
from vermilion.studio.render import render
from vermilion.studio.rig import MULTIVIEW_CAMERAS, RigSettings
from vermilion.studio.surface import surface_of
from vermilion.studio.take import cameras_of, plan_take
from vermilion.studio.take_settings import take_settings

SIZES = RigSettings(
    MULTIVIEW_CAMERAS, 735.0, (200, 200), (240, 200), (240, 200), 245.0, 105.0, 250.0
)
RAYS = {"occlusion_directions": 32, "light_samples": 2}


@pytest.fixture(scope="module")
def model():
    return studio_model(spacing_mm=2.4)


@pytest.fixture(scope="module")
def surface(model):
    return surface_of(model)


def plan(model, role="tattoo", last=11, seed=3, performance="generated", lights="rig"):
    values = {
        "role": role,
        "first": 0,
        "last": last,
        "fps": 30.0,
        "actor": {"seed": 7, "identity": None},
        "performance": {
            "performance": performance,
            "seed": seed,
            "poses": 0,
            "pose_seconds": (0.22, 0.42),
            "csv": None,
            "csv_first": 0,
            "csv_fps": 30.0,
            "mirrored": False,
            "gain": 1.0,
            "lights": lights,
        },
        "identity_spread": 0.7,
        "expression_spread": 0.0,
        "seed": 0,
        "slight_open": 0.08,
        "ease_in_frames": 6,
        "intensity": 1.0,
        "head_turn_deg": 2.5,
        "head_shift_mm": 2.0,
    }
    return plan_take(model, take_settings(values))


@pytest.fixture(scope="module")
def rom(model):
    return plan(model)


@pytest.fixture(scope="module")
def cameras(rom):
    return cameras_of(rom, "tattoo", SIZES)


def images(take, surface, cameras, index=0):
    return render(take.scene(index, surface, **RAYS), take.vertices_mm(index), cameras)


def open_mouth(model, weight):
    weights = np.zeros(model.n_expressions)
    weights[model.expression_names.index("jawOpen")] = weight
    return model.vertices(None, weights)


def test_the_first_frame_is_the_neutral_with_the_mouth_slightly_open(model, rom):
    weights = dict(zip(rom.performance.names, rom.performance.weights[0], strict=True))
    assert weights.pop("jawOpen") == pytest.approx(0.08)
    assert not any(weights.values())
    opening = model.expressions_mm[model.expression_names.index("jawOpen")]
    assert np.abs(rom.vertices_mm(0) - rom.neutral_mm() - 0.08 * opening).max() < 1e-6  # mm


def test_no_image_depends_on_the_other_cameras_or_their_order(rom, surface, cameras):
    pair = {name: cameras[name] for name in ("face2", "lip0")}
    both = images(rom, surface, pair)
    turned = images(rom, surface, dict(reversed(pair.items())))
    alone = images(rom, surface, {"lip0": cameras["lip0"]})
    for name in pair:
        assert np.array_equal(both[name], turned[name])
    assert np.array_equal(both["lip0"], alone["lip0"])


def test_the_tattoo_changes_vermilion_pixels_alone(model, surface, rom, cameras):
    bare = plan(model, role="plain")
    for name in ("face2", "lip0", "lip2"):
        one = {name: cameras[name]}
        painted, skin = (images(take, surface, one)[name] for take in (rom, bare))
        changed = np.abs(painted - skin).max(axis=2) > 1e-3
        hits = RayCaster(rom.vertices_mm(0), model.triangles).see(cameras[name])
        red = surface.lip_mm[model.triangles[np.maximum(hits.triangle, 0)]].max(axis=-1) > 0
        red = cv2.dilate((red & hits.hit).astype(np.uint8), np.ones((3, 3))) > 0
        assert changed.sum() > 100
        assert not (changed & ~red).any()


def test_paint_ends_where_the_labelled_contour_runs(model, surface, rom, cameras):
    """The image and the label agree: within a pixel in the mean, with a label of its own path."""
    camera = cameras["lip2"]
    bare = plan(model, role="plain")
    painted, skin = (images(take, surface, {"x": camera})["x"] for take in (rom, bare))
    changed = (np.abs(painted - skin).max(axis=2) > 0.02).astype(np.uint8)
    loops, _ = cv2.findContours(changed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    edge = np.concatenate([loop[:, 0] for loop in loops]) + 0.5
    label = lip_contours(model, surface, rom.vertices_mm(0), camera)["outer"]
    loop = label.astype(np.float32).reshape(-1, 1, 2)
    depth = np.array([cv2.pointPolygonTest(loop, tuple(map(float, p)), True) for p in edge])
    outline = np.abs(depth)[np.abs(depth) < 6]
    assert len(outline) > 0.5 * len(edge)
    assert outline.mean() < 1.5  # px of 0.5 mm: the paint fades over its last 0.45 mm
    assert depth.min() > -1.0  # px: nothing painted outside


def test_projected_truth_lands_on_the_surface_that_the_image_shows(model, surface, rom, cameras):
    """A visible vertex of the vermilion border projects to within a pixel of the red region."""
    camera, vertices = cameras["face2"], rom.vertices_mm(5)
    caster = RayCaster(vertices, model.triangles)
    border = vertices[model.outer_contour]
    seen = caster.visible(camera, border, tolerance_mm=0.5)
    view = view_mouth(model, surface, vertices, camera)
    loops, _ = cv2.findContours(view.red.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    edge = np.concatenate([loop[:, 0] for loop in loops]) + 0.5
    edge = view.to_pixels(edge[:, 0], edge[:, 1])
    distance = np.linalg.norm(camera.project(border[seen])[:, None] - edge, axis=2).min(axis=1)
    assert seen.mean() > 0.7
    assert np.median(distance) < 0.5  # px of 1.2 mm
    assert distance.max() < 2.0


def test_the_inner_label_has_the_height_of_the_opening(model, surface, cameras):
    camera = cameras["face2"]
    middle = model.landmarks[[60, 64]]  # middle of the inner loop, upper and lower
    for weight in (0.3, 0.7):
        vertices = open_mouth(model, weight)
        inner = lip_contours(model, surface, vertices, camera)["inner"]
        ends = camera.project(vertices[middle])
        near = np.abs(inner[:, 0] - ends[:, 0].mean()) < 2.0
        gap = np.ptp(inner[near, 1])
        assert gap == pytest.approx(np.ptp(ends[:, 1]), abs=1.5)  # px


def test_the_inner_label_of_closed_lips_is_a_line(model, surface, cameras):
    vertices = open_mouth(model, 0.0)
    inner = lip_contours(model, surface, vertices, cameras["face2"])["inner"]
    area = cv2.contourArea(inner.astype(np.float32))
    assert area / np.ptp(inner[:, 0]) < 1.0  # px of mean height


@pytest.mark.slow
def test_same_seed_same_bytes_whatever_the_chunk(rom, cameras, tmp_path):
    one = {name: cameras[name] for name in ("face2", "lip1")}
    noise = {"name": "s/rom", "seed": 4, "noise_read": 0.001, "noise_shot": 3e-5}
    write_images(rom, one, tmp_path / "a", [0, 1], 0, **noise, **RAYS)
    write_images(rom, one, tmp_path / "b", [1], 0, **noise, **RAYS)
    for name in one:
        first = sha256_of(image_path(tmp_path / "a", name, 1))
        assert first == sha256_of(image_path(tmp_path / "b", name, 1))
        assert first != sha256_of(image_path(tmp_path / "a", name, 0))
    other = noise | {"seed": 5}
    write_images(rom, one, tmp_path / "c", [1], 0, **other, **RAYS)
    assert first != sha256_of(image_path(tmp_path / "c", "lip1", 1))


def test_images_are_neither_black_nor_burnt_out(rom, cameras, tmp_path):
    noise = {"name": "s/rom", "seed": 4, "noise_read": 0.001, "noise_shot": 3e-5}
    write_images(rom, {"face2": cameras["face2"]}, tmp_path, [0], 0, **noise, **RAYS)
    image = read_image(image_path(tmp_path, "face2", 0))
    middle = image[60:140, 60:140]
    assert 0.08 < middle.mean() < 0.6  # linear
    assert (image >= 0.999).any(axis=2).mean() < 0.02


def test_the_capture_folder_is_what_a_rig_gives(model, rom, cameras, tmp_path):
    write_cameras(tmp_path / "cameras", cameras)
    write_labels(rom, cameras, tmp_path, 0, [["face2", 0], ["face2", 6]], [["face2", 0]])
    assert set(read_cameras(tmp_path / "cameras")) == set(cameras)
    label = json.loads(label_path(tmp_path, "contours", "face2", 6).read_text())
    assert label["unit"] == "px" and label["image"] == "frames/face2/000006.png"
    for name in ("outer", "inner"):
        assert label[name]["closed"] and np.array(label[name]["points"]).shape[1] == 2
    points = json.loads(label_path(tmp_path, "landmarks", "face2", 0).read_text())["points"]
    expected = cameras["face2"].project(rom.vertices_mm(0)[model.landmarks])
    assert np.abs(np.array(points) - expected).max() < 0.01  # px


def test_truth_has_the_form_of_the_sample_captures(model, rom, tmp_path):
    write_truth(rom, tmp_path)
    vertices = read_sequence(tmp_path / "vertices_mm.npy")
    assert vertices.shape == (12, model.n_vertices, 3) and vertices.dtype == np.float32
    triangles = np.load(tmp_path / "triangles.npy")
    assert not model.regions["teeth"][triangles].any()
    weights = json.loads((tmp_path / "weights.json").read_text())
    assert len(weights) == 12 and weights[0]["jawOpen"] == pytest.approx(0.08)
    assert np.load(tmp_path / "neutral_mm.npy").shape == (model.n_vertices, 3)


def test_people_differ_from_frame_to_frame(model, surface):
    crowd = plan(model, role="video", last=3, performance="people")
    assert len(np.unique(crowd.identities[:, 0])) == 4
    cameras = cameras_of(crowd, "video", SIZES)
    shown = [images(crowd, surface, cameras, index=i)["cam"] for i in range(2)]
    assert np.abs(shown[0] - shown[1]).mean() > 0.02
    for index in range(4):
        points = cameras["cam"].project(crowd.vertices_mm(index)[model.landmarks])
        assert cameras["cam"].in_image(points).mean() > 0.9


def test_label_frames_begin_with_the_neutral_and_spread():
    assert label_frames(0, 46, 6) == [0, 8, 15, 23, 31, 38]
    assert label_frames(5, 5, 6) == [5]
    assert label_frames(0, 10, 0) == []
