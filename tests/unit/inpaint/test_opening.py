"""Inpainting: the mouth opening in the image, and the shadow between the lips."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests import lip_patch
from vermilion.geometry.raycast import RayCaster
from vermilion.inpaint.frame import InpaintInputs, inpaint_frame
from vermilion.inpaint.opening import MouthPlace, OpeningSettings
from vermilion.inpaint.opening_search import find_opening
from vermilion.inpaint.shading import ShadingSettings


@pytest.fixture(scope="module")
def open_mouth(model):
    """The tattooed mouth, open, seen from the front."""
    camera = lip_patch.cameras()["front"]
    vertices = lip_patch.vertices_at(*lip_patch.POSES["open"])
    return camera, vertices, lip_patch.render(model, vertices, camera, tattoo=True)


def opening_of(model, domain, camera, image, vertices, **settings):
    ends = camera.project(vertices[domain.corners])
    axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    place = MouthPlace(axis, np.zeros(2), np.array([camera.width_px, camera.height_px]), 1 / 3)
    caster = RayCaster(vertices, model.triangles)
    return find_opening(domain, caster, camera, image, place, OpeningSettings(**settings))


def wrong_pixels(opening, open_mouth, model) -> int:
    """Pixels whose middle is inked but counted open, or the other way."""
    camera, vertices, _ = open_mouth
    hit = RayCaster(vertices, model.triangles).see(camera).hit
    found = opening.inside_and_near(camera.pixel_grid())[0]
    middle = np.abs(camera.pixel_grid() - [120, 90]) < [30, 60]  # away from the corners
    return int((found == hit)[middle.all(axis=-1) & (found | ~hit)].sum())


def lower_lip_raised(vertices: np.ndarray, up_mm: float) -> np.ndarray:
    return vertices + np.where(vertices[:, 1:2] < -1.0, [0.0, up_mm, 0.0], 0.0)


def test_the_opening_is_found_where_the_mesh_has_it_wrong(model, domain, open_mouth):
    camera, vertices, image = open_mouth
    wrong = lower_lip_raised(vertices, 1.5)
    believed = opening_of(model, domain, camera, image, wrong, reach_mm=0.0)
    found = opening_of(model, domain, camera, image, wrong)
    assert wrong_pixels(believed, open_mouth, model) > 150
    assert wrong_pixels(found, open_mouth, model) < 0.35 * wrong_pixels(believed, open_mouth, model)


def test_an_opening_that_the_mesh_has_right_stays(model, domain, open_mouth):
    camera, vertices, image = open_mouth
    mesh = opening_of(model, domain, camera, image, vertices, reach_mm=0.0)
    found = opening_of(model, domain, camera, image, vertices)
    step_mm = np.linalg.norm(found.across_px) / 3
    middle = slice(len(found.columns) // 4, -len(found.columns) // 4)
    assert np.abs(found.upper - mesh.upper)[middle].max() * step_mm < 0.5
    assert np.abs(found.lower - mesh.lower)[middle].max() * step_mm < 0.5


def test_what_lies_behind_the_lips_is_not_painted(model, domain, textures, opacity, open_mouth):
    camera, vertices, image = open_mouth
    paint = InpaintInputs(
        domain, textures[0], textures[2], opacity, ShadingSettings(), 0.3, 0.0, 0.0, grain=False
    )
    wrong = lower_lip_raised(vertices, 1.5)
    painted = inpaint_frame(paint, image, camera, wrong, model.triangles, (0,))
    behind = ~RayCaster(vertices, model.triangles).see(camera).hit
    behind = cv2.erode(behind.astype(np.uint8), np.ones((5, 5))) > 0
    changed = np.abs(painted.linear - image).max(axis=2) > 0.02
    assert changed[behind].mean() < 0.01


def test_a_shadow_between_the_lips_is_kept(model, domain, textures, opacity):
    camera, vertices = lip_patch.cameras()["front"], model.neutral_mm
    paint = InpaintInputs(
        domain, textures[0], textures[2], opacity, ShadingSettings(), 0.3, 0.0, 0.0, grain=False
    )
    flat = replace(paint, shading=ShadingSettings(seam_mm=0.0))
    middle = camera.project(np.zeros((1, 3)))[0, 1]
    away = np.abs(camera.pixel_grid()[..., 1] - middle)
    shadow = np.clip(away / 6.0, 0.3, 1.0).astype(np.float32)[..., None]
    inked, truth = (
        lip_patch.render(model, vertices, camera, tattoo) * shadow for tattoo in (True, False)
    )
    lips = (opening_rim(model, camera, vertices)) & (away < 7.0)
    with_seam, without = (
        lip_patch.psnr_db(
            inpaint_frame(p, inked, camera, vertices, model.triangles, (0,)).linear, truth, lips
        )
        for p in (paint, flat)
    )
    assert with_seam > without + 2.0


def opening_rim(model, camera, vertices) -> np.ndarray:
    """Pixels of the vermilion."""
    hits = RayCaster(vertices, model.triangles).see(camera)
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    return hits.hit & lips[model.triangles].all(axis=1)[hits.triangle]
