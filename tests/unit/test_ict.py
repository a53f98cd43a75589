"""ICT-FaceKit as Vermilion's three models (needs the optional data)."""

import numpy as np
import pytest

from vermilion.faces import ict
from vermilion.faces.contours import INNER_LOOP, LEFT_CORNER, OUTER_LOOP, RIGHT_CORNER
from vermilion.faces.ict_archive import check_archive, read_ict
from vermilion.geometry.mesh import boundary_edges, triangle_areas, unique_edges
from vermilion.storage.errors import InputError

pytestmark = [pytest.mark.data, pytest.mark.slow]


@pytest.fixture(scope="module")
def data(data_root):
    return read_ict(data_root / "ict-facekit" / "FaceXModel.tar.xz", n_identities=4)


@pytest.fixture(scope="module")
def studio(data):
    return ict.studio_model(data)


@pytest.fixture(scope="module")
def tracker(data):
    return ict.tracker_model(data, n_triangles=5000)


def edges_of(triangles):
    return {tuple(edge) for edge in unique_edges(triangles).tolist()}


def loop_edges(loop):
    pairs = np.stack([loop, np.roll(loop, -1)], axis=1)
    return {tuple(sorted(pair)) for pair in pairs.tolist()}


def test_head_is_in_millimetres_x_to_the_subjects_left(studio):
    jaw = studio.neutral_mm[studio.landmarks[[0, 16]]]
    assert 120 < np.ptp(jaw[:, 0]) < 180  # mm between the ears
    assert jaw[0, 0] < 0 < jaw[1, 0]
    nose, brow, chin = studio.neutral_mm[studio.landmarks[[30, 27, 8]]]
    assert brow[1] > nose[1] > chin[1]
    assert nose[2] > jaw[:, 2].max()


def test_vertices_keep_the_order_of_the_sample_captures_truth(studio, data_root):
    truth = np.load(data_root / "capture-sample-truth/p1/rom/triangles.npy")
    known = edges_of(truth)
    skin = studio.triangles[(studio.triangles < 14062).all(axis=1)]
    assert len(skin) == len(truth)
    # A quad may be split along its other diagonal; its four sides are the same.
    assert len(edges_of(skin) & known) > 0.8 * len(known)


def test_triangles_face_outward(studio):
    face = studio.regions["face"][studio.triangles].all(axis=1)
    a, b, c = (studio.neutral_mm[studio.triangles[face, k]] for k in range(3))
    outward = np.cross(b - a, c - a)
    assert (outward[:, 2] > 0).mean() > 0.8


@pytest.mark.parametrize("part", ["studio", "tracker"])
def test_contours_are_simple_loops_of_edges(part, request):
    model = request.getfixturevalue(part)
    edges = edges_of(model.triangles)
    for loop in (model.outer_contour, model.inner_contour):
        assert len(set(loop.tolist())) == len(loop)
        assert loop_edges(loop) <= edges


def test_outer_contour_passes_the_lip_landmarks_and_encloses_the_inner(studio):
    lips = studio.landmarks[list(OUTER_LOOP)]
    assert set(lips.tolist()) <= set(studio.outer_contour.tolist())
    outer = studio.neutral_mm[studio.outer_contour]
    inner = studio.neutral_mm[studio.inner_contour]
    assert outer[:, 0].min() < inner[:, 0].min() < inner[:, 0].max() < outer[:, 0].max()
    assert outer[:, 1].min() < inner[:, 1].min() < inner[:, 1].max() < outer[:, 1].max()
    middle = studio.landmarks[list(INNER_LOOP)][2]
    assert middle in studio.inner_contour


def test_upper_and_lower_vermilion_lie_on_their_sides(studio):
    upper = studio.neutral_mm[studio.regions["vermilion_upper"]]
    lower = studio.neutral_mm[studio.regions["vermilion_lower"]]
    corners_y = studio.neutral_mm[studio.landmarks[[RIGHT_CORNER, LEFT_CORNER]], 1].mean()
    assert upper[:, 1].mean() > corners_y > lower[:, 1].mean()
    assert not (studio.regions["vermilion_upper"] & studio.regions["vermilion_lower"]).any()


def test_jaw_opening_parts_the_lips_of_every_part(studio, tracker):
    for model in (studio, tracker):
        weights = np.zeros(model.n_expressions)
        weights[model.expression_names.index("jawOpen")] = 1.0
        moved = model.vertices(None, weights) - model.neutral_mm
        corners = model.neutral_mm[model.landmarks[[RIGHT_CORNER, LEFT_CORNER]], 0]
        middle = np.abs(model.neutral_mm[:, 0]) < 0.4 * np.abs(corners).max()
        upper = moved[model.regions["vermilion_upper"] & middle]
        lower = moved[model.regions["vermilion_lower"] & middle]
        assert np.abs(upper[:, 1]).max() < 6.0  # mm: no upper vertex bound to the lower lip
        assert lower[:, 1].max() < -8.0  # mm: no lower vertex bound to the upper lip


def test_template_has_the_inner_fold_and_no_expressions(data):
    template = ict.template_model(data, slight_open=0.08)
    assert template.n_expressions == 0
    assert template.regions["mouth_inner"].sum() > 200
    assert (triangle_areas(template.neutral_mm, template.triangles) > 0).all()
    assert not template.regions["teeth"].any()
    assert len(boundary_edges(template.triangles)) < 0.1 * len(template.triangles)
    assert template.uv.min() >= 0 and template.uv.max() <= 1


def test_tracker_is_coarser_and_may_be_refused_rolls(data, studio, tracker):
    assert abs(len(tracker.triangles) - 5000) < 50
    assert tracker.expression_names == studio.expression_names
    forbidden = ("Roll", "Press", "Funnel", "Shrug")
    assert not [n for n in ict.FEW_EXPRESSIONS if any(f in n for f in forbidden)]
    assert set(ict.FEW_EXPRESSIONS) < set(data.expression_names)
    assert len(set(tracker.landmarks.tolist())) == 66


def test_tracker_lies_on_the_face_that_it_was_made_from(data, tracker):
    from scipy.spatial import cKDTree

    crop = ict.face_crop(ict.studio_model(data), 0.09, with_expressions=False)
    distance, _ = cKDTree(crop.neutral_mm).query(tracker.neutral_mm)
    assert np.percentile(distance, 95) < 2.5  # mm, within the spacing of the original
    ends = np.linalg.norm(
        tracker.neutral_mm[tracker.landmarks] - crop.neutral_mm[crop.landmarks], axis=1
    )
    assert ends.max() < 1e-4  # mm: landmarks are carried exactly


def test_tracker_is_the_same_every_time(data, tracker):
    again = ict.tracker_model(data, n_triangles=5000)
    assert np.array_equal(again.triangles, tracker.triangles)
    assert np.array_equal(again.neutral_mm, tracker.neutral_mm)


def test_a_wrong_archive_is_named(tmp_path):
    wrong = tmp_path / "model.tar.xz"
    wrong.write_bytes(b"nothing")
    with pytest.raises(InputError, match="SHA-256"):
        check_archive(wrong, "0" * 64)
    with pytest.raises(InputError, match="unreadable archive"):
        read_ict(wrong)
    with pytest.raises(InputError, match=r"vertex_indices\.json"):
        read_ict(tmp_path)
