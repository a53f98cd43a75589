"""Folds of the lips are taken out, and nothing else is touched."""

from __future__ import annotations

import numpy as np
import pytest

from tests import lip_patch
from vermilion.correction.folds import LipFolds
from vermilion.correction.unfold import Unfolder
from vermilion.geometry.mesh import adjacency

from .test_image_contours import DEFAULTS, FACE
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
