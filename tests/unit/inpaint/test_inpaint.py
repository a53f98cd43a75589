"""Inpainting: textures, the tattoo's mask, shading, compositing."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests import lip_patch
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.draw import to_display
from vermilion.imaging.images import linear_to_srgb
from vermilion.inpaint import frame, grain, opening_search
from vermilion.inpaint.bake import Texture, bake
from vermilion.inpaint.composite import Layer, Window, composite
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.fields import fill_holes, sample, weighted_blur
from vermilion.inpaint.files import read_texture, write_texture
from vermilion.inpaint.frame import InpaintInputs, inpaint_frame
from vermilion.inpaint.grain import add_grain, fine_deviation, noise_seed
from vermilion.inpaint.shading import ShadingSettings, bare_skin, change_ratio
from vermilion.inpaint.tattoo import feather_mask, tattoo_mask
from vermilion.storage.errors import InputError

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


def rest_caster(model) -> RayCaster:
    return RayCaster(model.neutral_mm, model.triangles)


def test_a_white_mesh_bakes_white_and_the_hidden_inside_stays_unseen(model, domain):
    camera = lip_patch.cameras()["front"]
    white = np.ones((180, 240, 3), np.float32)
    texture = bake(domain, rest_caster(model), model.neutral_mm, [(camera, white)])
    assert np.allclose(texture.rgb[texture.seen], 1.0, atol=1e-5)
    assert texture.seen[domain.valid & ~domain.inner].mean() > 0.8
    assert texture.seen[domain.inner].mean() < 0.2


def test_views_of_another_exposure_are_brought_to_the_first(model, domain):
    rig = lip_patch.cameras()
    views = [
        (rig[name], lip_patch.render(model, model.neutral_mm, rig[name], False, light))
        for name, light in (("front", 1.0), ("left", 0.9))
    ]
    both = bake(domain, rest_caster(model), model.neutral_mm, views)
    alone = bake(domain, rest_caster(model), model.neutral_mm, views[:1])
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
    opacity = feather_mask(domain, mask, border_mm=1.0, feather_mm=2.0)
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
    ratio = change_ratio(domain, reference, frame, ShadingSettings())
    assert np.median(np.abs(ratio / light - 1)[domain.valid]) < 0.03


def test_bare_skin_keeps_its_distance(domain, opacity):
    bare = bare_skin(domain, opacity, 1.0)
    painted = domain.distance_mm(opacity > 0, 10.0)
    assert bare.any() and not bare[domain.inner].any()
    assert painted[bare].min() > 1.0


# Compositing


def test_pixels_without_paint_keep_their_bits():
    rng = np.random.default_rng(0)
    image = rng.random((30, 40, 3)).astype(np.float32)
    opacity = np.zeros((12, 16), np.float32)
    opacity[5:8, 5:8] = 1.0
    opened = np.zeros_like(opacity)
    opened[:, 12:] = 1.0  # the mouth, further from the paint than the rim
    layer = Layer(Window(10, 8, 16, 12), opacity[..., None] * np.float32(0.5), opacity, opened)
    result = composite(image, layer, rim_px=2.0)
    same = np.ones((30, 40), bool)
    same[8 + 5 : 8 + 8, 10 + 5 : 10 + 8] = False
    assert np.array_equal(result[same], image[same])
    assert np.allclose(result[~same], 0.5)


def test_noise_has_the_deviation_asked_for_and_its_seed():
    grey = np.full((80, 80, 3), 0.3, np.float32)
    opacity = np.ones((80, 80), np.float32)
    noisy = add_grain(grey, opacity, 0.02, noise_seed(0, "s", "t", 3))
    assert np.array_equal(noisy, add_grain(grey, opacity, 0.02, noise_seed(0, "s", "t", 3)))
    assert not np.array_equal(noisy, add_grain(grey, opacity, 0.02, noise_seed(0, "s", "t", 4)))
    assert fine_deviation(noisy, opacity > 0) == pytest.approx(0.02, rel=0.3)


# The whole


@pytest.mark.slow
@pytest.mark.parametrize("pose", lip_patch.POSES)
def test_a_painted_frame_looks_as_if_never_tattooed(model, domain, textures, opacity, pose):
    vertices = lip_patch.vertices_at(*lip_patch.POSES[pose])
    camera = lip_patch.cameras()["front"]
    tattooed = lip_patch.render(model, vertices, camera, tattoo=True)
    truth = lip_patch.render(model, vertices, camera, tattoo=False)
    paint = InpaintInputs(
        domain, textures[0], textures[2], opacity, ShadingSettings(), 0.3, 0.0, grain=False
    )
    painted = inpaint_frame(paint, tattooed, camera, vertices, model.triangles, (0,))
    where = np.abs(to_display(tattooed).astype(int) - to_display(truth)).max(axis=2) > 20
    where = cv2.dilate(where.astype(np.uint8), np.ones((3, 3))) > 0
    telea = cv2.inpaint(to_display(tattooed), where.astype(np.uint8), 4, cv2.INPAINT_TELEA)
    telea_db = -10 * np.log10(
        (((telea[where].astype(float) - to_display(truth)[where]) / 255) ** 2).mean()
    )
    ours_db = lip_patch.psnr_db(painted.linear, truth, where)
    assert ours_db >= 30.0
    assert ours_db > telea_db + 5.0
    assert painted.border_levels < 2.0
    far = np.ones(where.shape, bool)
    far[painted.window.slices] = False
    assert np.array_equal(painted.linear[far], tattooed[far])


def test_a_frame_needs_one_ray_caster_and_converts_nothing_to_srgb_twice(
    model, domain, textures, opacity, monkeypatch
):
    casters, converted = [], []
    build = RayCaster.__init__

    def counted(self, *mesh):
        casters.append(mesh)
        build(self, *mesh)

    def seen(linear):
        converted.append(np.asarray(linear).tobytes())
        return linear_to_srgb(linear)

    camera = lip_patch.cameras()["front"]
    image = lip_patch.render(model, model.neutral_mm, camera, tattoo=True)
    monkeypatch.setattr(RayCaster, "__init__", counted)
    for module in (frame, grain, opening_search):
        monkeypatch.setattr(module, "linear_to_srgb", seen)
    paint = InpaintInputs(domain, textures[0], textures[2], opacity, ShadingSettings())
    assert inpaint_frame(paint, image, camera, model.neutral_mm, model.triangles, (0,))
    assert len(casters) == 1
    assert len(converted) > 2 and len(set(converted)) == len(converted)


def test_lips_outside_the_image_are_left_alone(model, domain, textures, opacity):
    camera = lip_patch.cameras()["front"]
    paint = InpaintInputs(domain, textures[0], textures[2], opacity, ShadingSettings())
    away = model.neutral_mm + np.array([500.0, 0.0, 0.0])
    blank = np.zeros((180, 240, 3), np.float32)
    assert inpaint_frame(paint, blank, camera, away, model.triangles, (0,)) is None
