"""Sets of landmarks, their places on a face model, and files and fits of other sets than 66 points."""

from __future__ import annotations

import numpy as np
import pytest

from vermilion.contours.landmark_rings import N_SAMPLES, LandmarkRings
from vermilion.faces import procedural
from vermilion.faces.contours import contour_halves
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.landmarks.choose import usable_kind
from vermilion.landmarks.detector import Landmarks, LandmarkTrack
from vermilion.landmarks.scheme import MIRROR
from vermilion.landmarks.sets import IBUG66, MEDIAPIPE478, SETS, set_of
from vermilion.storage.errors import InputError
from vermilion.tracking.identity.landmark_identity import TakeSample, fit_identity
from vermilion.tracking.landmark_fit.expression import fit_motion
from vermilion.tracking.landmark_fit.observation import LandmarkNoise, Observations, focal_px
from vermilion.tracking.landmark_fit.shape import LandmarkShape
from vermilion.tracking.places import LandmarkPlaces, register_places

NOISE = {"jaw": 0.05, "brows": 0.03, "nose": 0.02, "eyes": 0.015, "mouth": 0.015}
each_set = pytest.mark.parametrize("entry", SETS.values(), ids=SETS)


@pytest.fixture(scope="module")
def model():
    return procedural.tracker_model(3000, 3)


@pytest.fixture(scope="module")
def places(model):
    """Places of the 478 points on the model, by a shape that lies on it."""
    return register_places(model, MEDIAPIPE478, shape_on(model))[0]


def shape_on(model) -> np.ndarray:
    """(478, 3) mm: the lips along the model's contours, the shared points on its landmarks, the others on
    vertices of the face."""
    entry, rng = MEDIAPIPE478, np.random.default_rng(0)
    face = np.flatnonzero(model.regions["face"] & ~model.regions["mouth_inner"])
    shape = model.neutral_mm[rng.choice(face, entry.n_points)]
    for name, loop in (("inner", model.inner_contour), ("outer", model.outer_contour)):
        upper, lower = contour_halves(model.neutral_mm, model.landmarks, loop)
        for lip, path in (("upper", upper), ("lower", lower)):
            line = entry.lip_line(lip, name)
            share = np.linspace(0.05 * (name == "inner"), 1 - 0.05 * (name == "inner"), len(line))
            rows = share * (len(path) - 1)
            points = model.neutral_mm[path]
            shape[line] = np.stack(
                [np.interp(rows, np.arange(len(path)), axis) for axis in points.T], axis=1
            )
    shape[entry.ibug66] = model.neutral_mm[model.landmarks]
    return shape


@each_set
def test_groups_share_the_points_among_them(entry):
    points = np.concatenate(list(entry.groups.values()))
    assert sorted(points) == list(range(entry.n_points))


@each_set
def test_a_mirror_is_its_own_inverse_and_keeps_the_groups(entry):
    assert (entry.mirror[entry.mirror] == np.arange(entry.n_points)).all()
    for points in entry.groups.values():
        assert set(entry.mirror[points]) == set(points)
    assert (entry.mirror[entry.jaw] == entry.jaw[::-1]).all()
    assert (entry.mirror[entry.eye_corners] == entry.eye_corners[::-1]).all()


@each_set
@pytest.mark.parametrize("name", ["outer", "inner"])
def test_rings_run_from_the_right_corner_over_the_upper_lip_and_back(entry, name):
    ring = getattr(entry, f"lip_{name}")
    right, left = getattr(entry, f"{name}_corners")
    upper, lower = (entry.lip_line(lip, name) for lip in ("upper", "lower"))
    assert len(set(ring)) == len(ring) and set(ring) <= set(entry.mouth)
    assert (upper[[0, -1]] == [right, left]).all() and (lower[[0, -1]] == [right, left]).all()
    assert (np.concatenate([upper, lower[-2:0:-1]]) == ring).all()
    for line in (upper, lower):
        assert (entry.mirror[line] == line[::-1]).all()


def test_the_points_of_ibug66_are_those_of_the_mesh_in_an_image_and_its_mirror_image():
    ids = MEDIAPIPE478.ibug66
    assert (MEDIAPIPE478.mirror[ids][MIRROR] == ids).all()
    points = np.random.default_rng(0).normal(size=(2, 478, 2))
    assert (MEDIAPIPE478.interocular_px(points) == IBUG66.interocular_px(points[:, ids])).all()


@pytest.mark.parametrize("group", IBUG66.groups)
def test_a_dense_group_weighs_as_much_as_its_few_points(group):
    weights = [
        (entry.per_point(NOISE)[entry.groups[group]] ** -2.0).sum() for entry in SETS.values()
    ]
    assert weights[0] == pytest.approx(weights[1])


def test_an_unknown_set_is_named():
    with pytest.raises(InputError, match=r"set 'dlib5'.*ibug66, mediapipe478"):
        set_of("dlib5")


def test_places_of_ibug66_are_the_models_vertices(model):
    points = SurfacePoints.at_vertices(model.landmarks, model.triangles)
    places = LandmarkPlaces(IBUG66, points, model.triangles)
    assert (places.of(model.neutral_mm) == model.neutral_mm[model.landmarks]).all()
    plain, same = LandmarkShape.of(model), LandmarkShape.of(model, places=places)
    assert (plain.expressions_mm == same.expressions_mm).all()


def test_places_hit_shared_points_and_lie_where_the_shape_does(model):
    """Whatever its size and place, and if it is warped by some millimetres."""
    shape = shape_on(model)
    bent = shape + 3.0 * np.sin(shape / 60.0)
    places, moved = register_places(model, MEDIAPIPE478, 0.01 * bent + 5.0)
    found = places.of(model.neutral_mm)
    shared = np.linalg.norm(found[MEDIAPIPE478.ibug66] - shape[MEDIAPIPE478.ibug66], axis=1)
    assert shared.max() < 1e-9
    skin = MEDIAPIPE478.groups["skin"]
    off = np.linalg.norm(found[skin] - shape[skin], axis=1)
    assert np.median(off) < 0.5 and np.percentile(off, 90) < 2.0  # mm
    assert np.nanmedian(moved) < 0.5


def test_irises_have_no_place_and_infinite_deviation(model, places):
    irises = MEDIAPIPE478.groups["irises"]
    assert (~places.known[irises]).all() and np.delete(places.known, irises).all()
    sigma = LandmarkShape.of(model, places=places).sigma_mm(LandmarkNoise())
    assert (np.isinf(sigma) == ~places.known).all()


@pytest.mark.parametrize("lip", ["upper", "lower"])
@pytest.mark.parametrize("name", ["outer", "inner"])
def test_places_of_the_rings_follow_each_other_along_the_models_contour(model, places, lip, name):
    loop = model.outer_contour if name == "outer" else model.inner_contour
    upper, lower = contour_halves(model.neutral_mm, model.landmarks, loop)
    path = upper if lip == "upper" else lower
    points = places.of(model.neutral_mm)[MEDIAPIPE478.lip_line(lip, name)]
    start, end = model.neutral_mm[path[:-1]], model.neutral_mm[path[1:]]
    share = np.linspace(0, 1, 20)[None, :, None]
    dense = (start[:, None] + share * (end - start)[:, None]).reshape(-1, 3)
    distance = np.linalg.norm(dense[None] - points[:, None], axis=2)
    assert distance.min(axis=1).max() < 0.1  # mm
    assert (np.diff(distance.argmin(axis=1)) > 0).all()


def test_places_come_back_from_their_file(tmp_path, model, places):
    places.save(tmp_path / "places.npz")
    again = LandmarkPlaces.load(tmp_path / "places.npz")
    assert again.landmark_set is MEDIAPIPE478
    assert (again.of(model.neutral_mm) == places.of(model.neutral_mm)).all()


def dense_track(points: np.ndarray) -> LandmarkTrack:
    count = np.full(points.shape[1], 0.9)
    found = [Landmarks(p, count, True, MEDIAPIPE478, p[:, 0] * 0.1) for p in points]
    found[1] = Landmarks.none(MEDIAPIPE478)
    return LandmarkTrack.of(range(3, 3 + len(points)), found)


def test_files_hold_the_own_points_and_give_the_66(tmp_path):
    track = dense_track(np.random.default_rng(0).uniform(10, 90, (4, 478, 2)))
    track.save(tmp_path / "dense.npz")
    own, few = (LandmarkTrack.load(tmp_path / "dense.npz", s) for s in (None, IBUG66))
    assert own.landmark_set is MEDIAPIPE478 and few.landmark_set is IBUG66
    np.testing.assert_array_equal(own.points_px, track.points_px)
    np.testing.assert_allclose(own.depth_px, track.depth_px, rtol=1e-6)
    np.testing.assert_array_equal(few.points_px, own.points_px[:, MEDIAPIPE478.ibug66])
    assert few.valid.tolist() == [True, False, True, True]


def test_a_file_of_66_points_is_as_ever_and_has_no_478(tmp_path):
    found = Landmarks(np.ones((66, 2)), np.ones(66), True)
    LandmarkTrack.of([0], [found]).save(tmp_path / "few.npz")
    with np.load(tmp_path / "few.npz") as data:
        assert sorted(data.files) == ["confidence", "frames", "points_px", "valid"]
    with pytest.raises(InputError, match=r"few.npz.*set ibug66.*set mediapipe478"):
        LandmarkTrack.load(tmp_path / "few.npz", MEDIAPIPE478)


def test_rings_of_dense_landmarks_begin_at_the_right_corner():
    points = np.random.default_rng(0).uniform(10, 90, (2, 478, 2))
    angle = np.linspace(np.pi, 3 * np.pi, 20, endpoint=False)
    points[0, MEDIAPIPE478.lip_outer] = np.stack(
        [60 + 30 * np.cos(angle), 50 + 12 * np.sin(angle)], 1
    )
    rings = LandmarkRings(dense_track(points))
    outer, inner = rings(3)
    assert outer.shape == inner.shape == (N_SAMPLES, 2)
    np.testing.assert_allclose(outer[[0, N_SAMPLES // 2]], [[30, 50], [90, 50]], atol=0.01)
    assert outer[N_SAMPLES // 4, 1] < 40  # the upper lip comes first
    assert rings(4) is None and rings.frames == [3]


def test_pose_and_weights_come_from_478_points(model, places):
    """A face of known motion is tracked by the dense set as by the 66 points."""
    rng = np.random.default_rng(0)
    weights = rng.uniform(0.0, 0.4, (1, model.n_expressions))
    camera = pinhole(
        "c", 900.0, 640, 480, look_at(np.array([0, 0, 600.0]), np.zeros(3), np.array([0, 1.0, 0]))
    )
    shape = LandmarkShape.of(model, places=places)
    truth = shape.points(weights)
    pixels = np.stack([camera.project(points) for points in truth])
    track = LandmarkTrack(
        np.arange(1), pixels, np.ones(pixels.shape[:2]), np.ones(1, bool), MEDIAPIPE478
    )  # fmt: skip
    seen = Observations.of(track, camera)
    motion = fit_motion(shape, seen, focal_px(camera), 25.0)
    fitted = shape.points(motion.weights) @ np.swapaxes(motion.rotation, 1, 2)
    fitted = fitted + motion.translation_mm[:, None]
    again = np.stack([p[:, :2] / p[:, 2:] for p in fitted]) * focal_px(camera) + [320, 240]
    error = np.linalg.norm(again - pixels, axis=-1)[:, places.known]
    assert np.median(error) < 0.5 and motion.reprojection_px.max() < 1.0  # px
    person = fit_identity(
        model, [TakeSample("t", seen, focal_px(camera), True, np.zeros(1, bool))], places=places
    )
    assert person.landmark_offset_mm.shape == (478, 3) and person.reprojection_px < 1.0


@pytest.mark.parametrize(
    ("models", "training", "kind"), [("here", True, "onnx"), ("", True, "trained")]
)
def test_without_its_environment_mediapipe_gives_way(tmp_path, models, training, kind):
    models = str(tmp_path) if models else ""
    chosen, said = usable_kind("mediapipe", str(tmp_path / "none"), models, training)
    assert chosen == kind and "tools/setup_landmarks.sh" in said and f"({kind})" in said


def test_nothing_in_the_place_of_mediapipe_says_what_to_run_and_why(tmp_path):
    (tmp_path / "env.unavailable").write_text("no wheel for this platform\n")
    with pytest.raises(InputError, match=r"no wheel for this platform.*tools/setup_landmarks.sh"):
        usable_kind("mediapipe", str(tmp_path / "env"), "", False)
    assert usable_kind("onnx", str(tmp_path / "env"), "", False) == ("onnx", "")
