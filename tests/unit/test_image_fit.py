"""Dense refinement on images of a painted dome, whose pose, expression and light are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.unit.image_fit_scene import LIGHT, dome, image_of, mesh_of, motion, take_start
from vermilion.appearance.estimate import Appearance, SampleObservations, estimate_appearance
from vermilion.appearance.harmonics import harmonics, harmonics_jacobian, irradiance
from vermilion.appearance.sampled_face import SampledFace
from vermilion.appearance.samples import sample_skin
from vermilion.geometry.rotations import rotation_matrix
from vermilion.geometry.surface_points import SurfacePoints
from vermilion.imaging.display import display_slope, to_display_values
from vermilion.storage.errors import InputError
from vermilion.tracking.image_fit.ablations import ablation_rows
from vermilion.tracking.image_fit.appearance_frames import choose_appearance_frames
from vermilion.tracking.image_fit.chunk import FrameChunk, fit_frames
from vermilion.tracking.image_fit.frame_fit import FrameFitSettings, FrameProblem
from vermilion.tracking.image_fit.residual import photometric_residual, sample_errors
from vermilion.tracking.image_fit.smooth_over_time import smooth_over_time
from vermilion.tracking.image_fit.take import learn_appearance
from vermilion.tracking.landmark_fit.expression import N_POSE
from vermilion.tracking.landmark_fit.smoothness import TemporalSmoothness
from vermilion.tracking.landmark_fit.timeline import Timeline
from vermilion.tracking.offsets import OffsetSettings, OffsetSolver
from vermilion.tracking.settings import LandmarkFitSettings

MODEL = dome()
N_FRAMES = 6
SETTINGS = FrameFitSettings(iterations=(4, 4, 6))


def unit_vectors(count, seed=1):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_harmonics_jacobian_is_their_derivative():
    normals, step = unit_vectors(20), 1e-6
    for axis in range(3):
        moved = normals + step * np.eye(3)[axis]
        slope = (harmonics(moved) - harmonics(normals)) / step
        assert np.abs(slope - harmonics_jacobian(normals)[..., axis]).max() < 1e-4


def test_many_display_values_are_those_of_single_ones():
    light = np.append(np.random.default_rng(2).uniform(-0.1, 2.0, 30_000), [0.0031308, 0.0, np.nan])
    values = to_display_values(light)
    single = np.concatenate([to_display_values(part) for part in np.array_split(light, 30)])
    assert np.allclose(values, single, rtol=0, atol=1e-10, equal_nan=True)


def test_display_slope_is_the_curves_derivative():
    light = np.linspace(0.01, 0.9, 50)
    slope = (to_display_values(light + 1e-7) - to_display_values(light)) / 1e-7
    assert np.abs(slope / display_slope(light) - 1).max() < 1e-3


def test_samples_cover_the_skin_evenly_and_leave_its_border_out():
    samples = sample_skin(MODEL, 1.0)
    at = samples.matrix(MODEL.triangles, MODEL.n_vertices)
    points = at @ MODEL.neutral_mm
    assert np.allclose(at @ np.ones(MODEL.n_vertices), 1.0)
    assert np.abs(points[:, :2]).max() < 60 - 5.0  # mm: two rings of 3 mm lie along the border
    assert len(samples) == pytest.approx(108**2 * 1.24, rel=0.05)


def test_light_and_albedo_are_told_apart_by_the_skin_that_has_one_colour():
    rng = np.random.default_rng(2)
    frames, count = 6, 600
    normals = np.stack([unit_vectors(count, seed) for seed in range(frames)])
    normals[..., 2] = -np.abs(normals[..., 2])
    albedo = np.tile([0.5, 0.35, 0.3], (count, 1)) * (1 + 0.05 * rng.normal(size=(count, 1)))
    albedo[:60] = [0.5, 0.1, 0.1]  # lips
    colours = (albedo * irradiance(normals, LIGHT))[:, None]
    samples = SurfacePoints(np.zeros(count, dtype=np.int32), np.full((count, 3), 1 / 3))
    seen = SampleObservations(colours, normals, np.ones((frames, count)))
    found = estimate_appearance(np.arange(frames), samples, seen, 0.5)
    ratio = irradiance(normals, found.light) / irradiance(normals, LIGHT)
    assert np.abs(ratio / ratio.mean(axis=(0, 1)) - 1).mean() < 0.02
    reddish = found.albedo[0][:60] / found.albedo[0][60:].mean(axis=0)
    assert reddish[:, 0].mean() == pytest.approx(1.0, abs=0.08)
    assert reddish[:, 1].mean() == pytest.approx(0.1 / 0.35, abs=0.12)


@pytest.mark.parametrize("trust", [0.0, 1.0])
def test_images_without_skin_are_an_error_with_a_sentence(trust):
    """Black images, and a face of which no sample is seen."""
    normals = unit_vectors(50, 0)[None]
    samples = SurfacePoints(np.zeros(50, dtype=np.int32), np.full((50, 3), 1 / 3))
    seen = SampleObservations(np.zeros((1, 1, 50, 3)), normals, np.full((1, 50), trust))
    with pytest.raises(InputError, match="too small, too dark or hidden"):
        estimate_appearance(np.arange(1), samples, seen, 0.5)


@pytest.fixture(scope="module")
def scene():
    """Truth, a start that is off, and an appearance learnt from true poses of other frames."""
    truth = motion(2 * N_FRAMES)
    start = take_start(MODEL, truth, truth)
    samples = sample_skin(MODEL, 2.5)
    face = start.face(samples)
    rows = range(N_FRAMES, 2 * N_FRAMES)
    views = [
        start.view(row, image_of(MODEL, mesh_of(MODEL, truth[row])), face, 1.0, 3) for row in rows
    ]
    appearance = learn_appearance(np.array(rows), views, face, samples, 0.2, 0, lambda found: None)
    rng = np.random.default_rng(5)
    off = truth[:N_FRAMES].copy()
    off[:, :3] += rng.normal(0, 0.01, (N_FRAMES, 3))
    off[:, 3:5] += rng.normal(0, 0.8, (N_FRAMES, 2))
    off[:, 6:] = np.clip(off[:, 6:] + rng.normal(0, 0.15, (N_FRAMES, 3)), 0, 1)
    return truth[:N_FRAMES], off, samples, appearance


@pytest.fixture(scope="module")
def images(scene):
    """What the camera sees of the true frames; no test may change one."""
    return [image_of(MODEL, mesh_of(MODEL, row)) for row in scene[0]]


def in_pixels(x):
    return np.stack([1200.0 * v[:, :2] / v[:, 2:] for v in (mesh_of(MODEL, row) for row in x)])


def test_refinement_finds_pose_and_expression_to_a_tenth_of_a_millimetre(scene, images):
    truth, off, samples, appearance = scene
    start = take_start(MODEL, truth, off)
    face = start.face(samples)
    problem = FrameProblem(face, appearance, SETTINGS, 0.5)
    valid = np.ones(N_FRAMES, dtype=bool)
    found = fit_frames(
        FrameChunk(start, valid, appearance, face, lambda row: images[row], 1.0), problem
    )
    refined = take_positions(start, found["x"])
    before = np.linalg.norm(in_pixels(off) - in_pixels(truth), axis=2).mean()
    after = np.linalg.norm(refined - in_pixels(truth), axis=2).mean()
    assert before > 1.5  # px, at 2.4 px/mm
    assert after < 0.25
    assert found["refined"].all()
    for row, image in enumerate(images):
        view = start.view(row, image, face, 1.0, 1)
        residual = [
            photometric_residual(*sample_errors(view, x, face, appearance)[:2])
            for x in (start.x[row], found["x"][row])
        ]
        assert residual[1] < 0.5 * residual[0]


def test_a_change_of_exposure_moves_nothing(scene, images):
    truth, off, samples, appearance = scene
    start = take_start(MODEL, truth, off)
    face = start.face(samples)
    image = images[0]
    problem = FrameProblem(face, appearance, SETTINGS, 0.5)
    fits = [
        problem.solve(start.view(0, image * np.float32(gain), face, 1.0, len(SETTINGS.iterations)))
        for gain in (1.0, 0.6)
    ]
    assert fits[0].gain == pytest.approx(1.0, abs=0.02)
    assert fits[1].gain == pytest.approx(0.6 * fits[0].gain, rel=0.01)
    moved = take_positions(start, np.stack([fit.x for fit in fits]))
    assert np.linalg.norm(moved[1] - moved[0], axis=1).mean() < 0.1  # px
    view = start.view(0, image * np.float32(0.6), face, 1.0, 1)
    errors, trust, _ = sample_errors(view, fits[1].x, face, appearance)
    assert photometric_residual(errors, trust) < 3.0


def test_each_piece_is_fitted_under_its_own_light(scene, images, tmp_path):
    truth, off, samples, appearance = scene
    start = take_start(MODEL, truth, off)
    face = start.face(samples)
    mirrored = appearance.light * np.array([1, 1, 1, -1, 1, 1, 1, 1, 1])[:, None]
    wrong = replace(
        appearance, light=0.3 * appearance.light + 0.2 * mirrored, albedo=appearance.albedo[:, ::-1]
    )
    appearance.save(tmp_path / "a.npz", {0: wrong, 1: appearance})
    read = Appearance.load_pieces(tmp_path / "a.npz")
    assert (
        sorted(read) == [0, 1]
        and (Appearance.load(tmp_path / "a.npz").light == read[1].light).all()
    )
    problems = {k: FrameProblem(face, found, SETTINGS, 0.5) for k, found in read.items()}
    first, piece = np.arange(N_FRAMES) < 2, np.ones(N_FRAMES, dtype=np.int64)
    chunk = FrameChunk(start, first, wrong, face, lambda row: images[row], 1.0, piece)
    alone = fit_frames(replace(chunk, piece=None), problems[1])
    assert np.array_equal(alone["refined"], first)
    assert np.array_equal(fit_frames(chunk, problems)["x"], alone["x"])


def test_frames_of_varying_exposure_give_one_appearance(scene, images):
    truth, _, samples, _ = scene
    truth, images = truth[:4], images[:4]
    start = take_start(MODEL, truth, truth)
    face = start.face(samples)
    gains = np.linspace(0.7, 1.4, len(truth))

    def learnt(factors):
        views = [
            start.view(row, image * np.float32(factor), face, 1.0, len(SETTINGS.iterations))
            for row, (image, factor) in enumerate(zip(images, factors, strict=True))
        ]

        def problem_of(found):
            return FrameProblem(face, found, SETTINGS, 0.5)

        return learn_appearance(np.arange(len(views)), views, face, samples, 0.2, 1, problem_of)

    even, varied = learnt(np.ones(len(truth))), learnt(gains)
    sure = (even.seen > 1.0) & (varied.seen > 1.0)
    ratio = (varied.albedo[0] / even.albedo[0])[sure]
    assert np.abs(ratio / np.median(ratio) - 1).mean() < 0.02


def take_positions(start, x):
    return np.stack([1200.0 * v[:, :2] / v[:, 2:] for v in (start.vertices(row) for row in x)])


def test_frames_that_are_not_tracked_keep_the_landmark_fit(scene):
    truth, off, samples, appearance = scene
    start = take_start(MODEL, truth, off)
    face, none = start.face(samples), np.zeros(N_FRAMES, dtype=bool)
    chunk = FrameChunk(start, none, appearance, face, lambda row: None, 1.0)
    found = fit_frames(chunk, FrameProblem(face, appearance, SETTINGS, 0.5))
    assert np.array_equal(found["x"], start.x) and not found["refined"].any()


def test_normals_change_with_the_weights_as_the_meshs_do():
    samples = sample_skin(MODEL, 5.0)
    face = SampledFace.of(MODEL, MODEL.neutral_mm, samples)
    weights, step = np.array([0.3, 0.5, 0.2]), 1e-4
    rows = np.random.default_rng(0).normal(size=(len(samples), 1, 3))
    slope = face.through_normals(weights, rows)
    for k in range(3):
        more = weights + step * np.eye(3)[k]
        change = ((face.normals(more) - face.normals(weights)) * rows[:, 0]).sum(axis=1) / step
        assert np.abs(change - slope[:, 0, k]).max() < 1e-3


def test_layer_follows_what_the_model_cannot_make(scene, images):
    truth, _, samples, appearance = scene
    near = np.exp(-((MODEL.neutral_mm[:, :2] - [5, 5]) ** 2).sum(axis=1) / (2 * 15.0**2))
    bulge = near[:, None] * np.array([2.0, -1.0, 0.0])
    start = take_start(MODEL, truth, truth)
    face = start.face(samples)
    image = image_of(MODEL, mesh_of(MODEL, truth[0], bulge))
    view = start.view(0, image, face, 1.0, 3)
    layer = OffsetSolver(MODEL, MODEL.neutral_mm, face, appearance, OffsetSettings())
    found = layer.solve(view)
    missed = np.linalg.norm(found - bulge, axis=1)
    assert near @ missed < 0.3 * near @ np.linalg.norm(bulge, axis=1)
    in_camera = found @ (rotation_matrix(view.start[:3]) @ view.reference).T
    assert np.abs(in_camera[:, 2]).max() < 1e-9
    still = layer.solve(start.view(0, images[0], face, 1.0, 3))
    assert np.linalg.norm(still, axis=1).mean() < 0.15  # mm


def test_joined_frames_keep_steady_motion_and_lose_noise():
    n, p = 60, 9
    rng = np.random.default_rng(1)
    steady = np.linspace(0.2, 0.8, n)[:, None] * np.ones(p)
    noisy = steady + 0.02 * rng.normal(size=(n, p))
    matrices = np.tile(np.eye(p) * 4.0, (n, 1, 1))
    everything = np.ones(n, dtype=bool)
    settings = LandmarkFitSettings()
    timeline = Timeline.of(n, 30.0)
    typical = settings.typical_acceleration(p - N_POSE)

    def smoothed(x, known):
        smoothness = TemporalSmoothness(typical, timeline, known, np.ones((n, p)))
        return smooth_over_time(matrices, 4.0 * x, x, known, smoothness)

    same = smoothed(steady, everything)
    assert np.abs(same - steady).max() < 1e-9
    smooth = smoothed(noisy, everything)
    assert np.abs(smooth - steady)[:, 6:].mean() < 0.6 * np.abs(noisy - steady)[:, 6:].mean()
    backwards = smoothed(noisy[::-1], everything)
    assert np.abs(backwards[::-1] - smooth).max() < 1e-6
    holes = everything.copy()
    holes[10] = False
    assert np.allclose(smoothed(noisy, holes)[10], noisy[10])


def test_chosen_frames_are_well_fitted_and_differ():
    x = np.zeros((20, 8))
    x[:, 6] = np.linspace(0, 1, 20)
    error, valid = np.full(20, 2.0), np.ones(20, dtype=bool)
    error[19], valid[0], error[5] = 9.0, False, 1.0
    chosen = choose_appearance_frames(x, valid, error, 4)
    assert 5 in chosen and 18 in chosen and 19 not in chosen and 0 not in chosen
    assert len(chosen) == 4
    assert len(choose_appearance_frames(x, np.zeros(20, dtype=bool), error, 4)) == 0


def test_ablations_tell_frames_that_taught_the_appearance_from_others():
    table = pd.DataFrame(
        {
            "subject": "s", "take": "t", "step": ["landmarks"] * 3 + ["image_fit"] * 3,
            "frame": [0, 1, 2] * 2, "residual": [1.0, 3.0, np.nan, 0.5, 1.5, 2.5],
            "learnt_from": [1, 0, 0] * 2,
        }
    )  # fmt: skip
    rows = ablation_rows(table)
    assert list(rows["step"]) == ["landmarks", "image_fit"]
    assert list(rows["residual"]) == [2.0, 1.5]
    assert list(rows["held_out"]) == [3.0, 2.0]
    assert list(rows["frames"]) == [2, 3]


def test_ablations_say_which_residuals_compare():
    steps = ["image_fit", "before_flow", "flow", "before_relief", "relief"]
    table = pd.DataFrame(
        {"subject": "s", "take": "t", "step": steps, "frame": 0, "residual": [2.0, 4, 3, 5, 4]}
    )
    bases = ablation_rows(table).set_index("step")["basis"]
    assert bases["before_flow"] == bases["flow"]
    assert bases["before_relief"] == bases["relief"]
    assert len(set(bases)) == 3
