"""Expressions and people of the generated head: lips that open, roll and never pass through."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.procedural_mouth import aperture_mm, lip_gap_mm, mouth, visible_red_mm2
from vermilion.faces.procedural import studio_model
from vermilion.geometry.raycast import RayCaster

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
