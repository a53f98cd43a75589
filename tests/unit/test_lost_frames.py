"""Frames whose mesh lost the lips are told by the pattern that is not there any more."""

import numpy as np
import pytest

from vermilion.multiview.lost_frames import failed_frames, lost_frames, lost_rows
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.tables import write_table


@pytest.mark.parametrize(
    ("differences", "expected"),
    [
        ([0.0, 0.2, 0.3, 0.5, 0.3], []),  # unlike, but not lost
        ([0.0, 0.2, 0.64, 0.9, 0.48, 0.67, 0.43, 0.3], [2, 3, 4, 5, 6]),  # until it is found again
        ([0.0, 0.45, 0.7, 0.45, 0.39, 0.45], [1, 2, 3]),  # what is near it, too
        ([0.0, 0.45, np.nan, 0.7], [3]),  # nothing is said of a frame that was not measured
        ([], []),
    ],
)
def test_a_run_of_unlike_lips_is_lost_where_one_frame_is_unlike_enough(differences, expected):
    assert np.flatnonzero(lost_rows(np.array(differences), 0.6, 0.4)).tolist() == expected


def test_frames_of_all_chunks_are_told_with_their_reason(tmp_path):
    values = {0: 0.0, 1: 0.5, 2: 0.8, 3: 0.2}
    for name, frames in (("a", (0, 1)), ("b", (2, 3))):
        rows = [{"frame": f, "camera": "all", "difference_vermilion": values[f]} for f in frames]
        rows += [{"frame": f, "camera": "c1", "difference_vermilion": 1.0} for f in frames]
        write_table(tmp_path / f"{name}.tsv", rows)
    quality = tmp_path / "quality.tsv"
    write_quality(quality, "anna", "rom", "multiview", [QualityRow(3, False, "no cloud")])
    drift = [tmp_path / "a.tsv", tmp_path / "b.tsv"]
    lost = lost_frames(drift, 0.6, 0.4)
    assert sorted(lost) == [1, 2] and "by 0.80: the mesh lost the lips" in lost[2]
    failed = failed_frames([quality], drift, {"difference": 0.6, "near_difference": 0.4})
    assert failed[3] == "the accurate mesh failed" and sorted(failed) == [1, 2, 3]
