"""Alignment of points, of frames, and the head frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vermilion.geometry.alignment import align_frames, similarity_alignment
from vermilion.geometry.head_frame import head_from_world, world_from_head


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(-3.0, 3.0), st.floats(0.1, 5.0))
def test_rigid_motion_is_recovered_whatever_the_weights(seed, angle, shift):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * 30
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    moved = points @ rotation.T + shift
    found = similarity_alignment(points, moved, rng.uniform(0.1, 1, 20), scale=1.0)
    assert np.allclose(found.rotation, rotation, atol=1e-9)
    assert np.allclose(found.translation, shift, atol=1e-7)
    assert np.isclose(np.linalg.det(found.rotation), 1.0)


def test_similarity_is_recovered():
    points = np.random.default_rng(0).normal(size=(20, 3))
    rotation = Rotation.from_rotvec([1.0, 0.3, -2.0]).as_matrix()
    found = similarity_alignment(points, 1.7 * points @ rotation.T + [1, 2, 3])
    assert found.scale == pytest.approx(1.7)
    np.testing.assert_allclose(found.rotation, rotation, atol=1e-12)
    np.testing.assert_allclose(found.translation, [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(found.apply(points) - found.apply(0 * points), found.turn(points))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31))
def test_a_rigid_motion_is_the_similarity_of_scale_one(seed):
    """The best rotation does not depend on the scale, and a weight counts as repeated points."""
    rng = np.random.default_rng(seed)
    source, target = rng.normal(size=(2, 12, 3)) * 20
    counts = rng.integers(1, 4, 12)
    rigid = similarity_alignment(source, target, counts, scale=1.0)
    free = similarity_alignment(source, target, counts)
    repeated = similarity_alignment(*(np.repeat(p, counts, axis=0) for p in (source, target)))
    np.testing.assert_allclose(rigid.rotation, free.rotation, atol=1e-9)
    np.testing.assert_allclose(repeated.rotation, free.rotation, atol=1e-9)
    np.testing.assert_allclose(repeated.scale, free.scale)
    unit = similarity_alignment(source, free.apply(source) / free.scale)
    assert unit.scale == pytest.approx(1.0)
    mean = np.average(target - rigid.apply(source), axis=0, weights=counts)
    np.testing.assert_allclose(mean, 0.0, atol=1e-9)


def test_head_frame_there_and_back():
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(4, 7, 3))
    rotation = Rotation.from_rotvec(rng.normal(size=(4, 3))).as_matrix()
    translation = rng.normal(size=(4, 3))
    head = head_from_world(vertices, rotation, translation)
    np.testing.assert_allclose(world_from_head(head, rotation, translation), vertices, atol=1e-12)
    point = rotation[2] @ head[2, 5] + translation[2]
    np.testing.assert_allclose(point, vertices[2, 5], atol=1e-12)


def test_heads_are_aligned_by_the_part_that_does_not_move():
    """A fifth of the rigid vertices moves by 5 mm; the alignment does not follow them."""
    rng = np.random.default_rng(0)
    neutral = rng.normal(scale=50, size=(60, 3))
    rotation = Rotation.from_rotvec(0.2 * rng.normal(size=(3, 3))).as_matrix()
    moved = np.repeat(neutral[None], 3, axis=0)
    moved[:, :8] += [0, 5.0, 0]
    moved = moved @ np.swapaxes(rotation, 1, 2) + 30.0
    chosen = np.arange(60) < 50
    aligned = align_frames(moved, neutral, chosen, trim=0.2, rounds=2).apply(moved)
    np.testing.assert_allclose(aligned[:, 8:], neutral[None, 8:].repeat(3, 0), atol=0.05)
    lost = align_frames(moved * np.nan, neutral, chosen)
    assert np.isnan(lost.rotations).all() and np.isnan(lost.error_mm).all()


def test_vertices_that_are_lost_do_not_count():
    rng = np.random.default_rng(1)
    neutral = rng.normal(scale=50, size=(20, 3))
    rotation = Rotation.from_rotvec([[0.1, 0.2, 0.3], [0.0, -0.4, 0.0]]).as_matrix()
    sequence = neutral @ np.swapaxes(rotation, 1, 2) + [5.0, 6.0, 7.0]
    sequence[1, 3] = np.nan
    found = align_frames(sequence, neutral, np.ones(20))
    np.testing.assert_allclose(found.rotations, np.swapaxes(rotation, 1, 2), atol=1e-12)
    np.testing.assert_allclose(found.error_mm, 0.0, atol=1e-9)
    np.testing.assert_allclose(found[1:].apply(sequence[1:])[0, 4:], neutral[4:], atol=1e-9)
