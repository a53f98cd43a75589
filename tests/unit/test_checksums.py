"""The ledger finds what was damaged after its job had ended, and only that."""

import os

import pytest

from vermilion.provenance.checksums import find_damage, record, remove_damaged


@pytest.fixture
def results(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.npy").write_bytes(b"a" * 1000)
    (tmp_path / "folder" / "1.png").write_bytes(b"one")
    (tmp_path / "folder" / "2.png").write_bytes(b"two")
    return tmp_path


def ended(path):
    """As the workflow records it: the job ended when its output was last written."""
    files = [path] if path.is_file() else list(path.iterdir())
    return max(p.stat().st_mtime for p in files)


def outputs(results):
    """Each output is its own job."""
    return {path: path for path in (results / "a.npy", results / "folder")}


def test_untouched_results_are_whole(results):
    assert record(results, outputs(results), ended) == []
    assert find_damage(results) == []


def test_truncated_file_is_named_and_removed(results):
    record(results, outputs(results), ended)
    os.truncate(results / "a.npy", 10)
    damage = find_damage(results)
    assert [d.path.name for d in damage] == ["a.npy"]
    assert "10 bytes, not 1000" in damage[0].reason
    assert remove_damaged(results, damage) == [results / "a.npy"]
    assert not (results / "a.npy").exists()


def test_same_size_and_time_but_other_content_is_found(results):
    record(results, outputs(results), ended)
    state = (results / "a.npy").stat()
    (results / "a.npy").write_bytes(b"b" * 1000)
    os.utime(results / "a.npy", ns=(state.st_atime_ns, state.st_mtime_ns))
    assert [d.path.name for d in find_damage(results)] == ["a.npy"]


def test_folder_that_lost_a_file_goes_as_a_whole(results):
    record(results, outputs(results), ended)
    (results / "folder" / "1.png").unlink()
    damage = find_damage(results)
    assert [d.reason for d in damage] == ["missing"]
    assert remove_damaged(results, damage) == [results / "folder"]
    assert not (results / "folder").exists()


def test_change_after_the_job_is_not_recorded_as_good(results):
    ends = {path: ended(path) for path in outputs(results)}
    record(results, outputs(results), ends.get)
    os.truncate(results / "a.npy", 10)
    late = ends[results / "a.npy"] + 100
    os.utime(results / "a.npy", (late, late))
    refused = record(results, outputs(results), ends.get)
    assert [d.path.name for d in refused] == ["a.npy"]
    assert "make verify" in refused[0].reason
    assert [d.path.name for d in find_damage(results)] == ["a.npy"]


def test_output_of_a_job_that_was_cut_off_is_not_recorded_and_called_so(results):
    ends = {results / "folder": ended(results / "folder")}
    refused = record(results, outputs(results), ends.get)
    assert [d.path.name for d in refused] == ["a.npy"]
    assert "cut off" in refused[0].reason and "verify" not in refused[0].reason
    os.truncate(results / "a.npy", 10)
    assert find_damage(results) == []


def test_rerun_output_is_recorded_anew(results):
    record(results, outputs(results), ended)
    (results / "a.npy").write_bytes(b"c" * 500)
    assert record(results, outputs(results), ended) == []
    assert find_damage(results) == []


def test_outputs_of_a_job_go_together(results):
    first = results / "a.npy"
    record(results, {first: first, results / "folder": first}, ended)
    (results / "folder" / "1.png").write_bytes(b"uno")
    damage = find_damage(results)
    assert [d.path.name for d in damage] == ["1.png"]
    assert remove_damaged(results, damage) == [first, results / "folder"]
