"""Errors of a sequence: known displacements give known figures."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tests import lip_patch
from tests.unit.evaluation_face import mouth_triangles, sheet_face
from vermilion.evaluation.errors import ClipSums, second_differences
from vermilion.evaluation.lips import LipTolerances, lip_depths
from vermilion.evaluation.masks import regions_of_mask
from vermilion.evaluation.measures import measure_rows
from vermilion.evaluation.reference import Reference
from vermilion.evaluation.take import evaluate_reconstruction, evaluate_take
from vermilion.evaluation.visible import cameras_that_see
from vermilion.faces.lips import lip_sides
from vermilion.geometry.camera import look_at, pinhole
from vermilion.geometry.closest_points import Surface
from vermilion.geometry.mesh import vertex_areas

FRAMES = np.arange(10, 16)


@pytest.fixture(scope="module")
def face():
    model = sheet_face()
    return model, regions_of_mask(model, model.neutral_mm, mouth_triangles(model))


def moving(model) -> np.ndarray:
    """Truth of six frames: the jaw opens and closes again."""
    opening = np.array([0.0, 2.0, 4.0, 3.0, 1.0, 0.0])
    below = (model.neutral_mm[:, 1] < -0.5) & (np.hypot(*model.neutral_mm[:, :2].T) < 25)
    below |= model.regions["vermilion_lower"]
    truth = np.repeat(model.neutral_mm[None], len(FRAMES), axis=0)
    truth[:, below, 1] -= opening[:, None]
    return truth


def turned(sequence: np.ndarray, degrees: float, shift) -> np.ndarray:
    angle = np.radians(degrees)
    rotation = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    return sequence @ rotation.T + shift


def evaluate(model, regions, sequences, truth):
    reference = Reference("truth", truth, truth, model.triangles)
    result = evaluate_take(sequences, FRAMES, model, regions, reference, 2, 1, LipTolerances())
    rows = measure_rows(result.sums, "s", "t", len(FRAMES), 200, 0.95, 0)
    return result, rows.set_index(["measure", "region", "regressor"])["value"]


def test_truth_in_another_world_has_no_error(face):
    model, regions = face
    truth = moving(model)
    elsewhere = turned(truth, 25.0, (300.0, -40.0, 900.0))
    _, value = evaluate(model, regions, {"base": elsewhere}, truth)
    for region in ("vermilion", "mouth", "face"):
        assert value["vertex_error_mean_mm", region, "base"] < 1e-9
        assert value["surface_error_max_mm", region, "base"] < 1e-5
        assert abs(value["jitter_mm", region, "base"]) < 1e-9
    assert value["aperture_error_mm", "mouth", "base"] < 1e-9


def test_known_offset_of_the_lips_is_found_and_halved(face):
    model, regions = face
    truth = moving(model)
    lips = lip_sides(model) != 0
    base, half = truth.copy(), truth.copy()
    base[:, lips, 2] += 3.0
    half[:, lips, 2] += 1.5
    _, value = evaluate(model, regions, {"base": base, "MS": half}, truth)
    tolerance_mm = 1e-9
    assert abs(value["vertex_error_mean_mm", "vermilion", "base"] - 3.0) < tolerance_mm
    assert abs(value["vertex_error_std_mm", "vermilion", "base"]) < 1e-6
    assert value["ratio_to_base", "mouth", "MS"] == pytest.approx(0.5, abs=1e-12)
    # The lips are displaced along z; the surface below is slanted, so that the nearest point is nearer.
    assert value["surface_error_median_mm", "vermilion", "base"] <= 3.0


def test_another_person_who_moves_alike_has_no_motion_error(face):
    """A fixed offset of the mouth is wrong in every frame alike; a motion that is missing is not."""
    model, regions = face
    truth = moving(model)
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    other, still = truth.copy(), np.repeat(truth[:1], len(FRAMES), axis=0)
    other[:, lips, 2] += 3.0
    _, value = evaluate(model, regions, {"base": other, "still": still}, turned(truth, 10.0, 5.0))
    assert value["vertex_error_mean_mm", "vermilion", "base"] == pytest.approx(3.0, abs=1e-6)
    assert value["lip_motion_error_mm", "vermilion", "base"] < 1e-6
    opening = np.array([0.0, 2.0, 4.0, 3.0, 1.0, 0.0])
    lower = regions.weights["vermilion"][model.regions["vermilion_lower"]].sum()
    share = lower / regions.weights["vermilion"].sum()
    expected = share * np.abs(opening - opening.mean()).mean()
    assert value["lip_motion_error_mm", "vermilion", "still"] == pytest.approx(expected, rel=0.05)
    other[2] = np.nan  # one lost frame does not take the others along
    _, value = evaluate(model, regions, {"base": other}, truth)
    assert value["lip_motion_error_mm", "vermilion", "base"] < 1e-6


def test_half_the_missing_motion_is_half_the_motion_error_and_opening(face):
    model, regions = face
    truth = moving(model)
    still = np.repeat(truth[:1], len(FRAMES), axis=0)
    _, value = evaluate(model, regions, {"base": still, "MS": (truth + still) / 2}, truth)
    assert value["lip_motion_ratio", "vermilion", "MS"] == pytest.approx(0.5, abs=1e-9)
    assert value["aperture_ratio", "mouth", "MS"] == pytest.approx(0.5, abs=1e-9)
    assert (
        "lip_motion_error_mm"
        not in value.index.get_level_values(0)[value.index.get_level_values(1) == "mouth"]
    )


def test_a_mouth_that_lies_elsewhere_on_the_face_has_the_right_lip_shape(face):
    """Moved rigidly against the rest of the face it is wrong, after alignment on itself it is right."""
    model, regions = face
    truth = moving(model)
    elsewhere, wider = truth.copy(), truth.copy()
    mouth = np.unique(model.triangles[mouth_triangles(model)])
    elsewhere[:, mouth] = turned(truth[:, mouth], 4.0, (1.0, -2.0, 0.5))
    lips = lip_sides(model) != 0
    wider[:, lips, 0] *= 1.2
    _, value = evaluate(model, regions, {"base": elsewhere, "MS": wider}, truth)
    assert value["vertex_error_mean_mm", "vermilion", "base"] > 2.0
    assert value["lip_shape_error_mm", "vermilion", "base"] < 1e-6
    assert value["lip_shape_error_mm", "vermilion", "MS"] > 1.0


def test_lve_is_the_square_of_the_worst_lip_vertex(face):
    model, regions = face
    truth = moving(model)
    base = truth.copy()
    worst, elsewhere = (
        np.flatnonzero(lip_sides(model) != 0)[3],
        np.flatnonzero(lip_sides(model) == 0)[5],
    )
    base[:, worst, 2] += np.array([1.0, 2.0, 1.0, 2.0, 1.0, 2.0])
    base[:, elsewhere, 2] += 5.0
    # 8000 mm2 of face hold the alignment, so that one vertex elsewhere hardly turns it.
    _, value = evaluate(model, regions, {"base": base}, truth)
    assert value["lve_mm2", "vermilion", "base"] == pytest.approx(2.5, rel=0.05)


def test_lips_that_gape_where_truth_touches_are_counted(face):
    _, regions = face
    model = sheet_face(gap_mm=0.0)
    truth = moving(model)
    gaping = truth.copy()
    gaping[:, lip_sides(model) == 1, 1] += 1.6
    result, value = evaluate(model, regions, {"base": truth, "MS": gaping}, truth)
    assert value["false_open_rate", "mouth", "base"] == 0.0
    assert value["false_open_rate", "mouth", "MS"] == 1.0  # two of six frames touch
    assert result.sums["MS"].sums["mouth.touch_frames"].sum() == 2
    assert value["aperture_error_mm", "mouth", "MS"] == pytest.approx(1.6, abs=1e-9)


def test_depth_of_one_lip_in_the_other():
    apart, through = lip_patch.vertices_at(2.0, 0.0), lip_patch.vertices_at(-3.0, 0.0)
    depths = lip_depths(np.stack([apart, through]), lip_patch.face_model())
    assert depths[0] == 0.0
    assert 0.3 < depths[1] < 3.0


def test_jitter_is_that_of_the_result_beyond_the_truth(face):
    model, regions = face
    truth = np.repeat(model.neutral_mm[None], len(FRAMES), axis=0)
    shaken = truth.copy()
    shaken[:, lip_sides(model) != 0, 2] += 0.1 * np.array([1, -1, 1, -1, 1, -1])[:, None]
    _, value = evaluate(model, regions, {"base": truth, "MS": shaken}, truth)
    assert value["jitter_mm", "vermilion", "MS"] == pytest.approx(0.4, abs=1e-9)


def test_a_gap_in_the_frames_is_no_second_difference():
    sequence = np.random.default_rng(0).normal(size=(5, 4, 3))
    result = second_differences(sequence, np.array([0, 1, 2, 7, 8]))
    assert np.isfinite(result[1]).all()
    assert np.isnan(result[[0, 2, 3, 4]]).all()


def test_vertices_without_a_counterpart_do_not_count(face):
    model, regions = face
    truth = moving(model)
    base = truth.copy()
    base[:, lip_sides(model) == 1, 2] += 3.0
    known = truth.copy()
    known[:, lip_sides(model) == 1] = np.nan
    reference = Reference("truth", known, truth, model.triangles)
    result = evaluate_take({"base": base}, FRAMES, model, regions, reference, 2, 1, LipTolerances())
    rows = measure_rows(result.sums, "s", "t", 6, 200, 0.95, 0)
    value = rows.set_index(["measure", "region"])["value"]
    assert value["vertex_error_mean_mm", "vermilion"] < 1e-9


def test_mean_is_weighted_by_area_on_a_graded_mesh():
    """Vertices crowd on one half of the mesh; the error of the other half counts by its area."""
    model = sheet_face()
    crowded = model.neutral_mm.copy()
    right = crowded[:, 0] > 0
    crowded[right, 0] *= 0.25
    regions = regions_of_mask(model, crowded, mouth_triangles(model))
    truth = np.repeat(crowded[None], len(FRAMES), axis=0)
    base = truth.copy()
    inside = regions.weights["mouth"] > 0
    base[:, right & inside, 2] += 1.0
    reference = Reference("truth", truth, truth, model.triangles)
    result = evaluate_take({"base": base}, FRAMES, model, regions, reference, 2, 1, LipTolerances())
    rows = measure_rows(result.sums, "s", "t", 6, 200, 0.95, 0)
    value = rows.set_index(["measure", "region"])["value"]["vertex_error_mean_mm", "mouth"]
    area = vertex_areas(crowded, model.triangles[mouth_triangles(model)])
    assert value == pytest.approx(area[right].sum() / area.sum(), rel=1e-9)
    assert value < 0.6 * np.mean(right[inside])


def test_reconstruction_is_measured_without_alignment(face):
    model, regions = face
    truth = moving(model)
    reference = Reference("truth", truth, truth, model.triangles)
    shifted = truth + np.array([0.0, 0.0, 2.0])
    upper = model.neutral_mm[:, 1] > 0
    shifted[:, upper] += np.array([0.0, 0.0, 1.0])
    slid = np.zeros(truth.shape[:2])
    seen = np.broadcast_to(upper, truth.shape[:2])
    sums = evaluate_reconstruction(shifted, FRAMES, regions, reference, slid, seen, 2, 1)
    rows = measure_rows(sums, "s", "t", 6, 200, 0.95, 0).set_index(["measure", "region"])["value"]
    assert 2.0 < rows["vertex_error_mean_mm", "vermilion"] < 3.0
    assert rows["vertex_error_mean_mm", "visible"] == pytest.approx(3.0, abs=1e-9)
    assert rows["drift_mm", "vermilion"] == rows["drift_mm", "visible"] == 0.0


def test_a_point_is_seen_by_the_cameras_that_nothing_hides_it_from(face):
    model, _ = face
    truth = model.neutral_mm[None]
    reference = Reference("truth", truth, truth, model.triangles)
    place = np.array([[0.0, 0.0, 500.0], [0.0, 0.0, -500.0]])  # before the face, behind it
    up = np.array([0.0, 1.0, 0.0])
    rig = [
        pinhole(str(i), 800.0, 400, 400, look_at(at, np.zeros(3), up)) for i, at in enumerate(place)
    ]
    wanted = model.regions["vermilion_upper"]
    seen = cameras_that_see(reference, [*rig, rig[0]], wanted)
    assert (seen[0, ~wanted] == 0).all()
    # from behind the sheet nothing hides its points either: it has no thickness
    assert (seen[0, wanted] == 3).mean() > 0.9
    wall = np.array([[-90.0, -90, 60], [90, -90, 60], [0, 90, 60]])
    hidden = Reference(
        "truth", truth, np.concatenate([truth[0], wall])[None],
        np.concatenate([model.triangles, [[len(truth[0]) + k for k in range(3)]]]),
    )  # fmt: skip
    assert (cameras_that_see(hidden, rig, wanted)[0, wanted] <= 1).all()


def test_joined_takes_weigh_by_their_area_and_frames():
    a = ClipSums({"mouth.error": np.array([2.0]), "mouth.weight": np.array([1.0])})
    b = ClipSums({"mouth.error": np.array([3.0]), "mouth.weight": np.array([3.0]), "x": np.ones(1)})
    both = ClipSums.joined([a, b])
    assert set(both.sums) == {"mouth.error", "mouth.weight"}
    assert both.sums["mouth.error"].sum() / both.sums["mouth.weight"].sum() == 1.25


def test_the_gap_of_the_truth_is_that_of_its_own_surface(face):
    """Between the vertices of a coarse mesh the true lips reach further into the gap."""
    model, regions = face
    truth = moving(model)
    corners = truth.transpose(1, 0, 2).reshape(model.n_vertices, -1)
    # Every triangle in four: the first vertices are the coarse ones.
    fine, triangles = trimesh.remesh.subdivide(corners, model.triangles)
    fine = fine.reshape(len(fine), len(FRAMES), 3).transpose(1, 0, 2)
    where = Surface(fine[0], triangles).closest(truth[0])
    round_lips = fine.copy()
    new = np.arange(model.n_vertices, fine.shape[1])
    side = np.sign(fine[0, new, 1]) * (np.abs(fine[0, new, 1]) < 8.0)
    round_lips[:, new, 1] -= 0.2 * side
    found = []
    for surface in (fine, round_lips):
        reference = Reference("truth", where.sample(fine, triangles), surface, triangles)
        result = evaluate_take(
            {"base": truth}, FRAMES, model, regions, reference, 2, 1, LipTolerances()
        )
        table = result.table.set_index(["regressor", "frame"])["aperture_mm"]
        found.append((table["truth"].to_numpy(), table["base"].to_numpy()))
    (flat, own), (rounded, _) = found
    assert np.abs(flat - own).max() < 0.05
    # A column without a coarse vertex closes by twice 0.2 mm, one with a vertex on its rim by less.
    assert ((flat - rounded > 0.2) & (flat - rounded < 0.4)).all()
