"""Inpainting: textures, the tattoo's mask, shading, compositing."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests import lip_patch
from vermilion.draw import to_display
from vermilion.errors import InputError
from vermilion.inpaint.bake import Texture, bake
from vermilion.inpaint.composite import Layer, Window, composite
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.fields import fill_holes, sample, weighted_blur
from vermilion.inpaint.files import read_texture, write_texture
from vermilion.inpaint.grain import add_grain, fine_deviation, seed_of
from vermilion.inpaint.opening import Evidence, find_opening
from vermilion.inpaint.paint import Paint, paint_frame
from vermilion.inpaint.shading import Shading, bare_skin, change_ratio
from vermilion.inpaint.tattoo import feathered, tattoo_mask
from vermilion.raycast import RayCaster

POSES = {"rest": (0.0, 0.0), "open": (7.0, 0.1), "pucker": (1.0, 1.0)}


@pytest.fixture(scope="module")
def model():
    return lip_patch.face_model()


@pytest.fixture(scope="module")
def domain(model):
    return lip_domain(model, skin_mm=9.0, inner_mm=4.0, texel_mm=0.3)


@pytest.fixture(scope="module")
def textures(model, domain):
    """Plain and tattooed neutral from all cameras, tattooed neutral from the front."""
    rest, rig = model.neutral_mm, lip_patch.cameras()

    def baked(tattoo, names):
        views = [(rig[n], lip_patch.render(model, rest, rig[n], tattoo)) for n in names]
        return bake(domain, rest, model.triangles, views)

    return baked(False, rig), baked(True, rig), baked(True, ["front"])


@pytest.fixture(scope="module")
def opacity(domain, textures):
    mask = tattoo_mask(domain, textures[1], textures[0], reach_mm=4.0, sensitivity=6.0)
    return feathered(domain, mask, border_mm=0.6, feather_mm=1.0)


# Fields


def test_sampling_is_exact_at_pixel_centres_and_linear_between():
    image = np.random.default_rng(0).random((7, 9, 3)).astype(np.float32)
    assert np.allclose(sample(image, np.array([[3.5, 2.5]])), image[2, 3])
    between = sample(image, np.array([4.0, 2.5]))
    assert np.allclose(between, (image[2, 3] + image[2, 4]) / 2, atol=1e-3)


def test_holes_of_a_constant_are_filled_with_it():
    known = np.zeros((40, 50), dtype=bool)
    known[:, :6] = True
    filled = fill_holes(np.where(known, 0.7, 9.0), known)
    assert np.allclose(filled, 0.7, atol=1e-4)


def test_a_weighted_blur_ignores_what_has_no_weight():
    values = np.where(np.arange(40) < 20, 1.0, 100.0)[None].repeat(40, axis=0)
    mean, _ = weighted_blur(values, values < 50, 3.0)
    assert np.allclose(mean[:, :20], 1.0, atol=1e-4)


# Domain


def test_texels_lie_where_the_chart_says(model, domain):
    triangle, barycentric = domain.texels()
    place = (domain.texel_of_vertex[model.triangles[triangle]] * barycentric[..., None]).sum(axis=1)
    y, x = np.nonzero(domain.valid)
    assert np.abs(place - np.stack([x + 0.5, y + 0.5], axis=1)).max() < 0.01  # texels


def test_the_domain_is_the_lips_and_what_is_near(model, domain):
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    assert domain.in_domain[lips[model.triangles].all(axis=1)].all()
    assert (domain.lip_distance_mm[domain.valid] < 9.5).all()
    triangle, _ = domain.texels()
    on_lips = lips[model.triangles[triangle]].all(axis=1)
    assert (domain.lip_distance_mm[domain.valid][on_lips] == 0).all()
    assert domain.inner.any() and (domain.lip_distance_mm[domain.inner] < 4.5).all()


def test_distances_are_lengths_on_the_skin_whatever_the_chart(domain):
    y, x = np.argwhere(domain.valid & (domain.lip_distance_mm > 4.0))[0]
    source = np.zeros(domain.shape, dtype=bool)
    source[y, x] = True
    distance = domain.distance_mm(source, 6.0)
    straight = np.linalg.norm(domain.position_mm - domain.position_mm[y, x], axis=2)
    near = np.isfinite(distance) & (straight > 1.0)
    assert near.sum() > 50
    assert (distance[near] >= straight[near] - 1e-3).all()
    assert np.median(distance[near] / straight[near]) < 1.12
    assert np.isinf(domain.distance_mm(np.zeros(domain.shape, bool), 6.0)).all()


def test_a_model_without_lips_is_refused(model):
    regions = {name: np.zeros(model.n_vertices, dtype=bool) for name in model.regions}
    blank = type(model)(**{**model.__dict__, "regions": regions})
    with pytest.raises(InputError, match="vermilion"):
        lip_domain(blank, 9.0, 4.0, 0.3)


def test_textures_survive_the_disc_and_name_a_wrong_domain(tmp_path, model, domain, textures):
    write_texture(tmp_path / "t.exr", textures[0], {"opacity": domain.valid.astype(np.float32)})
    texture, more = read_texture(tmp_path / "t.exr", domain)
    assert np.allclose(texture.rgb, textures[0].rgb, atol=1e-3)
    assert (texture.seen == textures[0].seen).all() and (more["opacity"] == domain.valid).all()
    other = lip_domain(model, 9.0, 4.0, 0.4)
    with pytest.raises(InputError, match="texture of"):
        read_texture(tmp_path / "t.exr", other, subject="s1")


# Baking


def test_a_white_mesh_bakes_white_and_the_hidden_inside_stays_unseen(model, domain):
    camera = lip_patch.cameras()["front"]
    white = np.ones((180, 240, 3), np.float32)
    texture = bake(domain, model.neutral_mm, model.triangles, [(camera, white)])
    assert np.allclose(texture.rgb[texture.seen], 1.0, atol=1e-5)
    assert texture.seen[domain.valid & ~domain.inner].mean() > 0.8
    assert texture.seen[domain.inner].mean() < 0.2


def test_views_of_another_exposure_are_brought_to_the_first(model, domain):
    rig = lip_patch.cameras()
    views = [
        (rig[name], lip_patch.render(model, model.neutral_mm, rig[name], False, light))
        for name, light in (("front", 1.0), ("left", 0.9))
    ]
    both = bake(domain, model.neutral_mm, model.triangles, views)
    alone = bake(domain, model.neutral_mm, model.triangles, views[:1])
    seen = both.seen & alone.seen
    assert np.median(both.rgb[seen] / alone.rgb[seen]) == pytest.approx(1.0, abs=0.02)


# The tattoo's mask


def test_the_mask_is_the_tattoo_that_reaches_past_the_lips(domain, textures):
    mask = tattoo_mask(domain, textures[1], textures[0], reach_mm=4.0, sensitivity=6.0)
    outside = ~domain.inner & domain.valid
    assert mask[outside & (domain.lip_distance_mm < 0.8)].mean() > 0.95
    assert mask[outside & (domain.lip_distance_mm > 2.5)].mean() < 0.02


def test_without_a_tattoo_only_the_lips_are_painted(domain, textures):
    mask = tattoo_mask(domain, textures[0], textures[0], reach_mm=4.0, sensitivity=6.0)
    assert not mask[~domain.inner & (domain.lip_distance_mm > 1.0)].any()


def test_the_feather_falls_from_one_to_zero_over_its_width(domain):
    mask = domain.valid & (domain.lip_distance_mm < 1.0)
    opacity = feathered(domain, mask, border_mm=1.0, feather_mm=2.0)
    distance = domain.distance_mm(mask, 10.0)
    assert (opacity[domain.valid & (distance < 1.0)] == 1).all()
    assert (opacity[distance > 3.01] == 0).all()
    middle = opacity[domain.valid & (np.abs(distance - 2.0) < 0.1)]
    assert middle.mean() == pytest.approx(0.5, abs=0.06)


# Shading


def test_the_change_of_light_is_found_whatever_the_tattoo(domain):
    rng = np.random.default_rng(0)
    ink = np.where(rng.random((*domain.shape, 1)) > 0.5, 0.7, 0.08) * np.ones(3)
    weight = domain.valid.astype(np.float32)
    x = np.arange(domain.shape[1])[None] / domain.shape[1]
    light = (0.8 + 0.5 * x) * np.ones(domain.shape)
    reference = Texture((ink * weight[..., None]).astype(np.float32), weight)
    frame = Texture((ink * (weight * light)[..., None]).astype(np.float32), weight)
    ratio = change_ratio(domain, reference, frame, Shading())
    assert np.median(np.abs(ratio / light - 1)[domain.valid]) < 0.03


def test_bare_skin_keeps_its_distance(domain, opacity):
    bare = bare_skin(domain, opacity, 1.0)
    painted = domain.distance_mm(opacity > 0, 10.0)
    assert bare.any() and not bare[domain.inner].any()
    assert painted[bare].min() > 1.0


# Compositing


def test_pixels_without_paint_keep_their_bits():
    rng = np.random.default_rng(0)
    picture = rng.random((30, 40, 3)).astype(np.float32)
    opacity = np.zeros((12, 16), np.float32)
    opacity[5:8, 5:8] = 1.0
    opened = np.zeros_like(opacity)
    opened[:, 12:] = 1.0  # the mouth, further from the paint than the rim
    layer = Layer(Window(10, 8, 16, 12), opacity[..., None] * np.float32(0.5), opacity, opened)
    result = composite(picture, layer, rim_px=2.0)
    same = np.ones((30, 40), bool)
    same[8 + 5 : 8 + 8, 10 + 5 : 10 + 8] = False
    assert np.array_equal(result[same], picture[same])
    assert np.allclose(result[~same], 0.5)


def test_noise_has_the_deviation_asked_for_and_its_seed():
    grey = np.full((80, 80, 3), 0.3, np.float32)
    opacity = np.ones((80, 80), np.float32)
    noisy = add_grain(grey, opacity, 0.02, seed_of(0, "s", "t", 3))
    assert np.array_equal(noisy, add_grain(grey, opacity, 0.02, seed_of(0, "s", "t", 3)))
    assert not np.array_equal(noisy, add_grain(grey, opacity, 0.02, seed_of(0, "s", "t", 4)))
    assert fine_deviation(noisy, opacity > 0) == pytest.approx(0.02, rel=0.3)


# The whole


def psnr_db(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> float:
    error = (to_display(a)[where].astype(float) - to_display(b)[where].astype(float)) / 255
    return float(-10 * np.log10((error**2).mean()))


@pytest.mark.parametrize("pose", POSES)
def test_a_painted_frame_looks_as_if_never_tattooed(model, domain, textures, opacity, pose):
    vertices = lip_patch.vertices_at(*POSES[pose])
    camera = lip_patch.cameras()["front"]
    tattooed = lip_patch.render(model, vertices, camera, tattoo=True)
    truth = lip_patch.render(model, vertices, camera, tattoo=False)
    paint = Paint(domain, textures[0], textures[2], opacity, Shading(), 0.3, 0.0, grain=False)
    painted = paint_frame(paint, tattooed, camera, vertices, model.triangles, (0,))
    where = np.abs(to_display(tattooed).astype(int) - to_display(truth)).max(axis=2) > 20
    where = cv2.dilate(where.astype(np.uint8), np.ones((3, 3))) > 0
    telea = cv2.inpaint(to_display(tattooed), where.astype(np.uint8), 4, cv2.INPAINT_TELEA)
    telea_db = -10 * np.log10(
        (((telea[where].astype(float) - to_display(truth)[where]) / 255) ** 2).mean()
    )
    ours_db = psnr_db(painted.linear, truth, where)
    assert ours_db >= 30.0
    assert ours_db > telea_db + 5.0
    assert painted.border_levels < 2.0
    far = np.ones(where.shape, bool)
    far[painted.window.slices] = False
    assert np.array_equal(painted.linear[far], tattooed[far])


def test_lips_outside_the_picture_are_left_alone(model, domain, textures, opacity):
    camera = lip_patch.cameras()["front"]
    paint = Paint(domain, textures[0], textures[2], opacity, Shading())
    away = model.neutral_mm + np.array([500.0, 0.0, 0.0])
    blank = np.zeros((180, 240, 3), np.float32)
    assert paint_frame(paint, blank, camera, away, model.triangles, (0,)) is None


# The mouth opening


@pytest.fixture(scope="module")
def open_mouth(model):
    """The tattooed mouth, open, seen from the front."""
    camera = lip_patch.cameras()["front"]
    vertices = lip_patch.vertices_at(*POSES["open"])
    return camera, vertices, lip_patch.render(model, vertices, camera, tattoo=True)


def opening_of(model, domain, camera, picture, vertices, **evidence):
    ends = camera.project(vertices[domain.corners])
    axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    box = (np.zeros(2), np.array([camera.width_px, camera.height_px]))
    caster = RayCaster(vertices, model.triangles)
    return find_opening(domain, caster, camera, picture, axis, box, 1 / 3, Evidence(**evidence))


def wrong_pixels(opening, open_mouth, model) -> int:
    """Pixels whose middle is inked but counted open, or the other way."""
    camera, vertices, _ = open_mouth
    hit = RayCaster(vertices, model.triangles).see(camera).hit
    found = opening.inside(camera.pixel_grid())
    middle = np.abs(camera.pixel_grid() - [120, 90]) < [30, 60]  # away from the corners
    return int((found == hit)[middle.all(axis=-1) & (found | ~hit)].sum())


def lower_lip_raised(vertices: np.ndarray, up_mm: float) -> np.ndarray:
    return vertices + np.where(vertices[:, 1:2] < -1.0, [0.0, up_mm, 0.0], 0.0)


def test_the_opening_is_found_where_the_mesh_has_it_wrong(model, domain, open_mouth):
    camera, vertices, picture = open_mouth
    wrong = lower_lip_raised(vertices, 1.5)
    believed = opening_of(model, domain, camera, picture, wrong, reach_mm=0.0)
    found = opening_of(model, domain, camera, picture, wrong)
    assert wrong_pixels(believed, open_mouth, model) > 150
    assert wrong_pixels(found, open_mouth, model) < 0.35 * wrong_pixels(believed, open_mouth, model)


def test_an_opening_that_the_mesh_has_right_stays(model, domain, open_mouth):
    camera, vertices, picture = open_mouth
    mesh = opening_of(model, domain, camera, picture, vertices, reach_mm=0.0)
    found = opening_of(model, domain, camera, picture, vertices)
    step_mm = np.linalg.norm(found.across_px) / 3
    middle = slice(len(found.columns) // 4, -len(found.columns) // 4)
    assert np.abs(found.upper - mesh.upper)[middle].max() * step_mm < 0.5
    assert np.abs(found.lower - mesh.lower)[middle].max() * step_mm < 0.5


def test_what_lies_behind_the_lips_is_not_painted(model, domain, textures, opacity, open_mouth):
    camera, vertices, picture = open_mouth
    paint = Paint(domain, textures[0], textures[2], opacity, Shading(), 0.3, 0.0, 0.0, grain=False)
    wrong = lower_lip_raised(vertices, 1.5)
    painted = paint_frame(paint, picture, camera, wrong, model.triangles, (0,))
    behind = ~RayCaster(vertices, model.triangles).see(camera).hit
    behind = cv2.erode(behind.astype(np.uint8), np.ones((5, 5))) > 0
    changed = np.abs(painted.linear - picture).max(axis=2) > 0.02
    assert changed[behind].mean() < 0.01


def test_a_shadow_between_the_lips_is_kept(model, domain, textures, opacity):
    camera, vertices = lip_patch.cameras()["front"], model.neutral_mm
    paint = Paint(domain, textures[0], textures[2], opacity, Shading(), 0.3, 0.0, 0.0, grain=False)
    flat = replace(paint, shading=Shading(seam_mm=0.0))
    middle = camera.project(np.zeros((1, 3)))[0, 1]
    away = np.abs(camera.pixel_grid()[..., 1] - middle)
    shadow = np.clip(away / 6.0, 0.3, 1.0).astype(np.float32)[..., None]
    inked, truth = (
        lip_patch.render(model, vertices, camera, tattoo) * shadow for tattoo in (True, False)
    )
    lips = (opening_rim(model, camera, vertices)) & (away < 7.0)
    with_seam, without = (
        psnr_db(paint_frame(p, inked, camera, vertices, model.triangles, (0,)).linear, truth, lips)
        for p in (paint, flat)
    )
    assert with_seam > without + 2.0


def opening_rim(model, camera, vertices) -> np.ndarray:
    """Pixels of the vermilion."""
    hits = RayCaster(vertices, model.triangles).see(camera)
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    return hits.hit & lips[model.triangles].all(axis=1)[hits.triangle]
