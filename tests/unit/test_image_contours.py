"""The image as a constraint on a corrected mesh: contours, contact, pose, neighbours in time."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import sparse

from tests import lip_patch
from vermilion.baselines.null import null_model
from vermilion.config.correction import CorrectionConfig, ImageAgreementConfig
from vermilion.config.evaluation import SurfaceConfig
from vermilion.correction.coarse_take import CoarseTake, frames_around
from vermilion.correction.constraints import ConstraintSolver, LinearConstraints
from vermilion.correction.correct import (
    CorrectionSettings,
    correct,
    correct_with_layers,
)
from vermilion.correction.folds import LipFolds
from vermilion.correction.image_agreement import ImageAgreement, ImageAgreementSettings
from vermilion.correction.image_contours import ImageContours
from vermilion.correction.integration import LayerIntegrator
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.correction.repose import ANCHORS, smoothed_motion
from vermilion.correction.surface_quality import LipSurface, SurfaceTolerances
from vermilion.features.rings import lip_rings
from vermilion.geometry.cotangents import bending_stiffness
from vermilion.geometry.mesh import unique_edges
from vermilion.geometry.rotations import rotation_matrix

N_SAMPLES = 80
CAMERA = lip_patch.cameras()["front"]
DEFAULTS = ImageAgreementSettings(**CorrectionConfig().image.at(30))
OFF = replace(DEFAULTS, repose=False, contour_weight=0.0, contact=False)
CONTOURS = replace(OFF, contour_weight=1000.0)
REPOSE = replace(OFF, repose=True)


def face():
    """The lip patch with corners of the mouth, and its rim in the place of eyes and brows."""
    model = lip_patch.face_model()
    landmarks = np.zeros(66, dtype=np.int32)
    row = lip_patch.LIP_ROWS * lip_patch.COLUMNS
    landmarks[58], landmarks[62] = row + lip_patch.COLUMNS // 2, row
    rim = (lip_patch.ROWS - 1) * lip_patch.COLUMNS
    landmarks[ANCHORS] = rim + np.linspace(0, lip_patch.COLUMNS, len(ANCHORS), endpoint=False)
    landmarks[36], landmarks[45] = rim + lip_patch.COLUMNS // 2, rim
    return replace(model, landmarks=landmarks)


FACE = face()
#: The mask of the layers: all but the outer rows.
MASK = np.flatnonzero((FACE.triangles < 22 * lip_patch.COLUMNS).all(axis=1))


def lip_surface(**changed):
    """What measures the lips of the patch, by the configuration's tolerances but for those given."""
    asked = DEFAULTS.__dict__ | SurfaceConfig().model_dump() | changed
    folds = LipFolds(FACE, asked["folded_deg"], asked["crease_deg"])
    tolerances = SurfaceTolerances(**{name: asked[name] for name in SurfaceConfig.model_fields})
    return LipSurface(FACE, folds, tolerances)


def integrator():
    return LayerIntegrator(FACE.neutral_mm, FACE.triangles, MASK, seam_mm=0.0)


def image_of(meshes_mm, pose=None):
    """What a perfect search finds in the images of meshes (F, V, 3) in the world."""
    rotation, translation = pose or (np.eye(3), np.zeros(3))
    world = np.asarray(meshes_mm) @ rotation.T + translation
    outer, inner = (CAMERA.project(ring.points(world)) for ring in lip_rings(FACE, N_SAMPLES))
    known = np.ones(outer.shape[:2], dtype=bool)
    return ImageContours(FACE, CAMERA, outer, inner, known, known)


def take_of(heads_mm, image, pose=None, frames=None):
    """Coarse meshes (F, V, 3) of the head frame in one pose, with an image each."""
    n = len(heads_mm)
    rotation, translation = pose or (np.eye(3), np.zeros(3))
    rotation, translation = np.tile(rotation, (n, 1, 1)), np.tile(translation, (n, 1))
    world = heads_mm @ np.swapaxes(rotation, 1, 2) + translation[:, None]
    return CoarseTake(
        np.arange(n) if frames is None else frames, world, FACE.triangles, FACE.neutral_mm,
        rotation, translation, np.zeros((n, 0)), np.ones(n, dtype=bool), image,
    )  # fmt: skip


@cache
def agreement(settings):
    """Factored once for all takes of the face."""
    return ImageAgreement(integrator(), FACE.neutral_mm, FACE, N_SAMPLES, settings)


def fitted(corrected, image, settings, coarse=None, pose=None, frames=None):
    fit = agreement(settings)
    coarse = corrected if coarse is None else coarse
    return fit.fit(corrected, take_of(coarse, image, pose, frames), image)


def distance_px(mesh_mm, image, f=0):
    """Distance of the samples of a mesh (V, 3) from their lines, (m,) px, where these are known."""
    points, normals, known = (part[f] for part in image.lines())
    samples = np.concatenate([ring.points(mesh_mm) for ring in lip_rings(FACE, N_SAMPLES)])
    return np.abs(((CAMERA.project(samples) - points) * normals).sum(axis=1))[known]


def depth_in_other_lip(mesh_mm):
    return LipCrossings(FACE).find(mesh_mm).deepest_mm


@pytest.mark.parametrize("bending_mm", [0.0, 6.0])
def test_low_rank_update_is_the_minimum_of_the_whole_energy(bending_mm):
    solid, rng = integrator(), np.random.default_rng(0)
    plate = bending_mm**2 * bending_stiffness(FACE.neutral_mm, FACE.triangles, solid.free)
    vertices = rng.choice(solid.free, size=(12, 2), replace=False)
    directions = rng.normal(size=(12, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rows = LinearConstraints(
        vertices, rng.uniform(0.2, 1, (12, 2)), directions, rng.normal(size=12),
        rng.uniform(0.1, 2, 12), np.zeros(12, dtype=bool),
    )  # fmt: skip
    solver = ConstraintSolver(solid, np.unique(vertices), plate if bending_mm else None)
    forces = solver.forces(rows)
    move = np.zeros((FACE.n_vertices, 3))
    move[solid.free] = solver.displacements([solver.pushes(rows, forces)])[0]
    jacobian = sparse.lil_matrix((12, 3 * FACE.n_vertices))
    for i, (pair, shares) in enumerate(zip(vertices, rows.coefficients, strict=True)):
        for vertex, share in zip(pair, shares, strict=True):
            jacobian[i, 3 * vertex : 3 * vertex + 3] += share * directions[i]
    pull = jacobian.T @ ((rows.target_mm - jacobian @ move.ravel()) / rows.compliance)
    balance = (solid.matrix + plate) @ move[solid.free] - pull.reshape(-1, 3)[solid.free]
    assert np.abs(balance).max() < 1e-8
    near = solver.displacements_at(vertices.ravel(), solver.pushes(rows, forces))
    np.testing.assert_allclose(near, move[vertices.ravel()], atol=1e-9)


def test_a_pulled_membrane_has_a_tip_and_a_bent_lip_has_none():
    """Displacement of a vertex that is pulled, over the mean of its neighbours'."""
    solid = integrator()
    vertex = solid.free[len(solid.free) // 2]
    edges = unique_edges(FACE.triangles)
    around = edges[(edges == vertex).any(axis=1)]
    around = around[around != vertex]
    pull = LinearConstraints(
        np.array([[vertex]]), np.ones((1, 1)), np.array([[0, 1.0, 0]]), np.array([1.0]),
        np.zeros(1), np.zeros(1, dtype=bool),
    )  # fmt: skip
    tips = []
    for bending_mm in (0.0, 6.0):
        plate = bending_mm**2 * bending_stiffness(FACE.neutral_mm, FACE.triangles, solid.free)
        solver = ConstraintSolver(solid, np.append(around, vertex), plate)
        forces = solver.forces(pull)
        moved = solver.displacements([solver.pushes(pull, forces)])[0][:, 1]
        whole = np.zeros(FACE.n_vertices)
        whole[solid.free] = moved
        tips.append(whole[vertex] / whole[around].mean())
    assert tips[0] > 1.5
    assert tips[1] < 1.1


def test_noise_of_the_found_contours_leaves_no_ragged_edge():
    before = np.stack([lip_patch.vertices_at(0.6, 0.0)] * 3)
    image = image_of([lip_patch.vertices_at(1.8, 0.08)] * 3)
    noise = np.random.default_rng(2).normal(scale=1.0, size=image.inner_px.shape)
    image = replace(image, inner_px=image.inner_px + noise, outer_px=image.outer_px - noise)
    on = replace(DEFAULTS, repose=False)
    ragged = [
        lip_surface().measure(fitted(before, image, settings), before, CAMERA)
        for settings in (on, replace(on, bending_mm=0.0))
    ]
    assert ragged[0].roughness_mm.mean() < 0.5 * ragged[1].roughness_mm.mean()
    assert not ragged[0].flipped.any() and not ragged[0].inner_mouth.any()


def test_a_one_sided_row_never_pulls():
    solid = integrator()
    vertex = solid.free[len(solid.free) // 2]
    rows = LinearConstraints(
        np.array([[vertex], [vertex]]), np.ones((2, 1)), np.array([[0, 1.0, 0], [1.0, 0, 0]]),
        np.array([-0.4, 0.3]), np.zeros(2), np.ones(2, dtype=bool),
    )  # fmt: skip
    solver = ConstraintSolver(solid, np.array([vertex]))
    pushes = solver.pushes(rows, solver.forces(rows))
    moved = solver.displacements_at(np.array([vertex]), pushes)[0]
    np.testing.assert_allclose(moved, [0.3, 0.0, 0.0], atol=1e-6)


def test_contours_go_to_their_lines_and_depth_stays():
    before = lip_patch.vertices_at(0.6, 0.0)
    image = image_of([lip_patch.vertices_at(1.8, 0.08)])
    assert distance_px(before, image).max() > 2.0
    membrane = fitted(before[None], image, replace(CONTOURS, bending_mm=0.0))[0]
    left = distance_px(membrane, image)
    assert np.percentile(left, 95) < 0.1
    assert left.max() < 0.5  # by the corners it is another line that borders the opening
    after = fitted(before[None], image, CONTOURS)[0]  # a plate does not turn at the corners
    assert distance_px(after, image).mean() < 0.1
    moved = after - before
    lips = np.unique(np.concatenate([FACE.outer_contour, FACE.inner_contour]))
    view = before[lips] - CAMERA.centre_mm
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    assert (
        np.abs((moved[lips] * view).sum(axis=1)).max() < 0.05 * np.linalg.norm(moved, axis=1).max()
    )


def test_the_inside_of_a_lip_is_never_pulled_to_the_contour():
    """Where it hangs over the vermilion, it would be drawn out of the mouth in the lip's place."""
    before = lip_patch.vertices_at(0.6, 0.0)
    inside = FACE.regions["mouth_inner"]
    before[inside, 1] -= 2.0 * np.sign(before[inside, 1] - before[FACE.inner_contour, 1].mean())
    image = image_of([lip_patch.vertices_at(1.8, 0.08)])
    solid = ImageAgreement(integrator(), FACE.neutral_mm, FACE, N_SAMPLES, CONTOURS)
    seen = solid._seen(before, np.eye(3), np.zeros(3), image, 0)
    assert not inside[seen.points.vertices(FACE.triangles)].any()


def test_a_contour_far_off_as_a_whole_counts_and_a_stray_point_does_not():
    """Two deviations of the robust weight off, the first solve brings the lips near enough to count."""
    before = lip_patch.vertices_at(0.6, 0.0)
    image = image_of([lip_patch.vertices_at(1.8, 0.08)])
    settings = replace(CONTOURS, contour_weight=5.0, contour_robust_mm=0.3, bending_mm=0.0)
    assert distance_px(fitted(before[None], image, settings)[0], image).mean() < 0.3
    stray = image.outer_px.copy()
    stray[0, 10] += [0.0, -60.0]
    after = fitted(before[None], replace(image, outer_px=stray), settings)[0]
    beside = np.r_[5:8, 13:16]
    assert distance_px(after, image)[beside].max() < 0.5


def test_gradients_across_the_image_stay():
    before = lip_patch.vertices_at(0.6, 0.0)
    image = image_of([lip_patch.vertices_at(1.8, 0.08)])
    moved = fitted(before[None], image, CONTOURS)[0] - before
    edges = FACE.triangles[MASK]
    change = np.abs(moved[edges[:, 1:]] - moved[edges[:, :1]]).mean(axis=(0, 1))
    assert change[:2].min() > 0.01
    assert change[2] < 0.05 * change[:2].max()  # the view is along z


def test_points_that_were_not_found_do_not_pull():
    before = lip_patch.vertices_at(0.6, 0.0)
    image = image_of([lip_patch.vertices_at(1.8, 0.08)])
    nothing = np.zeros_like(image.outer_found)
    blind = replace(image, outer_found=nothing, inner_found=nothing)
    np.testing.assert_allclose(fitted(before[None], blind, CONTOURS)[0], before, atol=1e-12)


def test_switched_off_the_result_is_that_of_the_paper():
    before = lip_patch.vertices_at(0.6, 0.0)[None]
    layers = np.random.default_rng(1).normal(scale=0.02, size=(1, len(MASK), 9))
    take, settings = take_of(before, image_of(before)), CorrectionSettings(16.0, 0.0, 0, 0.0, None)
    paper = correct_with_layers(MASK, layers, None, take, settings)
    off = correct_with_layers(MASK, layers, None, take, replace(settings, image=OFF))
    on = correct_with_layers(MASK, layers, None, take, replace(settings, image=CONTOURS))
    assert np.array_equal(off, paper)
    assert not np.allclose(on, paper)


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_lips_that_pass_through_each_other_are_parted(weight):
    through = lip_patch.vertices_at(-3.0, 0.0)
    assert depth_in_other_lip(through) > 0.3
    settings = replace(OFF, contact=True, contour_weight=weight)
    after = fitted(through[None], image_of([through]), settings)[0]
    assert depth_in_other_lip(after) <= 0.01


def test_lips_that_touch_in_the_image_touch_there_in_the_mesh():
    gap = FACE.inner_contour[[lip_patch.COLUMNS // 4, 3 * lip_patch.COLUMNS // 4]]
    closed, ajar = lip_patch.vertices_at(-2.35, 0.0), lip_patch.vertices_at(0.5, 0.0)
    ajar[FACE.regions["vermilion_upper"], 2] += 1.0  # and one lip before the other
    settings = replace(OFF, contact=True, contour_weight=100.0)
    after = fitted(ajar[None], image_of([closed]), settings)[0]
    assert np.linalg.norm(ajar[gap[0]] - ajar[gap[1]]) > 2.5
    assert abs(after[gap[0], 1] - after[gap[1], 1]) < 0.2
    assert depth_in_other_lip(after) <= 0.01


def test_a_head_beside_its_image_is_laid_on_it():
    mesh = lip_patch.vertices_at(2.0, 0.1)[None]
    pose = rotation_matrix(np.array([0.0, 0.02, 0.01])), np.array([1.0, -1.5, 0.0])
    image = image_of(mesh)
    rotation, translation = pose
    coarse = (mesh - translation) @ rotation  # its eyes and brows project where they should
    after = fitted(mesh, image, REPOSE, coarse=coarse, pose=pose)[0]
    assert distance_px(mesh[0] @ rotation.T + translation, image).mean() > 3.0
    assert distance_px(after, image).mean() < 0.2


def test_the_filter_over_time_has_no_lag_and_keeps_what_is_steady():
    frames, known = np.arange(41), np.ones(41, dtype=bool)
    steady = smoothed_motion(np.ones((41, 6)), known, frames, 3.0)
    np.testing.assert_allclose(steady, 1.0)
    impulse = np.zeros((41, 6))
    impulse[20] = 1.0
    found = smoothed_motion(impulse, known, frames, 3.0)[:, 0]
    np.testing.assert_allclose(found, found[::-1], atol=1e-15)
    assert found.argmax() == 20
    known[20] = False  # a frame without a motion of its own has its neighbours'
    assert smoothed_motion(np.where(known[:, None], 2.0, np.nan), known, frames, 3.0)[20, 0] == 2.0


def test_results_do_not_depend_on_the_chunk():
    """To a hundredth of a millimetre, of lips that jump by millimetres from frame to frame."""
    config = ImageAgreementConfig(repose_frames=1.0, coherence_s=0.1)
    settings = ImageAgreementSettings(**config.at(30))
    rng = np.random.default_rng(2)
    shapes = np.stack([lip_patch.vertices_at(o, 0.05) for o in rng.uniform(0, 4, 36)])
    image = image_of(shapes + rng.normal(scale=0.3, size=(36, 1, 3)))
    whole = fitted(shapes, image, settings)
    asked = np.array([17, 18, 19])
    near = frames_around(asked, np.arange(36), config.reach_frames(30))
    assert near.tolist() == list(range(17 - 12, 20 + 12))
    part = fitted(shapes[near], image[near], settings, frames=near)[np.searchsorted(near, asked)]
    np.testing.assert_allclose(part, whole[asked], rtol=0, atol=0.01)


def null_of(take):
    return null_model(take.triangles, MASK, ["feature"] * take.features.shape[1])


def test_without_a_regressor_the_contours_alone_move_the_lips():
    """A closed track whose images show open lips: half way there and more, and only on request."""
    closed = np.tile(lip_patch.vertices_at(0.6, 0.0), (2, 1, 1))
    image = image_of(np.tile(lip_patch.vertices_at(4.0, 0.5), (2, 1, 1)))
    take = take_of(closed, image)
    settings = CorrectionSettings(0.0, 0.0, smooth_frames=0, fade_power=0.0, image=CONTOURS)
    moved = correct(null_of(take), take, settings)
    before_px, after_px = (distance_px(m, image).mean() for m in (closed[0], moved[0]))
    assert before_px > 0.5 and after_px < 0.3 * before_px, (before_px, after_px)
    still = correct(null_of(take), take, replace(settings, image=None))
    np.testing.assert_allclose(still, closed, rtol=0, atol=1e-6)


def test_without_a_regressor_a_frame_without_features_stays_as_it_is():
    closed = np.tile(lip_patch.vertices_at(0.6, 0.0), (2, 1, 1))
    image = image_of(np.tile(lip_patch.vertices_at(4.0, 0.5), (2, 1, 1)))
    take = replace(take_of(closed, image), features=np.array([[0.0], [np.nan]]))
    settings = CorrectionSettings(0.0, 0.0, smooth_frames=0, fade_power=0.0, image=CONTOURS)
    moved = correct(null_of(take), take, settings)
    assert np.abs(moved[0] - closed[0]).max() > 0.1
    np.testing.assert_array_equal(moved[1], closed[1])
