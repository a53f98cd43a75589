"""Facts about the generated head: a closed skin, a plausible mouth, expressions that behave."""

from __future__ import annotations

import numpy as np
import pytest

from tests.heads import small_tracker
from vermilion.faces.model import REGIONS, FaceModel
from vermilion.faces.procedural import studio_model, template_model, tracker_model
from vermilion.mesh import boundary_edges, triangle_areas, unique_edges, vertex_normals
from vermilion.raycast import RayCaster

SLIGHTLY_OPEN = 0.09


@pytest.fixture(scope="module")
def studio() -> FaceModel:
    return studio_model(seed=None)


@pytest.fixture(scope="module")
def template() -> FaceModel:
    return template_model(SLIGHTLY_OPEN)


@pytest.fixture(scope="module")
def tracker() -> FaceModel:
    return tracker_model(6000)


@pytest.fixture(scope="module", params=["studio", "template", "tracker"])
def part(request) -> FaceModel:
    return request.getfixturevalue(request.param)


def weights_of(model: FaceModel, **weights: float) -> np.ndarray:
    result = np.zeros(model.n_expressions)
    for name, value in weights.items():
        result[model.expression_names.index(name)] = value
    return result


def mouth(model: FaceModel, jaw: float = SLIGHTLY_OPEN, identity=None, **weights) -> np.ndarray:
    return model.vertices(identity, weights_of(model, **({"jawOpen": jaw} | weights)))


def lip_triangles(model: FaceModel, which: str) -> np.ndarray:
    """Triangles of one lip with its inner fold, told apart by where the neutral's lips meet."""
    other = "vermilion_lower" if which == "vermilion_upper" else "vermilion_upper"
    loop = model.neutral_mm[model.inner_contour]
    line_y = np.interp(model.neutral_mm[:, 0], np.sort(loop[:, 0]), loop[np.argsort(loop[:, 0]), 1])
    above = model.neutral_mm[:, 1] > line_y
    inner = model.regions["mouth_inner"] & (above if which == "vermilion_upper" else ~above)
    inner &= model.neutral_mm[:, 2] > model.neutral_mm[model.inner_contour, 2].max() - 7.0
    keep = (model.regions[which] & ~model.regions[other]) | inner
    return model.triangles[keep[model.triangles].all(axis=1)]


def lip_gap_mm(model: FaceModel, vertices: np.ndarray) -> float:
    """Least vertical distance from the lower lip's top to the upper lip's underside."""
    x, z = np.meshgrid(np.arange(-30, 30, 0.5), np.arange(60, 115, 0.5))
    below, above = np.stack([x, 0 * x - 200, z], -1), np.stack([x, 0 * x + 200, z], -1)
    up = np.broadcast_to([0.0, 1.0, 0.0], below.shape)
    upper = RayCaster(vertices, lip_triangles(model, "vermilion_upper")).cast(below, up)
    lower = RayCaster(vertices, lip_triangles(model, "vermilion_lower")).cast(above, -up)
    gap = (upper.distance_mm - 200.0) - (200.0 - lower.distance_mm)
    return float(gap[upper.hit & lower.hit].min(initial=np.inf))


def aperture_mm(model: FaceModel, vertices: np.ndarray) -> float:
    """Distance between the middles of the inner contours."""
    ids = model.landmarks
    return float(np.linalg.norm(vertices[ids[60]] - vertices[ids[64]]))


def visible_red_mm2(model: FaceModel, vertices: np.ndarray, region: str) -> float:
    """Area of a lip's red in an orthographic frontal view."""
    step = 0.4
    x, y = np.meshgrid(np.arange(-35, 35, step), np.arange(-75, -15, step))
    origins = np.stack([x, y, 0 * x + 300], -1)
    hits = RayCaster(vertices, model.triangles).cast(
        origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    )
    red = model.regions[region][model.triangles[np.maximum(hits.triangle, 0)]].all(axis=-1)
    return float((red & hits.hit).sum() * step**2)


# -- topology ------------------------------------------------------------------------------------


def test_every_edge_joins_two_triangles_consistently_or_lies_on_a_rim(part):
    t = part.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    assert len(np.unique(directed, axis=0)) == len(directed), "an edge runs the same way twice"
    starts = boundary_edges(t)[:, 0]
    assert len(np.unique(starts)) == len(starts), "two rims touch"
    assert len(np.unique(t)) == part.n_vertices, "a vertex without a triangle"


def test_rims_are_the_neck_the_lids_and_the_end_of_the_fold(studio, template):
    def rims(model: FaceModel) -> int:
        after = dict(boundary_edges(model.triangles).tolist())
        loops = 0
        while after:
            loops += 1
            at = next(iter(after))
            while at in after:
                at = after.pop(at)
        return loops

    assert rims(studio) == 3  # the socket is closed
    assert rims(template) == 4


def test_triangles_face_outwards(studio, tracker):
    for model in (studio, tracker):
        skin = ~(model.regions["mouth_inner"] | model.regions["eyes"] | model.regions["teeth"])
        used = np.zeros(model.n_vertices, dtype=bool)
        used[model.landmarks[:36]] = True
        normals = vertex_normals(model.neutral_mm, model.triangles)
        outward = (normals * (model.neutral_mm - [0, 0, 20])).sum(axis=1)
        assert (outward[used & skin] > 0).all()
        tip = model.landmarks[30]
        assert normals[tip, 2] > 0.3


def test_parts_have_their_own_topologies(studio, template, tracker):
    assert 12_000 <= studio.n_vertices <= 25_000
    assert 6_000 <= template.n_vertices <= 11_000
    assert 2_500 <= tracker.n_vertices <= 4_000
    assert abs(len(tracker.triangles) - 6000) < 300
    assert template.n_expressions == 0
    assert not any("Roll" in n or "Press" in n or "Funnel" in n for n in tracker.expression_names)
    assert set(tracker.expression_names) < set(studio.expression_names)


def test_building_twice_gives_the_same_model():
    a, b = small_tracker(), tracker_model(2500, n_identities=4)
    np.testing.assert_array_equal(a.neutral_mm, b.neutral_mm)
    np.testing.assert_array_equal(a.triangles, b.triangles)
    np.testing.assert_array_equal(a.expressions_mm, b.expressions_mm)


# -- proportions ---------------------------------------------------------------------------------


def test_proportions_are_an_adults(studio):
    p = studio.neutral_mm[studio.landmarks]
    assert 145 < np.ptp(studio.neutral_mm[studio.regions["face"], 0]) < 160
    pupils = np.linalg.norm((p[36] + p[39]) / 2 - (p[42] + p[45]) / 2)
    assert pupils == pytest.approx(63, abs=2)
    assert np.linalg.norm(p[58] - p[62]) == pytest.approx(52, abs=1)
    assert 105 < p[27, 1] - p[8, 1] < 125  # nasion to menton


def test_landmarks_are_symmetric_and_in_order(part):
    p = part.neutral_mm[part.landmarks]
    pairs = [(k, 16 - k) for k in range(8)] + [(17 + k, 26 - k) for k in range(5)]
    pairs += [(31, 35), (32, 34), (36, 45), (37, 44), (38, 43), (39, 42), (40, 47), (41, 46)]
    pairs += [(48, 52), (49, 51), (57, 53), (56, 54), (58, 62), (59, 61), (65, 63)]
    right, left = p[[a for a, _ in pairs]], p[[b for _, b in pairs]]
    # Skin vertices are the nearest of a mesh that need not be symmetric; the jaw's are far apart.
    spacing_mm = 9.0 if part.n_vertices < 5000 else 5.0
    assert np.linalg.norm(right * [-1, 1, 1] - left, axis=1).max() < spacing_mm
    assert (right[:, 0] < 0).all()
    np.testing.assert_allclose(right[-15:] * [-1, 1, 1], left[-15:], atol=0.6)  # eyes and lips
    assert len(np.unique(part.landmarks)) == 66


def test_regions_are_plausible(part):
    assert set(part.regions) == set(REGIONS)
    areas = triangle_areas(part.neutral_mm, part.triangles)

    def area(name: str) -> float:
        return float(areas[part.regions[name][part.triangles].all(axis=1)].sum())

    assert 350 < area("vermilion_upper") < 550  # mm2
    assert 400 < area("vermilion_lower") < 650
    assert 25_000 < area("face") < 60_000
    assert area("rigid") > 1_000
    assert not (part.regions["mouth_inner"] & part.regions["face"]).any()


def test_contours_are_closed_loops_of_edges_with_the_corners(part):
    edges = {tuple(e) for e in unique_edges(part.triangles).tolist()}
    for loop in (part.outer_contour, part.inner_contour):
        steps = np.sort(np.stack([loop, np.roll(loop, -1)], axis=1), axis=1)
        assert all(tuple(step) in edges for step in steps.tolist())
    assert {part.landmarks[58], part.landmarks[62]} <= set(part.outer_contour)


def test_uv_lie_in_the_unit_square_and_do_not_fold_on_face_and_lips(part):
    assert part.uv.min() >= 0 and part.uv.max() <= 1
    skin = part.regions["face"] | part.regions["mouth_inner"]
    a, b, c = (part.uv[part.triangles[skin[part.triangles].all(axis=1)][:, k]] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (signed > 0).mean() > 0.995


# -- expressions ---------------------------------------------------------------------------------


def test_lips_are_parted_when_slightly_open(studio, template):
    assert 2.0 < aperture_mm(studio, mouth(studio)) < 3.5
    assert 2.0 < aperture_mm(template, template.neutral_mm) < 3.5
    assert aperture_mm(studio, studio.neutral_mm) < 0.5


def test_jaw_opens_the_mouth_by_an_adults_aperture(studio):
    apertures = [aperture_mm(studio, mouth(studio, jaw)) for jaw in (0.0, 0.5, 1.0)]
    assert apertures[0] < apertures[1] < apertures[2]
    assert 24 < apertures[2] < 32


def test_lips_do_not_pass_through_each_other(studio):
    quiet = ("brow", "eye", "jawOpen", "mouthClose")
    for name in studio.expression_names:
        if not name.startswith(quiet):
            assert lip_gap_mm(studio, mouth(studio, **{name: 1.0})) >= -0.3, name
    assert lip_gap_mm(studio, mouth(studio, jaw=1.0, mouthClose=1.0)) >= -0.3


@pytest.mark.parametrize(
    "names",
    [
        ("mouthSmile_L", "mouthSmile_R"),
        ("mouthFrown_L", "mouthFrown_R"),
        ("mouthPress_L", "mouthPress_R"),
        ("mouthRollUpper", "mouthRollLower"),
        ("mouthRollOutUpper", "mouthRollOutLower"),
        ("mouthPucker", "mouthFunnel"),
        ("mouthPucker", "mouthRollLower"),
    ],
)
def test_common_combinations_keep_the_lips_apart(studio, names):
    assert lip_gap_mm(studio, mouth(studio, **dict.fromkeys(names, 1.0))) >= -0.3


def test_rolls_hide_the_red_of_their_lip_alone(studio):
    rest = {n: visible_red_mm2(studio, mouth(studio), f"vermilion_{n}") for n in ("upper", "lower")}
    for name, lip, other in (
        ("mouthRollUpper", "upper", "lower"),
        ("mouthRollLower", "lower", "upper"),
    ):
        rolled = mouth(studio, **{name: 1.0})
        assert visible_red_mm2(studio, rolled, f"vermilion_{lip}") < 0.7 * rest[lip]
        assert visible_red_mm2(studio, rolled, f"vermilion_{other}") > 0.9 * rest[other]


def test_mouth_close_undoes_the_jaws_parting(studio):
    closed = mouth(studio, jaw=1.0, mouthClose=1.0)
    assert aperture_mm(studio, closed) < 1.5
    teeth = studio.regions["teeth"]
    moved = np.linalg.norm(closed[teeth] - studio.neutral_mm[teeth], axis=1)
    assert moved.max() > 15  # the jaw stays open


def test_left_and_right_shapes_mirror_each_other(studio):
    left = studio.expressions_mm[studio.expression_names.index("mouthSmile_L")]
    right = studio.expressions_mm[studio.expression_names.index("mouthSmile_R")]
    ring = studio.outer_contour
    n = len(ring)
    mirrored = ring[(n // 2 - np.arange(n)) % n]
    np.testing.assert_allclose(left[ring] * [-1, 1, 1], right[mirrored], atol=0.05)


def test_displacements_are_bounded_and_leave_the_rigid_region(studio, tracker):
    for model in (studio, tracker):
        size = np.linalg.norm(model.expressions_mm, axis=-1)
        assert size.max() < 45
        assert size[:, model.regions["rigid"]].max() < 0.5
        back = model.neutral_mm[:, 2] < -35
        assert size[:, back].max() < 1e-3


def test_eyelids_close_without_the_eyeball_showing(studio):
    for weight in (0.5, 1.0):
        v = mouth(studio, eyeBlink_L=weight)
        eye = studio.regions["eyes"] & (studio.neutral_mm[:, 0] > 0)
        x, y = np.meshgrid(np.arange(20, 44, 0.5), np.arange(20, 36, 0.5))
        origins = np.stack([x, y, 0 * x + 300], -1)
        hits = RayCaster(v, studio.triangles).cast(
            origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
        )
        seen = eye[studio.triangles[np.maximum(hits.triangle, 0)]].all(axis=-1) & hits.hit
        assert (seen.sum() * 0.25 < 6.0) if weight == 1.0 else (40 < seen.sum() * 0.25 < 160)  # mm2


# -- people --------------------------------------------------------------------------------------


def test_people_differ_and_keep_their_lips_apart(studio):
    rng = np.random.default_rng(3)
    people = rng.normal(size=(3, studio.n_identities)).clip(-2, 2)
    neutrals = [studio.neutral_of(p) for p in people]
    face = studio.regions["face"]
    for k, p in enumerate(people):
        assert lip_gap_mm(studio, mouth(studio, identity=p)) >= -0.3
        difference = np.linalg.norm(neutrals[k] - neutrals[k - 1], axis=1)[face]
        assert 0.5 < difference.mean() < 8


def test_lip_modes_change_the_height_of_the_red(studio):
    rest = visible_red_mm2(studio, studio.neutral_mm, "vermilion_lower")
    fuller = studio.neutral_of(np.eye(studio.n_identities)[3] * 2)
    assert visible_red_mm2(studio, fuller, "vermilion_lower") > 1.1 * rest


def test_seeds_make_small_asymmetries():
    odd = studio_model(spacing_mm=2.5, seed=5)
    p = odd.neutral_mm[odd.landmarks]
    assert 0.02 < abs(p[58, 0] + p[62, 0]) + abs(p[58, 1] - p[62, 1]) < 4.0


def test_the_same_face_at_three_resolutions(studio, template, tracker):
    for k in (30, 48, 50, 55, 58, 62):
        points = [m.neutral_mm[m.landmarks[k]] for m in (studio, tracker)]
        assert np.linalg.norm(points[0] - points[1]) < 2.0
    assert template.n_identities == tracker.n_identities == studio.n_identities


def test_a_saved_model_comes_back(tmp_path, tracker):
    path = tmp_path / "tracker.npz"
    tracker.save(path)
    loaded = FaceModel.load(path)
    np.testing.assert_array_equal(loaded.triangles, tracker.triangles)
    np.testing.assert_allclose(loaded.neutral_mm, tracker.neutral_mm)
    assert loaded.expression_names == tracker.expression_names
    for name in REGIONS:
        np.testing.assert_array_equal(loaded.regions[name], tracker.regions[name])
