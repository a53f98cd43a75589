"""The prior of other actors' lips: what it learns, and the depth that it gives to a frontal stroke."""

import numpy as np
import pytest

from tests.unit import guided_mouths as mouths
from vermilion.guided.lip_prior import LipPrior
from vermilion.guided.prior_refinement import PriorRefiner
from vermilion.guided.regions import movable_vertices, rim_fade
from vermilion.storage.errors import InputError


def actors(offset=0.0, function=0.0, frame=0.0, count=6, n_frames=40):
    """Displacements of two vertices and descriptors of actors that differ in a given way."""
    rng = np.random.default_rng(3)
    moved, told = [], []
    for _ in range(count):
        z = rng.standard_normal((n_frames, 2))
        own, turn = rng.standard_normal(6), rng.standard_normal((2, 6))
        noise = rng.standard_normal((n_frames, 6))
        d = z @ np.full((2, 6), 2.0) + offset * own + function * z @ turn + frame * noise
        moved.append(d.reshape(n_frames, 2, 3))
        told.append(z)
    return moved, told


def test_what_base_frames_tell_of_every_actor_is_learnt():
    moved, told = actors(frame=0.01)
    prior = LipPrior.of(np.arange(2), moved, told)
    found = prior.displacements(prior.mean(prior.descriptors(told[0])))
    np.testing.assert_allclose(found, moved[0], atol=0.05 * np.abs(moved[0]).max())


@pytest.mark.parametrize("kind", ["offset", "function", "frame"])
def test_how_actors_differ_is_measured(kind):
    moved, told = actors(**{kind: 1.0})
    shares = LipPrior.of(np.arange(2), moved, told).shares
    assert shares.sum() == pytest.approx(1.0)
    assert ["offset", "function", "frame"][int(shares.argmax())] == kind
    assert shares.max() > 0.6


def test_a_prior_comes_back_from_a_file(tmp_path):
    moved, told = actors(offset=1.0)
    prior = LipPrior.of(np.arange(2), moved, told)
    prior.save(tmp_path / "prior.npz")
    again = LipPrior.load(tmp_path / "prior.npz")
    np.testing.assert_array_equal(again.modes_mm, prior.modes_mm)
    np.testing.assert_array_equal(again.shares, prior.shares)


def test_one_actor_is_no_database():
    moved, told = actors(count=1)
    with pytest.raises(InputError, match="two actors or more"):
        LipPrior.of(np.arange(2), moved, told)


@pytest.fixture(scope="module")
def lowered():
    """Lower lips that come down and forward together, as other actors' do; a base that does neither."""
    face, regions = mouths.face(), mouths.regions()
    vertices = movable_vertices(regions)
    mesh = mouths.open_mouth()
    lower = mesh[:, 1] < mesh[face.inner_contour, 1].mean()
    mode = (rim_fade(regions, 8) * lower)[vertices, None] * [0.0, -1.0, 1.5]
    rng = np.random.default_rng(0)
    moved = [rng.normal(size=(30, 1, 1)) * mode for _ in range(4)]
    told = [rng.standard_normal((30, 2)) for _ in range(4)]
    return mesh, vertices, mode, LipPrior.of(vertices, moved, told)


def test_a_frontal_stroke_with_a_prior_gives_depth(lowered):
    mesh, vertices, mode, prior = lowered
    face = mouths.face()
    truth = mesh.copy()
    truth[vertices] += 2.0 * mode
    base = np.stack([mesh, mesh])
    stable = np.flatnonzero(face.regions["rigid"])
    refiner = PriorRefiner(face.neutral_mm, prior, mouths.surface(), stable)
    camera = mouths.camera()
    sketch = mouths.drawn(truth, camera)
    solution = refiner.solve(base, np.zeros((2, 2)), {0: [(sketch, camera)]})
    found = refiner.apply(base, solution.coefficients)
    before, after = (np.abs(m - truth)[vertices, 2].max() for m in (mesh, found[0]))
    assert before > 2.0 and after < 0.3 * before
    outside = np.setdiff1d(np.arange(len(mesh)), vertices)
    np.testing.assert_array_equal(found[:, outside], base[:, outside])
    # Actors of this database differ frame by frame: a frame tells nothing of another one.
    assert np.abs(found[1] - mesh).max() < 0.3 * np.abs(found[0] - mesh).max()
    assert solution.deviation[0] <= solution.deviation[1] + 1e-9


def test_without_a_sketch_there_is_nothing_to_solve(lowered):
    mesh, _, _, prior = lowered
    stable = np.flatnonzero(mouths.face().regions["rigid"])
    refiner = PriorRefiner(mouths.face().neutral_mm, prior, mouths.surface(), stable)
    with pytest.raises(InputError, match="no sketch"):
        refiner.solve(mesh[None], np.zeros((1, 2)), {})
