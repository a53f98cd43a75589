"""The ledger finds what was damaged after its job had ended, and only that."""

import os
import shutil

import pytest

from vermilion.provenance.checksums import (
    LEDGER,
    find_damage,
    foreign_files,
    main,
    remove_damaged,
    removed_outputs,
    update_ledger,
)
from vermilion.storage.errors import InputError


@pytest.fixture
def results(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "a.npy").write_bytes(b"a" * 1000)
    (tmp_path / "folder" / "1.png").write_bytes(b"one")
    (tmp_path / "folder" / "2.png").write_bytes(b"two")
    return tmp_path


def ended(path):
    """As the workflow records it: the job ended when its output was last written."""
    files = [path] if path.is_file() else [path, *path.iterdir()]
    return max(p.stat().st_mtime for p in files)


def dated(path, seconds):
    """Move the time of a file."""
    time = path.stat().st_mtime + seconds
    os.utime(path, (time, time))


def outputs(results):
    """Each output is its own job."""
    return {path: path for path in (results / "a.npy", results / "folder")}


def test_untouched_results_are_whole(results):
    assert update_ledger(results, outputs(results), ended) == []
    assert find_damage(results) == []


def test_truncated_file_is_named_and_removed(results):
    update_ledger(results, outputs(results), ended)
    os.truncate(results / "a.npy", 10)
    damage = find_damage(results)
    assert [d.path.name for d in damage] == ["a.npy"]
    assert "10 bytes, not 1000" in damage[0].reason
    assert remove_damaged(results, damage) == [results / "a.npy"]
    assert not (results / "a.npy").exists()


def test_same_size_and_time_but_other_content_is_found(results):
    update_ledger(results, outputs(results), ended)
    state = (results / "a.npy").stat()
    (results / "a.npy").write_bytes(b"b" * 1000)
    os.utime(results / "a.npy", ns=(state.st_atime_ns, state.st_mtime_ns))
    assert [d.path.name for d in find_damage(results)] == ["a.npy"]


def test_folder_that_lost_a_file_goes_as_a_whole(results):
    update_ledger(results, outputs(results), ended)
    (results / "folder" / "1.png").unlink()
    damage = find_damage(results)
    assert [d.reason for d in damage] == ["missing"]
    assert remove_damaged(results, damage) == [results / "folder"]
    assert not (results / "folder").exists()


def test_change_after_the_job_is_not_recorded_as_good(results):
    ends = {path: ended(path) for path in outputs(results)}
    update_ledger(results, outputs(results), ends.get)
    os.truncate(results / "a.npy", 10)
    late = ends[results / "a.npy"] + 100
    os.utime(results / "a.npy", (late, late))
    refused = update_ledger(results, outputs(results), ends.get)
    assert [d.path.name for d in refused] == ["a.npy"]
    assert "make verify" in refused[0].reason
    assert [d.path.name for d in find_damage(results)] == ["a.npy"]


def test_output_of_a_job_that_was_cut_off_is_not_recorded_and_called_so(results):
    ends = {results / "folder": ended(results / "folder")}
    refused = update_ledger(results, outputs(results), ends.get)
    assert [d.path.name for d in refused] == ["a.npy"]
    assert "cut off" in refused[0].reason and "verify" not in refused[0].reason
    os.truncate(results / "a.npy", 10)
    assert find_damage(results) == []


def test_rerun_output_is_recorded_anew(results):
    update_ledger(results, outputs(results), ended)
    (results / "a.npy").write_bytes(b"c" * 500)
    assert update_ledger(results, outputs(results), ended) == []
    assert find_damage(results) == []


def test_outputs_of_a_job_go_together(results):
    first = results / "a.npy"
    update_ledger(results, {first: first, results / "folder": first}, ended)
    (results / "folder" / "1.png").write_bytes(b"uno")
    damage = find_damage(results)
    assert [d.path.name for d in damage] == ["1.png"]
    assert remove_damaged(results, damage) == [first, results / "folder"]


@pytest.fixture
def recorded(results):
    """Results of a finished run, and the ends of their jobs."""
    dated(results / "a.npy", -1000)  # its job ended long before the other
    (results / "b.npy").write_bytes(b"b" * 1000)
    outputs = {path: path for path in map(results.__truediv__, ("a.npy", "b.npy", "folder"))}
    ends = {path: ended(path) for path in outputs}
    assert update_ledger(results, outputs, ends.get) == []
    return results, outputs, ends


def put_back_older(results):
    (results / "b.npy").write_bytes(b"older" * 200)
    dated(results / "b.npy", -500)
    return {"b.npy"}


def swap(results):
    shutil.move(results / "a.npy", results / "aside")
    shutil.move(results / "b.npy", results / "a.npy")
    shutil.move(results / "aside", results / "b.npy")
    return {"a.npy", "b.npy"}


def truncate(results):
    os.truncate(results / "folder" / "2.png", 1)
    return {"2.png"}


def flip_bit(results):
    content = bytearray((results / "a.npy").read_bytes())
    content[500] ^= 4
    time = (results / "a.npy").stat().st_mtime_ns
    (results / "a.npy").write_bytes(content)
    os.utime(results / "a.npy", ns=(time, time))
    return {"a.npy"}


def empty_folder(results):
    shutil.rmtree(results / "folder")
    (results / "folder").mkdir()
    return {"folder"}


def lose_file_of_folder(results):
    (results / "folder" / "1.png").unlink()
    return {"1.png"}


def folder_in_place_of_file(results):
    (results / "a.npy").unlink()
    (results / "a.npy").mkdir()
    return {"a.npy"}


FAULTS = [
    put_back_older,
    swap,
    truncate,
    flip_bit,
    empty_folder,
    lose_file_of_folder,
    folder_in_place_of_file,
]


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("another_run", [False, True])
def test_every_fault_is_found_also_after_another_run(recorded, fault, another_run):
    results, outputs, ends = recorded
    spoilt = fault(results)
    if another_run:  # one in which no job of these runs
        update_ledger(results, outputs, ends.get)
    damage = find_damage(results)
    assert {item.path.name for item in damage} == spoilt
    remove_damaged(results, damage)
    assert not any(item.output.exists() for item in damage)


def test_a_run_of_part_of_the_results_forgets_none_of_the_others(recorded):
    results, outputs, ends = recorded
    update_ledger(results, {path: path for path in outputs if path.name == "a.npy"}, ends.get)
    truncate(results)
    assert [item.path.name for item in find_damage(results)] == ["2.png"]


def test_file_that_an_older_one_replaced_before_it_was_recorded_is_refused(results):
    ends = {path: ended(path) for path in outputs(results)}
    dated(results / "a.npy", -500)
    refused = update_ledger(results, outputs(results), ends.get)
    assert [item.path.name for item in refused] == ["a.npy"] and "older" in refused[0].reason


def test_same_content_with_another_time_is_whole(recorded):
    results, outputs, ends = recorded
    dated(results / "a.npy", 5000)
    assert update_ledger(results, outputs, ends.get) == [] and find_damage(results) == []


def test_folder_that_a_job_wrote_again_with_fewer_files_is_whole(recorded):
    results, outputs, ends = recorded
    (results / "folder" / "1.png").unlink()
    dated(results / "folder" / "2.png", 10)
    ends[results / "folder"] += 10
    assert update_ledger(results, outputs, ends.get) == [] and find_damage(results) == []


def test_a_file_that_no_job_wrote_is_named_and_left(recorded, capsys):
    results, outputs, ends = recorded
    (results / "folder" / "3.png").write_bytes(b"three")
    dated(results / "folder" / "3.png", -500)
    assert [item.path.name for item in update_ledger(results, outputs, ends.get)] == ["3.png"]
    assert foreign_files(results) == [results / "folder" / "3.png"]
    assert main([str(results)]) == 1
    printed = capsys.readouterr().out
    assert "foreign" in printed and "3.png" in printed and "0 damaged" in printed
    assert (results / "folder" / "3.png").is_file()


def test_a_result_that_is_gone_as_a_whole_is_said(recorded, capsys):
    results, _, _ = recorded
    (results / "a.npy").unlink()
    assert find_damage(results) == [] and removed_outputs(results) == [results / "a.npy"]
    assert main([str(results)]) == 0  # somebody removed it: no damage
    assert "1 result(s) were removed as a whole" in capsys.readouterr().out


def test_a_ledger_that_is_cut_off_is_refused(recorded):
    results, outputs, ends = recorded
    os.truncate(results / LEDGER, (results / LEDGER).stat().st_size - 40)
    for use in (lambda: find_damage(results), lambda: update_ledger(results, outputs, ends.get)):
        with pytest.raises(InputError, match=r"checksums.tsv.*cut off or damaged.*Remove the file"):
            use()
