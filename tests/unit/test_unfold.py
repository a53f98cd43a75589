"""Folds of the lips are taken out, and nothing else is touched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests import lip_patch
from vermilion.correction.folds import LipFolds
from vermilion.correction.unfold import Unfolder
from vermilion.geometry.mesh import adjacency

from .test_image_contours import DEFAULTS, FACE, OFF, agreement, depth_in_other_lip
from .test_surface_quality import folded_mesh, middle

FOLDS = LipFolds(FACE, DEFAULTS.folded_deg, DEFAULTS.crease_deg)
UNFOLDER = Unfolder(FOLDS, FACE.triangles, FACE.neutral_mm)


def folded(mesh, base):
    return len(FOLDS.folded_triangles(mesh, base))


def test_a_mesh_without_folds_stays_as_it_is():
    base, mesh = lip_patch.vertices_at(0.6, 0.0), lip_patch.vertices_at(5.0, 0.08)
    assert UNFOLDER.unfold(mesh, base) is mesh


@pytest.mark.parametrize("base", [(0.6, 0.0), (5.0, 0.08)])
def test_a_fold_goes_and_the_rest_of_the_mouth_stays(base):
    base, sound = lip_patch.vertices_at(*base), lip_patch.vertices_at(3.0, 0.04)
    vertex = middle(sound, FACE.regions["vermilion_lower"])
    near = adjacency(FACE.triangles, FACE.n_vertices)[[vertex]].indices
    torn = sound.copy()
    torn[vertex] += 3.0 * (sound[near[0]] - sound[vertex])
    assert folded(torn, base) >= 2 and folded(sound, base) == 0
    mended = UNFOLDER.unfold(torn, base)
    assert folded(mended, base) == 0
    # The surface goes back to where it was, and only round the fold.
    tolerance_mm = 0.3
    assert np.linalg.norm(mended - sound, axis=1).max() < tolerance_mm
    touched = np.linalg.norm(mended - torn, axis=1) > 0
    assert touched.sum() < 0.05 * FACE.n_vertices


def test_what_counts_as_a_fold_is_what_the_correction_is_told():
    base, torn = lip_patch.vertices_at(0.6, 0.0), folded_mesh()
    folds = LipFolds(FACE, 179.9, DEFAULTS.crease_deg)
    assert folded(torn, base) and len(folds.folded_triangles(torn, base)) == 0
    assert Unfolder(folds, FACE.triangles, FACE.neutral_mm).unfold(torn, base) is torn


def test_a_layer_that_turns_one_lip_over_is_mended_though_the_base_is_elsewhere():
    """The base track lies 8 mm away and turned: its shape is carried, not its place."""
    sound = lip_patch.vertices_at(3.0, 0.04)
    turn = np.array([[0.98, -0.199, 0.0], [0.199, 0.98, 0.0], [0.0, 0.0, 1.0]])
    base = sound @ turn.T + np.array([0.0, 8.0, 0.0])
    torn = sound.copy()
    middle_of_lip = middle(sound, FACE.regions["vermilion_upper"])
    patch = np.linalg.norm(sound - sound[middle_of_lip], axis=1) < 1.5
    torn[patch, 1] = 2 * sound[middle_of_lip, 1] - sound[patch, 1]
    assert folded(torn, base) > 0
    mended = UNFOLDER.unfold(torn, base)
    assert folded(mended, base) == 0
    assert np.linalg.norm(mended - sound, axis=1).max() < 0.3


def flickering(frames):
    """(meshes (F, V, 3), base (F, V, 3)): a lip that folds in every second frame only, where nothing moves."""
    base, sound = lip_patch.vertices_at(0.6, 0.0), lip_patch.vertices_at(3.0, 0.04)
    vertex = middle(sound, FACE.regions["vermilion_lower"])
    near = adjacency(FACE.triangles, FACE.n_vertices)[[vertex]].indices
    bulging = sound.copy()
    bulging[near] += [0.0, 0.0, 0.4]  # of its own, which the base track does not have
    torn = bulging.copy()
    torn[vertex] += 3.0 * (sound[near[0]] - sound[vertex])
    return np.stack([torn if f % 2 else bulging for f in range(frames)]), np.stack([base] * frames)


def test_what_is_made_anew_in_some_frames_does_not_tremble():
    meshes, base = flickering(24)
    moved = []
    for reach in (0, 6):
        mended = UNFOLDER.unfold_over_time(meshes, base, np.arange(24), reach)
        assert not any(folded(*pair) for pair in zip(mended, base, strict=True))
        moved.append(np.linalg.norm(np.diff(mended[6:18], n=2, axis=0), axis=2).max())
    assert moved[1] < 0.1 * moved[0], moved


def test_frames_out_of_reach_of_a_fold_stay_as_they_are():
    meshes, base = flickering(2)
    meshes, base = np.stack([meshes[1], *[meshes[0]] * 8]), np.stack([base[0]] * 9)
    mended = UNFOLDER.unfold_over_time(meshes, base, np.arange(9), 4)
    assert np.array_equal(mended[4:], meshes[4:])
    assert not np.array_equal(mended[1], meshes[1])
    across_a_cut = UNFOLDER.unfold_over_time(meshes, base, np.r_[0, 1000 + np.arange(8)], 4)
    assert np.array_equal(across_a_cut[1:], meshes[1:])


def test_lips_that_unfolding_laid_into_each_other_are_parted_without_a_new_fold():
    through, base = lip_patch.vertices_at(-3.0, 0.0), lip_patch.vertices_at(0.6, 0.0)
    assert depth_in_other_lip(through) > 0.3
    parted = agreement(replace(OFF, contact=True))._parted(through, base)
    assert depth_in_other_lip(parted) <= 0.01
    assert folded(parted, base) == 0
    assert agreement(replace(OFF, contact=True))._parted(base, base) is base
