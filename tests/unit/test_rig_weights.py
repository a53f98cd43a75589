"""Weights of rigs: what is found for shapes that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.unit.exported import animated_head
from vermilion.export.animation import NamedShapes
from vermilion.export.head_pose import corrected_pose
from vermilion.export.live_link import SHAPES, arkit_column, timecode, write_live_link
from vermilion.export.objs import write_obj
from vermilion.export.rig import bounded_weights, read_rig, solve_rig
from vermilion.export.static_correction import on_own_neutral, static_correction
from vermilion.storage.errors import InputError
from vermilion.studio.live_link import read_live_link

COUNT = 30


def rig(n_vertices: int, near: np.ndarray) -> NamedShapes:
    """Eight smooth shapes of the mouth."""
    rng = np.random.default_rng(1)
    waves = np.sin(near[:, :2] @ rng.normal(0, 0.15, (2, 8)) + rng.uniform(0, 6, 8))
    fade = np.exp(-(near**2).sum(axis=1) / 1500)
    shapes = np.stack([fade[:, None] * waves[:, k, None] * rng.normal(0, 4, 3) for k in range(8)])
    return NamedShapes(tuple(f"shape{k}" for k in range(8)), shapes, np.zeros((0, 8)))


def shown(weights, extra=0.0):
    """A turning head that shows the rig at known weights, and its rig and lips."""
    head = animated_head(np.arange(COUNT))
    own = rig(len(head.neutral_mm), head.neutral_mm * [1, 1, 0])
    local = head.neutral_mm + np.tensordot(weights, own.shapes_mm, axes=1) + extra
    world = np.stack([head.head.to_world(row, mesh) for row, mesh in enumerate(local)])
    lips = (np.abs(head.neutral_mm[:, 1]) < 9) & (np.abs(head.neutral_mm[:, 0]) < 22)
    return replace(head, vertices_mm=world.astype(np.float32)), own, lips


def smooth_weights():
    time = np.arange(COUNT)[:, None] / 25
    phase = np.random.default_rng(2).uniform(0, 6, 8)
    return np.clip(0.5 + 0.6 * np.sin(5 * time + phase), 0, 1) * [1, 1, 0, 1, 0, 0, 1, 0]


def test_weights_that_a_rig_has_shown_are_found_again():
    true = smooth_weights()
    animation, own, lips = shown(true)
    found = solve_rig(animation, own, lips)
    assert np.abs(found.shapes.weights - true).mean() < 0.04
    assert found.left_mm.mean() < 0.3
    # Shapes that were not used stay unused.
    assert found.shapes.weights[:, [2, 4, 5, 7]].mean() < 0.03


def test_one_corrective_shows_what_the_rig_cannot():
    """Lips that one shape outside the rig moves, as in a shot whose actor has it."""
    head = animated_head(np.arange(COUNT))
    near = np.exp(-(head.neutral_mm[:, :2] ** 2).sum(axis=1) / 120)
    outside = near[:, None] * [0.0, 0.5, 3.0]
    drive = 0.5 + 0.5 * np.sin(np.arange(COUNT) / 4)
    animation, own, lips = shown(smooth_weights(), drive[:, None, None] * outside)
    found = solve_rig(animation, own, lips)
    assert found.left_mm.mean() > 0.4
    assert found.corrected_mm.mean() < 0.3
    assert found.corrective.min() >= 0.0
    assert found.corrective.max() == pytest.approx(1.0)


def test_a_head_that_the_correction_moved_costs_no_weights():
    """The corrected head stands elsewhere than the track's: its pose is found, and the rig's weights stay."""
    true = smooth_weights()
    animation, own, lips = shown(true)
    shapes = replace(own, weights=true)
    tilt = Rotation.from_euler("xyz", [4.0, -3.0, 1.0], degrees=True).as_matrix()
    moved = replace(
        animation, shapes=shapes,
        vertices_mm=(animation.vertices_mm @ tilt.T + [3.0, -5.0, 12.0]).astype(np.float32),
    )  # fmt: skip
    still = ~lips
    pose = corrected_pose(moved, still)
    assert np.allclose(pose.rotation, tilt @ animation.head.rotation, atol=1e-5)
    wanted = animation.head.translation_mm @ tilt.T + [3.0, -5.0, 12.0]
    assert np.abs(pose.translation_mm - wanted).max() < 1e-3
    found = solve_rig(replace(moved, head=pose), own, lips)
    assert found.left_mm.mean() < 0.3
    assert solve_rig(moved, own, lips).left_mm.mean() > 3.0


def person_of(head, own):
    """Lips of a person that the model does not have, which look like the rig's first shape."""
    near = np.exp(-(head.neutral_mm[:, :2] ** 2).sum(axis=1) / 300)
    return 0.4 * own.shapes_mm[0] + near[:, None] * [0.0, 0.8, -0.6]


def test_a_persons_own_lips_cost_no_weights():
    true = smooth_weights()
    head = animated_head(np.arange(COUNT))
    own = rig(len(head.neutral_mm), head.neutral_mm * [1, 1, 0])
    person = person_of(head, own)
    animation, own, lips = shown(true, person)
    # The track is two frames late: its motion is wrong, its mean expression is not.
    late = np.concatenate([true[2:], true[:2]])
    animation = replace(animation, shapes=replace(own, weights=late))
    assert np.abs(static_correction(animation) - person).max() < 1e-4
    apart = solve_rig(on_own_neutral(animation, lips), own, lips)
    assert np.abs(apart.alone - true).mean() < 0.04
    together = solve_rig(animation, own, lips)
    assert np.abs(together.alone - true).mean() > 2 * np.abs(apart.alone - true).mean()
    assert together.left_mm.mean() > 2 * apart.left_mm.mean()


def test_a_rig_is_at_rest_in_the_frame_that_shows_the_neutral():
    true = smooth_weights()
    true[7] = 0.0
    head = animated_head(np.arange(COUNT))
    own = rig(len(head.neutral_mm), head.neutral_mm * [1, 1, 0])
    person = person_of(head, own)
    animation, own, lips = shown(true, person)
    # The track takes the person for an expression, and blinks.
    blink = np.zeros((1, len(lips), 3))
    blink[0, np.linalg.norm(head.neutral_mm - [30.0, 40.0, 0.0], axis=1) < 12] = [0.0, -4.0, 0.0]
    track = NamedShapes(
        (*own.names, "blink"), np.concatenate([own.shapes_mm, blink]),
        np.column_stack([np.clip(true + 0.2, 0, 1), np.ones(COUNT)]),
    )  # fmt: skip
    world = [
        animation.head.to_world(row, animation.head.to_head(row, mesh) + blink[0])
        for row, mesh in enumerate(animation.vertices_mm)
    ]
    animation = replace(animation, shapes=track, vertices_mm=np.stack(world))
    found = on_own_neutral(animation, lips, neutral_frame=7)
    assert np.abs(found.neutral_mm - animation.neutral_mm - person).max() < 1e-4
    assert solve_rig(found, own, lips).alone[7].max() < 0.1
    lost = on_own_neutral(animation, lips, np.arange(COUNT) != 7, neutral_frame=7)
    assert np.abs(lost.neutral_mm - found.neutral_mm).max() > 0.1


def test_frames_that_were_not_corrected_say_nothing_of_the_person():
    true = smooth_weights()
    animation, own, _ = shown(true)
    person = person_of(animation, own)
    local = animation.neutral_mm + np.tensordot(true, own.shapes_mm, axes=1)
    valid = np.arange(COUNT) % 3 > 0
    local[valid] += person
    world = [animation.head.to_world(row, mesh) for row, mesh in enumerate(local)]
    animation = replace(
        animation, vertices_mm=np.stack(world), shapes=replace(own, weights=true)
    )  # fmt: skip
    assert np.abs(static_correction(animation, valid) - person).max() < 1e-6
    assert not static_correction(animation, np.zeros(COUNT, bool)).any()


def test_weights_minimise_the_energy_within_their_bounds():
    rng = np.random.default_rng(0)
    shapes = rng.normal(0, 1, (5, 30))
    gram, goal = shapes @ shapes.T, rng.normal(0, 1, (7, 30))
    target, sparse, smooth = goal @ shapes.T, 0.3, 0.7
    found = bounded_weights(gram, target, sparse, smooth)

    def energy(weights):
        steps = np.diff(weights, axis=0)
        return (
            ((weights @ shapes - goal) ** 2).sum()
            + sparse * weights.sum()
            + smooth * (steps**2).sum()
        )

    assert found.min() >= 0.0
    assert found.max() <= 1.0
    for _ in range(300):
        other = np.clip(found + rng.normal(0, 0.05, found.shape), 0, 1)
        assert energy(other) >= energy(found) - 1e-9


def test_a_rig_is_read_from_a_folder_and_another_topology_is_named(tmp_path):
    head = animated_head()
    own = rig(len(head.neutral_mm), head.neutral_mm)
    write_obj(tmp_path / "neutral.obj", head.neutral_mm, head.polygons)
    for name, shape in zip(own.names, own.shapes_mm, strict=True):
        write_obj(tmp_path / f"{name}.obj", head.neutral_mm + shape, head.polygons)
    found = read_rig(tmp_path, len(head.neutral_mm))
    assert found.names == own.names
    assert np.abs(found.shapes_mm - own.shapes_mm).max() < 1e-4
    with pytest.raises(InputError, match=r"neutral\.obj: found 970 vertices; expected 12,"):
        read_rig(tmp_path, 12)
    (tmp_path / "neutral.obj").unlink()
    with pytest.raises(InputError, match="found 8 shapes and no neutral"):
        read_rig(tmp_path, 12)


def test_live_link_reads_back_what_was_written(tmp_path):
    names = ("jawOpen", "mouthSmile_L", "browInnerUp_L", "browInnerUp_R", "notInArkit")
    weights = np.random.default_rng(0).random((12, 5))
    weights[:, 3] = weights[:, 2]
    frames = np.arange(90, 102)
    turn = np.tile(np.eye(3), (12, 1, 1))
    write_live_link(tmp_path / "a.csv", frames, 30.0, names, weights, turn)
    back = read_live_link(tmp_path / "a.csv", names, 12, 30.0)
    assert np.abs(back[:, :4] - weights[:, :4]).max() < 1e-9
    table = pd.read_csv(tmp_path / "a.csv")
    assert len(table.columns) == 2 + 61
    assert (table["BlendShapeCount"] == 61).all()
    assert table["Timecode"].iloc[0] == "00:00:03:00.000"
    assert table["Timecode"].iloc[-1] == "00:00:03:11.000"


def test_the_52_shapes_have_their_names():
    assert len(SHAPES) == len(set(SHAPES)) == 52
    assert arkit_column("eyeBlink_L") == "EyeBlinkLeft"
    assert arkit_column("mouthLeft") == "MouthLeft"
    assert arkit_column("cheekPuff_R") == "CheekPuff"
    assert arkit_column("neckTense") is None
    assert timecode(25 * 3661 + 7, 25.0) == "01:01:01:07.000"


def test_columns_stand_in_the_order_of_a_recording(data_root):
    recording = next((data_root / "performance").glob("*.csv"))
    columns = pd.read_csv(recording, nrows=1).columns
    assert tuple(columns[2:54]) == SHAPES
