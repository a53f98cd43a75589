"""Expressions of a studio actor: their own, of the same support, and the same every time."""

import numpy as np

from tests.heads import small_studio
from vermilion.studio.own_expressions import with_own_expressions


def test_without_spread_they_are_the_models():
    model = small_studio()
    assert with_own_expressions(model, 3, 0.0) is model


def test_an_actor_moves_what_the_model_moves_but_otherwise():
    model = small_studio()
    own = with_own_expressions(model, 3, 1.0)
    size = np.linalg.norm(model.expressions_mm, axis=2)
    moved = np.linalg.norm(own.expressions_mm - model.expressions_mm, axis=2)
    assert moved[size == 0].max(initial=0.0) == 0.0
    share = moved.sum(axis=1) / size.sum(axis=1)
    assert share.min() > 0.05 and share.max() < 1.5
    assert 0.15 < np.median(share) < 0.6
    left = own.expressions_mm[own.expression_names.index("mouthSmile_L")]
    right = own.expressions_mm[own.expression_names.index("mouthSmile_R")]
    assert not np.isclose(np.abs(left).sum(), np.abs(right).sum(), rtol=0.02)


def test_two_actors_differ_and_one_is_always_the_same():
    model = small_studio()
    first, again, other = (with_own_expressions(model, s, 1.0).expressions_mm for s in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)
