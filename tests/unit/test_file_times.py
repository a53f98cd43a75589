"""Files from the future, as they are after the clock was set back."""

import os

import pytest

from vermilion.provenance.file_times import mend_future_times
from vermilion.storage.errors import InputError

NOW_S = 1_700_000_000.0


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "results"
    (folder / "inpaint").mkdir(parents=True)
    for name, time_s in (
        ("old.npz", NOW_S - 60),
        ("ahead.npz", NOW_S + 60),
        ("other.npz", NOW_S + 60),
    ):
        (folder / name).touch()
        os.utime(folder / name, (time_s, time_s))
    stamp = folder / "inpaint" / ".snakemake_timestamp"
    stamp.touch()
    os.utime(stamp, (NOW_S + 60, NOW_S + 60))
    return folder


def test_results_from_the_future_are_from_now(results):
    inputs = [results / name for name in ("old.npz", "ahead.npz", "inpaint", "not_made_yet.npz")]
    mended = mend_future_times(results, inputs, NOW_S)
    stamp = results / "inpaint" / ".snakemake_timestamp"
    assert {results / "ahead.npz", results / "other.npz", stamp} <= set(mended)
    assert (results / "other.npz").stat().st_mtime == NOW_S  # no job reads it now
    assert (results / "ahead.npz").stat().st_mtime == NOW_S
    assert (results / "inpaint" / ".snakemake_timestamp").stat().st_mtime == NOW_S
    assert (results / "old.npz").stat().st_mtime == NOW_S - 60
    assert mend_future_times(results, inputs, NOW_S) == []


def test_a_users_file_from_the_future_is_named_and_kept(results, tmp_path):
    image = tmp_path / "000001.png"
    image.touch()
    os.utime(image, (NOW_S + 7200, NOW_S + 7200))
    with pytest.raises(InputError, match=r"000001\.png: found a time in the future, 2023-11-1"):
        mend_future_times(results, [image, results / "ahead.npz"], NOW_S)
    assert image.stat().st_mtime == NOW_S + 7200
    assert (results / "ahead.npz").stat().st_mtime == NOW_S + 60
