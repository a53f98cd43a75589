"""Propagation of corrections, suggestions, contact and volume of the lips."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.lip_volumes import LipVolumes
from tests.unit import guided_mouths as mouths
from tests.unit.procedural_mouth import mouth
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.guided.propagation import LipPropagator
from vermilion.guided.regions import rim_fade
from vermilion.guided.suggestion import (
    extreme_frames,
    mouth_deformation,
    random_frames,
    suggest_frames,
    unexplained_share,
    uniform_frames,
)
from vermilion.storage.errors import InputError, ModelFileError


def propagator(**options) -> LipPropagator:
    face = mouths.small_face()
    stable = np.flatnonzero(face.regions["rigid"])
    return LipPropagator(face.neutral_mm, mouths.small_regions(), stable, **options)


def spoilt(take: np.ndarray) -> np.ndarray:
    """The take with inner lips that nothing was reconstructed of: as in the neutral."""
    regions, neutral = mouths.small_regions(), mouths.small_face().neutral_mm
    result = take.copy()
    result[:, regions.free] = neutral[regions.free]
    return result


def lip_error(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    free = mouths.small_regions().free
    return np.linalg.norm(found[:, free] - true[:, free], axis=2)


@pytest.mark.parametrize("with_neutral", [True, False])
def test_a_training_frame_is_reproduced_exactly(with_neutral):
    take = mouths.small_take(5)
    fitted = propagator().fit(take, with_neutral=with_neutral)
    found = fitted.correct(spoilt(take))
    assert lip_error(found.vertices_mm, take).max() < 1e-6
    assert found.unexplained.max() < 1e-4


def test_the_trusted_face_stays_to_the_last_bit():
    take = mouths.small_take(5)
    found = propagator().fit(take[:3]).correct(take).vertices_mm
    regions = mouths.small_regions()
    moved = np.concatenate([regions.free, regions.followers])
    others = np.setdiff1d(np.arange(take.shape[1]), moved)
    np.testing.assert_array_equal(found[:, others], take[:, others])


def test_a_rigid_motion_of_the_input_moves_the_output_rigidly():
    take = mouths.small_take(6)
    turn = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
    fitted = propagator().fit(take[:3])
    still = fitted.correct(take).vertices_mm
    moved = fitted.correct(take @ turn.T + [30.0, -200.0, 700.0]).vertices_mm
    assert np.abs(moved - (still @ turn.T + [30.0, -200.0, 700.0])).max() < 1e-6


def test_rigid_motions_of_the_training_change_nothing():
    take = mouths.small_take(6)
    turn = Rotation.from_rotvec([0.1, 0.5, 0.0]).as_matrix()
    still = propagator().fit(take[:3]).correct(take).vertices_mm
    moved = propagator().fit(take[:3] @ turn.T + 50.0).correct(take).vertices_mm
    assert np.abs(moved - still).max() < 1e-6


def test_a_frame_whose_mouth_the_training_spans_stays_right():
    """Blends of gradients in the training's span come back, whatever the lips of the input were."""
    face, regions = mouths.small_face(), mouths.small_regions()
    take = mouths.small_take(4)
    fitted = propagator().fit(take)
    again = fitted.correct(take).vertices_mm
    assert lip_error(again, take).max() < 1e-6
    neutral = face.neutral_mm[None]
    np.testing.assert_allclose(fitted.correct(neutral).vertices_mm, neutral, atol=1e-6)
    assert len(regions.free) > 50


def test_where_the_base_was_right_in_training_nothing_changes():
    take = mouths.small_take(8)
    fitted = propagator().fit(take[:4], base_mm=take[:4])
    found = fitted.correct(take[4:]).vertices_mm
    assert lip_error(found, take[4:]).max() < 1e-6


def test_a_frame_that_was_right_stays_right_among_wrong_ones():
    """Lips are wrong by a shift that grows with the opening; those hardly open were right.

    Three frames train: of a right one the correction is the frame itself.
    """
    face, regions = mouths.small_face(), mouths.small_regions()
    jaws = np.array([0.0, 0.04, 0.1, 0.2, 0.3, 0.4, 0.5])
    true = np.stack([mouth(face, jaw) for jaw in jaws])
    base = true.copy()
    base[:, regions.free, 2] -= 4.0 * np.maximum(jaws - 0.1, 0.0)[:, None]
    before = lip_error(base, true).mean(axis=1)
    trained = [2, 4, 6]
    fitted = propagator().fit(true[trained], base_mm=base[trained])
    after = lip_error(fitted.correct(base).vertices_mm, true).mean(axis=1)
    right = before < 0.3
    assert right.sum() == 3
    assert (after[right] - before[right]).max() < 0.1
    assert after[[3, 5]].max() < 0.35 * before[[3, 5]].min()


@pytest.mark.parametrize("change", [True, False])
def test_a_trained_base_frame_gets_its_correction_though_the_mouth_moved_with_it(change):
    """A refinement moves the trusted mouth, too: what counts is what `correct` will see."""
    regions, take = mouths.small_regions(), mouths.small_take(4)
    base = take.copy()
    base[:, regions.free] += [0.0, 1.0, 0.5]
    around = np.setdiff1d(regions.mouth_vertices, regions.inner_vertices)
    corrected = take.copy()
    corrected[:, around, 2] += 0.05 * np.sin(corrected[:, around, 0])
    fitted = propagator().fit(corrected, base_mm=base, change=change)
    assert lip_error(fitted.correct(base).vertices_mm, take).max() < 1e-6


def test_more_training_leaves_less():
    take = mouths.small_take(30)
    left = [
        lip_error(propagator().fit(take[:k]).correct(spoilt(take[12:])).vertices_mm, take[12:])
        for k in (1, 3, 8)
    ]
    one, three, eight = (error.mean() for error in left)
    assert one > three > eight
    assert eight < 0.3 * lip_error(spoilt(take[12:]), take[12:]).mean()


def test_a_saved_propagator_gives_the_same(tmp_path):
    take = mouths.small_take(5)
    fitted = propagator().fit(take[:3], base_mm=spoilt(take[:3]))
    fitted.save(tmp_path / "lips.npz")
    again = LipPropagator.load(tmp_path / "lips.npz")
    np.testing.assert_array_equal(again.correct(take).vertices_mm, fitted.correct(take).vertices_mm)


def test_a_file_that_is_no_propagator_is_named(tmp_path):
    path = tmp_path / "lips.npz"
    np.savez(path, propagator_version=np.int64(7))
    with pytest.raises(ModelFileError, match="format 7"):
        LipPropagator.load(path)
    np.savez(path, propagator_version=np.int64(1))
    with pytest.raises(ModelFileError, match=r"no array 'triangles'.*Train it again"):
        LipPropagator.load(path)
    path.write_bytes(b"not an archive")
    with pytest.raises(ModelFileError, match="unreadable lip propagator"):
        LipPropagator.load(path)


def test_meshes_that_cannot_serve_are_named():
    take = mouths.small_take(3)
    with pytest.raises(InputError, match="a call of `fit` first"):
        propagator().correct(take)
    with pytest.raises(InputError, match="topology of the neutral"):
        propagator().fit(take[:, :-1])
    broken = take.copy()
    broken[1, mouths.small_regions().border[0]] = np.nan
    with pytest.raises(InputError, match=r"frames \[1\] that are not finite"):
        propagator().fit(broken)


def test_suggestions_span_what_the_take_does():
    """A take of three independent motions and noise: three suggestions explain it."""
    rng = np.random.default_rng(0)
    shapes = rng.normal(size=(3, 400))
    weights = rng.uniform(size=(60, 3)) * np.eye(3)[rng.integers(3, size=60)]
    deformation = weights @ shapes + 1e-4 * rng.normal(size=(60, 400))
    chosen = suggest_frames(deformation, 3)
    assert set(np.abs(weights[chosen]).argmax(axis=1)) == {0, 1, 2}
    whole = np.linalg.norm(deformation, axis=1) > 0.1
    assert unexplained_share(deformation, chosen)[whole].max() < 0.1


def test_suggestions_go_on_from_what_is_corrected():
    deformation = np.repeat(np.eye(4, 50), [8, 6, 4, 2], axis=0)
    first = suggest_frames(deformation, 2)
    assert [int(deformation[f].argmax()) for f in first] == [0, 1]
    following = suggest_frames(deformation, 4, corrected=first)
    assert [int(deformation[f].argmax()) for f in following] == [2, 3]  # then nothing is left


def test_frames_that_are_not_allowed_are_not_suggested():
    deformation = np.random.default_rng(1).normal(size=(20, 30))
    allowed = np.arange(20) % 2 == 1
    assert (suggest_frames(deformation, 5, allowed=allowed) % 2 == 1).all()


def test_suggested_frames_leave_less_than_extreme_ones():
    take = mouths.small_take(40, seed=4)
    face, regions = mouths.small_face(), mouths.small_regions()
    deformation = mouth_deformation(take, face.neutral_mm, regions)
    left = [
        lip_error(propagator().fit(take[frames]).correct(take).vertices_mm, take).mean()
        for frames in (suggest_frames(deformation, 4), extreme_frames(deformation, 4))
    ]
    assert left[0] < left[1]


def test_deformation_knows_no_head_motion():
    take = mouths.small_take(4)
    face, regions = mouths.small_face(), mouths.small_regions()
    turn = Rotation.from_rotvec([0.3, 0.2, -0.5]).as_matrix()
    still = mouth_deformation(take, face.neutral_mm, regions)
    moved = mouth_deformation(take @ turn.T + 100.0, face.neutral_mm, regions)
    np.testing.assert_allclose(moved, still, atol=1e-6)
    assert mouth_deformation(face.neutral_mm[None], face.neutral_mm, regions).max() < 1e-12


def test_other_choices():
    np.testing.assert_array_equal(uniform_frames(100, 4), [12, 37, 62, 87])
    drawn = random_frames(100, 10, seed=2)
    assert len(np.unique(drawn)) == 10
    np.testing.assert_array_equal(drawn, random_frames(100, 10, seed=2))
    with pytest.raises(InputError, match="a number from 1 to 5"):
        uniform_frames(5, 6)


def jaw_at_the_wrong_depth(take: np.ndarray) -> np.ndarray:
    """The take with the mouth region too deep by what the mouth is open, fading to its rim."""
    face, regions = mouths.small_face(), mouths.small_regions()
    lower = face.landmarks[8]
    open_mm = face.neutral_mm[lower, 1] - take[:, lower, 1]
    depth = 0.5 * open_mm[:, None] * rim_fade(regions, 6)
    return take - depth[..., None] * [0.0, 0.0, 1.0]


def test_a_mouth_region_that_is_wrong_is_moved_with_its_lips():
    take = mouths.small_take(14)
    base = jaw_at_the_wrong_depth(take)
    frames = suggest_frames(mouth_deformation(base, mouths.small_face().neutral_mm,
                            mouths.small_regions()), 5)  # fmt: skip
    others = np.setdiff1d(np.arange(len(take)), frames)
    before = lip_error(base, take)[others].mean()
    assert before > 0.5
    held, moved = (
        propagator().fit(take[frames], base[frames], whole=whole).correct(base).vertices_mm
        for whole in (False, True)
    )
    assert lip_error(moved, take)[others].mean() < 0.25 * before
    assert lip_error(moved, take)[others].mean() < 0.5 * lip_error(held, take)[others].mean()
    rest = rim_fade(mouths.small_regions()) == 0
    rest[mouths.small_regions().mouth_vertices] = False
    np.testing.assert_array_equal(moved[:, rest], base[:, rest])


def test_where_nothing_was_wrong_the_mouth_region_stays():
    take = mouths.small_take(6)
    found = propagator().fit(take[:3], take[:3], whole=True).correct(take).vertices_mm
    np.testing.assert_allclose(found, take, atol=1e-9)


def test_a_moved_mouth_region_comes_back_from_a_file(tmp_path):
    take = mouths.small_take(6)
    base = jaw_at_the_wrong_depth(take)
    fitted = propagator().fit(take[:3], base[:3], whole=True)
    fitted.save(tmp_path / "p.npz")
    again = LipPropagator.load(tmp_path / "p.npz").correct(base).vertices_mm
    np.testing.assert_array_equal(again, fitted.correct(base).vertices_mm)


def test_no_lip_passes_through_the_other_after_propagation():
    """Lips trained a little open are predicted for a mouth that closes further than they did."""
    face, regions = mouths.face(), mouths.regions()
    crossings = LipCrossings(face)
    stable = np.flatnonzero(face.regions["rigid"])
    train = np.stack([mouth(face, jaw) for jaw in (0.09, 0.3)])
    closing = mouth(face, 0.09)[None].copy()
    lower = face.regions["vermilion_lower"] | (face.neutral_mm[:, 1] < -40)
    closing[:, lower, 1] += 3.0
    fitted = LipPropagator(face.neutral_mm, regions, stable).fit(train)
    plain = fitted.correct(closing)
    assert crossings.find(plain.vertices_mm[0]).deepest_mm > 0.2
    parted = fitted.correct(closing, crossings)
    assert crossings.find(parted.vertices_mm[0]).deepest_mm < 0.02
    assert parted.depth_mm.max() < 0.02


def test_contact_leaves_lips_alone_that_are_apart():
    face = mouths.small_face()
    open_ = np.stack([mouth(face, jaw) for jaw in (0.3, 0.4)])
    fitted = propagator().fit(open_)
    plain = fitted.correct(open_).vertices_mm
    np.testing.assert_allclose(
        fitted.correct(open_, LipCrossings(face)).vertices_mm, plain, atol=1e-9
    )


def test_volume_of_a_lip():
    face = mouths.face()
    volumes = LipVolumes.of(face)
    neutral = volumes.measure(face.neutral_mm[None])[0]
    assert (neutral > 300).all() and (neutral < 6000).all()  # mm3, a lip is a few cm long
    turn = Rotation.from_rotvec([0.3, 0.8, 0.1]).as_matrix()
    moved = face.neutral_mm @ turn.T + 500.0
    np.testing.assert_allclose(volumes.measure(moved[None])[0], neutral, rtol=1e-9)
    np.testing.assert_allclose(volumes.measure(2 * face.neutral_mm[None])[0], 8 * neutral)
