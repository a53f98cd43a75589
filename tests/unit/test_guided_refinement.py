"""Sketch refinement on the generated head: Guided18 section 5, and what goes beyond."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from tests.unit import guided_mouths as mouths
from vermilion.correction.constraints import LinearConstraints
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.geometry.mesh import vertex_normals
from vermilion.geometry.raycast import RayCaster
from vermilion.geometry.sparse import CholeskyFactor
from vermilion.guided.constrained_energy import ConstrainedEnergy
from vermilion.guided.refinement import (
    RefinementSettings,
    SketchRefiner,
    SketchView,
    ray_constraints,
)
from vermilion.guided.silhouette import ContourSurface, inner_silhouettes
from vermilion.guided.sketch import Sketch, SketchCurve
from vermilion.storage.errors import InputError


@pytest.fixture(scope="module")
def refiner() -> SketchRefiner:
    return SketchRefiner(mouths.regions(), mouths.surface())


@pytest.fixture(scope="module")
def base() -> np.ndarray:
    return mouths.open_mouth()


@pytest.fixture(scope="module")
def true() -> np.ndarray:
    return mouths.open_mouth(mouthFunnel=0.4, mouthSmile_L=0.4)


def test_the_contour_lands_within_a_pixel_of_the_sketch(refiner, base, true):
    camera = mouths.camera()
    sketch = mouths.drawn(true, camera)
    start = SketchView.of(sketch, camera, RefinementSettings())
    off = start.contours(base, mouths.surface())
    before = max(
        off[name].nearest(start.samples[name])[1].max() for name in ("upper_inner", "lower_inner")
    )
    result = refiner.refine(base, [(sketch, camera)])
    after = np.concatenate(list(result.distance_px["front"].values()))
    assert before > 5.0
    assert after.max() < 1.0


def test_rays_beside_the_sketch_meet_and_pass_the_lips(refiner, base, true):
    """A pixel outside the drawn line is lip, a pixel inside is mouth: by rays, not by silhouettes."""
    face, camera = mouths.face(), mouths.camera()
    sketch = mouths.drawn(true, camera)
    mesh = refiner.refine(base, [(sketch, camera)]).vertices_mm
    caster = RayCaster(mesh, face.triangles)
    for name, region, outwards in (
        ("upper_inner", "vermilion_upper", -1.0),
        ("lower_inner", "vermilion_lower", 1.0),
    ):
        red = face.regions[region][face.triangles].all(axis=1)
        points = sketch.curves[name].points_px[4:-4]  # at the corners both lips are near
        seen = [
            red[caster.cast(*camera.rays(points + np.array([0.0, side * outwards]))).triangle]
            for side in (1.0, -1.0)
        ]
        assert seen[0].mean() > 0.97
        assert seen[1].mean() < 0.03


def test_nothing_outside_the_mouth_region_moves(refiner, base, true):
    camera = mouths.camera()
    result = refiner.refine(base, [(mouths.drawn(true, camera), camera)])
    moved = np.linalg.norm(result.vertices_mm - base, axis=1)
    outside = np.setdiff1d(np.arange(len(base)), mouths.regions().mouth_vertices)
    assert moved[outside].max() < 0.01
    assert moved.max() > 1.0


def test_the_lips_come_nearer_to_the_truth(base, true):
    camera, side = mouths.camera(), mouths.camera("side", 0.8)
    red = mouths.face().regions["vermilion_upper"] | mouths.face().regions["vermilion_lower"]
    refiner = SketchRefiner(
        mouths.regions(), mouths.surface(), settings=RefinementSettings(position=0.01)
    )
    one, two = (
        refiner.refine(base, [(mouths.drawn(true, c, outer=True), c) for c in cameras]).vertices_mm
        for cameras in ((camera,), (camera, side))
    )
    before, with_one, with_two = (
        np.linalg.norm(mesh - true, axis=1)[red].mean() for mesh in (base, one, two)
    )
    assert with_one < 0.8 * before
    assert with_two < with_one


def test_two_cameras_agree_with_both_sketches(refiner, base, true):
    cameras = mouths.camera(), mouths.camera("side", 0.6)
    result = refiner.refine(base, [(mouths.drawn(true, c), c) for c in cameras])
    for name in ("front", "side"):
        distances = np.concatenate(list(result.distance_px[name].values()))
        assert distances.mean() < 0.3
        assert np.quantile(distances, 0.95) < 1.0


def test_a_sketch_of_the_contour_itself_moves_nothing(refiner, base):
    camera = mouths.camera()
    result = refiner.refine(base, [(mouths.drawn(base, camera), camera)])
    assert np.linalg.norm(result.vertices_mm - base, axis=1).max() < 0.15


def test_outer_contours_follow_their_sketch(refiner, base, true):
    camera = mouths.camera()
    result = refiner.refine(base, [(mouths.drawn(true, camera, outer=True), camera)])
    for name in ("upper_outer", "lower_outer"):
        assert result.distance_px["front"][name].mean() < 0.5


def test_strokes_that_are_only_near_pull_less(refiner, base, true):
    camera = mouths.camera()
    settings = replace(RefinementSettings(), iterations=1)
    once = SketchRefiner(mouths.regions(), mouths.surface(), settings=settings)
    sure, near = (
        once.refine(base, [(mouths.drawn(true, camera, kind=kind), camera)]).mean_px
        for kind in ("sure", "near")
    )
    assert near > 2 * sure


def test_lips_that_are_drawn_over_each_other_press(base):
    """The lower contour lies 4 px above the upper one: both end on the line between."""
    face, camera = mouths.face(), mouths.camera()
    crossings = LipCrossings(face)
    refiner = SketchRefiner(mouths.regions(), mouths.surface(), crossings=crossings)
    open_little = face.vertices(None, np.zeros(face.n_expressions))
    open_little = open_little + 0.12 * face.expressions_mm[face.expression_names.index("jawOpen")]
    loop = camera.project(open_little[face.inner_contour])
    x = np.linspace(loop[:, 0].min() + 8, loop[:, 0].max() - 8, 60)
    middle = loop[:, 1].mean()
    curves = {
        "upper_inner": SketchCurve(np.stack([x, middle + 2.0 + 0 * x], axis=1)),
        "lower_inner": SketchCurve(np.stack([x, middle - 2.0 + 0 * x], axis=1)),
    }
    result = refiner.refine(open_little, [(Sketch("front", 0, mouths.IMAGE_PX, curves), camera)])
    upper, lower = inner_silhouettes(result.vertices_mm, mouths.surface(), camera, mouths.UP)
    line = np.stack([x, middle + 0 * x], axis=1)
    assert upper.nearest(line)[1].mean() < 0.5
    assert lower.nearest(line)[1].mean() < 0.5
    assert result.depth_mm < 0.05


def test_silhouettes_turn_away_from_the_view(base):
    """Points of the silhouette: the interpolated normal is at a right angle to the ray."""
    camera = mouths.camera()
    normals = vertex_normals(base, mouths.face().triangles)
    for segments, sign in zip(
        inner_silhouettes(base, mouths.surface(), camera, mouths.UP), (1.0, -1.0), strict=True
    ):
        rays = segments.start.sample(base, mouths.face().triangles) - camera.centre_mm
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        normal = segments.start.sample(normals, mouths.face().triangles)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        assert len(segments) > 30
        assert np.median(np.abs((rays * normal).sum(axis=1))) < 0.02
        # y counts down: the upper lip's silhouette faces down.
        assert (sign * (normal @ camera.rotation[1])).min() > -0.05


def test_the_nearest_point_of_a_segment_lies_between_its_vertices(base):
    camera = mouths.camera()
    upper, _ = inner_silhouettes(base, mouths.surface(), camera, mouths.UP)
    middles = 0.5 * (upper.start_px + upper.end_px)
    points, distance = upper.nearest(middles)
    assert distance.max() < 1e-9
    np.testing.assert_allclose(
        camera.project(points.sample(base, mouths.face().triangles)), middles, atol=1e-6
    )
    np.testing.assert_allclose(points.barycentric.sum(axis=1), 1.0)


def test_sides_need_no_face_model(base, true):
    camera = mouths.camera()
    bare = SketchRefiner(mouths.regions(), ContourSurface.of_regions(mouths.regions()))
    result = bare.refine(base, [(mouths.drawn(true, camera), camera)])
    assert result.mean_px < 0.5


def test_ray_constraints_measure_the_distance_to_the_ray():
    camera = mouths.camera()
    point = camera.centre_mm + 500.0 * -camera.rotation.T @ np.array([0.1, 0.05, -1.0])
    pixel = camera.project(point[None]) + np.array([3.0, -4.0])
    made = ray_constraints(
        np.array([[0, 1]]), np.array([[0.5, 0.5]]), point[None], camera, pixel, 2.0
    )
    origin, ray = camera.rays(pixel)
    offset = point - origin[0]
    expected = np.linalg.norm(offset - (offset @ ray[0]) * ray[0])
    assert np.linalg.norm(made.target_mm) == pytest.approx(expected, rel=1e-9)
    assert np.abs(made.directions @ ray[0]).max() < 1e-12


def test_the_constrained_energy_has_the_least_squares_minimum():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(30, 12))
    matrix = root.T @ root + np.eye(12)
    free = np.arange(3, 15)
    ids, coefficients = rng.integers(20, size=(6, 3)), rng.normal(size=(6, 3))
    directions = rng.normal(size=(6, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    wanted, weight = rng.normal(size=6), rng.uniform(0.5, 2.0, 6)
    constraints = LinearConstraints(
        ids, coefficients, directions, wanted, 1 / weight, np.zeros(6, dtype=bool)
    )
    energy = ConstrainedEnergy(CholeskyFactor(sparse.csc_matrix(matrix)), free, 20)
    found = energy.minimise(constraints)
    # The same energy, dense: x^T A x + sum w (J x - r)^2 over all 36 unknowns.
    jacobian = np.zeros((6, 20, 3))
    for i in range(6):
        for v, c in zip(ids[i], coefficients[i], strict=True):
            jacobian[i, v] += c * directions[i]
    jacobian = jacobian[:, free].reshape(6, -1)
    dense = np.kron(matrix, np.eye(3)) + jacobian.T @ (weight[:, None] * jacobian)
    expected = np.linalg.solve(dense, jacobian.T @ (weight * wanted)).reshape(-1, 3)
    np.testing.assert_allclose(found, expected, atol=1e-7)


def test_what_cannot_be_refined_is_named(refiner, base, true):
    camera = mouths.camera()
    sketch = mouths.drawn(true, camera)
    with pytest.raises(InputError, match="one or more of the frame"):
        refiner.refine(base, [])
    with pytest.raises(InputError, match=r"camera front, frame 0.*320 x 320"):
        refiner.refine(base, [(replace(sketch, image_size_px=(320, 320)), camera)])
    with pytest.raises(InputError, match="not finite round the mouth"):
        refiner.refine(np.full_like(base, np.nan), [(sketch, camera)])
    bare = SketchRefiner(mouths.regions(), ContourSurface.of_regions(mouths.regions()))
    outer = {"upper_outer": SketchCurve(np.array([[300.0, 300.0], [340.0, 300.0]]))}
    with pytest.raises(InputError, match="outer contours only with a face model"):
        bare.refine(base, [(Sketch("front", 0, mouths.IMAGE_PX, outer), camera)])
