"""Sketches drawn from a mesh: as far from its contours as the hand errs, and smooth."""

import numpy as np
import pytest

from benchmarks.drawn_sketch import Hand, drawn_sketch, smooth_error
from tests.unit import guided_mouths as mouths
from vermilion.guided.refinement import RefinementSettings, SketchView
from vermilion.guided.sketch import CURVE_NAMES
from vermilion.studio.surface import surface_of


@pytest.fixture(scope="module")
def strokes():
    """A sketch of an open mouth by a hand's error (px), and its contours' distances from the mesh's."""
    face, camera = mouths.face(), mouths.camera()
    surface, mesh = surface_of(face), mouths.open_mouth()

    def draw(error_px, **options):
        hand = Hand(error_px=error_px, **options)
        sketch = drawn_sketch(face, surface, mesh, camera, 3, hand)
        view = SketchView.of(sketch, camera, RefinementSettings())
        contours = view.contours(mesh, mouths.surface())
        return sketch, {n: contours[n].nearest(view.samples[n])[1] for n in contours}

    return draw


def test_a_steady_hand_draws_the_contours_of_the_mesh(strokes):
    sketch, distance = strokes(0.0)
    assert set(sketch.curves) == set(CURVE_NAMES)
    for name, apart in distance.items():
        assert np.median(apart) < 0.5, name


def test_a_hand_errs_by_about_a_pixel(strokes):
    exact, _ = strokes(0.0)
    drawn, _ = strokes(1.0, outer=False)
    assert set(drawn.curves) == {"upper_inner", "lower_inner"}
    off = drawn.curves["lower_inner"].points_px - exact.curves["lower_inner"].points_px
    assert 0.4 < np.sqrt((off**2).mean()) < 2.0
    # Smooth: neighbours on the stroke err alike.
    assert np.abs(np.diff(off, axis=0)).max() < 1.0


def test_the_error_has_deviation_one():
    rng = np.random.default_rng(0)
    errors = np.stack([smooth_error(25, rng) for _ in range(400)])
    np.testing.assert_allclose(errors.std(axis=0), 1.0, atol=0.15)
