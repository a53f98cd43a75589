"""Expression curves: they begin at the neutral, keep their range and their names."""

import numpy as np
import pytest

from vermilion.storage.errors import InputError
from vermilion.studio.live_link import arkit_name, mirrored_weights, read_live_link
from vermilion.studio.performance import (
    generated_weights,
    head_motion,
    random_poses,
    start_at_neutral,
)

NAMES = ("jawOpen", "mouthPucker", "mouthSmile_L", "mouthSmile_R", "mouthRollLower", "eyeBlink_L")


def test_a_take_starts_at_the_neutral_and_eases_in():
    weights = np.full((20, len(NAMES)), 0.5)
    eased = start_at_neutral(NAMES, weights, slight_open=0.08, ease_in_frames=6)
    assert eased[0].tolist() == [0.08, 0, 0, 0, 0, 0]
    assert np.array_equal(eased[6:], weights[6:])
    assert (np.diff(eased[:7, 1]) > 0).all()
    assert np.abs(np.diff(eased[:, 1])).max() < 0.5 * 0.3  # no jump


def test_generated_curves_are_weights_and_smooth():
    weights = generated_weights(NAMES, 300, 30.0, seed=1)
    assert weights.shape == (300, len(NAMES))
    assert weights.min() >= 0 and weights.max() <= 1
    mouth = weights[:, :5]
    assert np.abs(np.diff(mouth, axis=0)).max() < 0.3  # of full weight in a frame
    assert (weights.max(axis=0) > 0.4).all()  # every shape is used


def test_generated_curves_depend_on_the_seed_alone():
    first = generated_weights(NAMES, 60, 30.0, seed=1)
    assert np.array_equal(first, generated_weights(NAMES, 60, 30.0, seed=1))
    assert not np.allclose(first, generated_weights(NAMES, 60, 30.0, seed=2))


def test_few_poses_come_again_and_again():
    few = generated_weights(NAMES, 240, 30.0, seed=1, n_poses=3, pose_seconds=(0.1, 0.15))
    used = few.max(axis=0) > 0
    assert dict(zip(NAMES, used, strict=True)) == {
        "jawOpen": True,
        "mouthPucker": True,
        "mouthSmile_L": False,
        "mouthSmile_R": False,
        "mouthRollLower": True,
        "eyeBlink_L": True,
    }


def test_the_length_of_a_take_does_not_change_its_beginning():
    short, long = (generated_weights(NAMES[:5], n, 30.0, seed=4) for n in (40, 80))
    assert np.allclose(short, long[:40])


def test_the_head_rests_in_the_first_frame_and_turns_no_further_than_asked():
    rotations, translations = head_motion(120, 30.0, 3, 2.5, 2.0, np.array([0.0, -80.0, 20.0]))
    assert np.allclose(rotations[0], np.eye(3)) and np.allclose(translations[0], 0)
    assert np.allclose(rotations @ rotations.transpose(0, 2, 1), np.eye(3))
    turn = np.degrees(np.arccos(np.clip((np.trace(rotations, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    assert 0.1 < turn.max() < 2.5 * np.sqrt(3)  # degrees, over three axes


def test_random_poses_are_weights():
    poses = random_poses(NAMES, 50, seed=0)
    assert poses.shape == (50, len(NAMES))
    assert poses.min() >= 0 and poses.max() <= 1
    assert len(np.unique(poses[:, 0])) > 40


@pytest.mark.parametrize(
    ("column", "name"),
    [
        ("EyeBlinkLeft", "eyeBlink_L"),
        ("MouthSmileRight", "mouthSmile_R"),
        ("MouthLeft", "mouthLeft"),
        ("JawRight", "jawRight"),
        ("JawOpen", "jawOpen"),
    ],
)
def test_live_link_names_become_arkit_names(column, name):
    assert arkit_name(column) == name


def write_csv(path, rows):
    header = "Timecode,BlendShapeCount,JawOpen,MouthSmileLeft,BrowInnerUp,HeadYaw"
    lines = [f"00:00:00:00.0,61,{r / 100},{r / 200},0.3,0.1" for r in range(rows)]
    path.write_text("\n".join([header, *lines]) + "\n")


def test_live_link_curves_are_resampled_and_split(tmp_path):
    write_csv(tmp_path / "take.csv", 61)
    names = ("jawOpen", "mouthSmile_L", "browInnerUp_L", "browInnerUp_R", "mouthPucker")
    weights = read_live_link(tmp_path / "take.csv", names, 11, fps=30.0, csv_first=20, csv_fps=60.0)
    assert np.allclose(weights[:, 0], 0.20 + 0.02 * np.arange(11))  # every second row
    assert np.allclose(weights[:, 1], weights[:, 0] / 2)
    assert np.allclose(weights[:, 2:4], 0.3)
    assert np.allclose(weights[:, 4], 0.0)


def test_a_live_link_file_that_is_too_short_is_named(tmp_path):
    write_csv(tmp_path / "take.csv", 10)
    with pytest.raises(InputError, match=r"10 rows; expected at least 25"):
        read_live_link(tmp_path / "take.csv", NAMES, 20, 30.0, csv_first=5)


def test_another_table_is_refused(tmp_path):
    (tmp_path / "other.csv").write_text("time,value\n0,1\n")
    with pytest.raises(InputError, match="ARKit weights"):
        read_live_link(tmp_path / "other.csv", NAMES, 1, 30.0)


@pytest.mark.data
def test_the_recorded_performance_reads_whole(data_root):
    weights = read_live_link(
        data_root / "performance" / "rom.csv", NAMES, 180, 30.0, csv_first=2260
    )
    assert weights.max(axis=0)[:2].min() > 0.3  # the mouth moves in this part


def test_a_mirrored_recording_has_left_and_right_exchanged_and_the_rest_as_it_was():
    names = ("mouthSmile_L", "mouthSmile_R", "jawOpen", "mouthLeft", "mouthRight", "jawLeft")
    weights = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]])
    mirrored = mirrored_weights(names, weights)
    # Nothing stands for jawRight here, so that jawLeft has no counterpart.
    assert mirrored.tolist() == [[0.2, 0.1, 0.3, 0.5, 0.4, 0.6]]
    assert np.array_equal(mirrored_weights(names, mirrored), weights)
