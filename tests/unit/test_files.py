"""Whole files or none; tables, sequences and quality rows round-trip."""

import errno

import numpy as np
import pandas as pd
import pytest

from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import read_mesh, write_ply
from vermilion.storage import unwritable
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_folder, atomic_path
from vermilion.storage.quality import QualityRow, flagged_frames, write_quality
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.storage.tables import read_table, write_table
from vermilion.storage.unwritable import UnwritableError


def test_failing_writer_leaves_nothing(tmp_path):
    with pytest.raises(RuntimeError), atomic_path(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_failing_writer_leaves_the_old_file(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(RuntimeError), atomic_path(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert (tmp_path / "a.txt").read_text() == "old"


def test_folder_is_replaced_as_a_whole(tmp_path):
    (tmp_path / "f").mkdir()
    (tmp_path / "f" / "old").touch()
    with atomic_folder(tmp_path / "f") as temporary:
        (temporary / "new").touch()
    assert [p.name for p in (tmp_path / "f").iterdir()] == ["new"]
    with pytest.raises(RuntimeError), atomic_folder(tmp_path / "f"):
        raise RuntimeError
    assert [p.name for p in tmp_path.iterdir()] == ["f"]


def test_sequences_join_by_reading(tmp_path):
    frames = np.random.default_rng(0).normal(size=(5, 4, 3)).astype(np.float32)
    write_sequence(tmp_path / "a.npy", frames[:2])
    write_sequence(tmp_path / "b.npy", frames[2:])
    assert np.array_equal(read_sequence([tmp_path / "a.npy", tmp_path / "b.npy"]), frames)


def test_truncated_sequence_is_named(tmp_path):
    write_sequence(tmp_path / "a.npy", np.zeros((5, 4, 3)))
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(data[:150])
    with pytest.raises(InputError, match=r"a\.npy.*unreadable mesh sequence"):
        read_sequence(tmp_path / "a.npy")


def test_ply_keeps_vertices_and_order(tmp_path):
    mesh = Mesh(np.random.default_rng(0).normal(size=(7, 3)), np.array([[0, 1, 2], [4, 3, 6]]))
    write_ply(tmp_path / "m.ply", mesh)
    back = read_mesh(tmp_path / "m.ply")
    assert np.allclose(back.vertices_mm, mesh.vertices_mm, atol=1e-6)
    assert np.array_equal(back.triangles, mesh.triangles)


def test_table_names_its_missing_column(tmp_path):
    write_table(tmp_path / "t.tsv", [{"a_mm": 1.25}])
    assert read_table(tmp_path / "t.tsv")["a_mm"][0] == 1.25
    with pytest.raises(InputError, match="b_px"):
        read_table(tmp_path / "t.tsv", ["b_px"])


def test_rows_are_written_as_pandas_writes_them(tmp_path):
    rows = [
        {"frame": 1, "a_mm": 1.25, "reason": "a\ttab", "b": np.nan, "found": True},
        {"frame": np.int64(3), "a_mm": np.float32(0.1), "reason": 'a "word"', "b": 2.0},
        {"frame": 7, "a_mm": np.inf, "reason": "", "b": 123456.789012, "late": None},
    ]
    write_table(tmp_path / "rows.tsv", rows)
    write_table(tmp_path / "table.tsv", pd.DataFrame(rows))
    assert (tmp_path / "rows.tsv").read_text() == (tmp_path / "table.tsv").read_text()
    write_table(tmp_path / "none.tsv", [], ["frame", "a_mm"])
    assert (tmp_path / "none.tsv").read_text() == "frame\ta_mm\n"


def test_flagged_frames_and_warnings_carry_their_reason(tmp_path):
    rows = [
        QualityRow(0, figures={"error_px": 1.0}),
        QualityRow(1, False, "no face found"),
        QualityRow(2, True, "hard to see"),
    ]
    write_quality(tmp_path / "q.tsv", "anna", "rom", "landmarks", rows)
    flagged = flagged_frames([tmp_path / "q.tsv"])
    place = {"subject": "anna", "take": "rom", "stage": "landmarks"}
    assert flagged.to_dict("records") == [
        {**place, "frame": 1, "valid": 0, "reason": "no face found"},
        {**place, "frame": 2, "valid": 1, "reason": "hard to see"},
    ]


def test_invalid_row_needs_a_reason(tmp_path):
    with pytest.raises(ValueError, match="needs a reason"):
        write_quality(tmp_path / "q.tsv", "s", "t", "x", [QualityRow(0, False)])


class NoRoom(OSError):
    """What a write says on a full disk."""

    def __init__(self):
        super().__init__(errno.ENOSPC, "No space left on device")


def test_full_disk_is_one_sentence_that_names_the_file(tmp_path):
    with (
        pytest.raises(UnwritableError, match=r"a\.npy: found that the disk is full.*again"),
        atomic_path(tmp_path / "a.npy"),
    ):
        raise NoRoom
    with pytest.raises(UnwritableError, match="disk is full"), atomic_folder(tmp_path / "f"):
        raise RuntimeError("of a library") from NoRoom()
    assert list(tmp_path.iterdir()) == []


def test_file_of_a_silent_writer_on_a_full_disk_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(unwritable, "_free_bytes", lambda folder: 4096)
    with (
        pytest.raises(UnwritableError, match=r"disk is full \(4 kB left\)"),
        atomic_path(tmp_path / "a.png") as temporary,
    ):
        temporary.write_bytes(b"cut off, and nothing was said")
    assert list(tmp_path.iterdir()) == []


def test_other_errors_of_a_writer_stay_what_they_are(tmp_path):
    elsewhere = PermissionError(errno.EACCES, "Permission denied", "/elsewhere/input.png")
    with pytest.raises(PermissionError), atomic_path(tmp_path / "a.txt"):
        raise elsewhere
    with pytest.raises(InputError), atomic_path(tmp_path / "a.txt"):
        raise InputError("x", "y", "z") from NoRoom()


def test_folder_without_permission_is_one_sentence(tmp_path):
    here = PermissionError(errno.EACCES, "Permission denied", str(tmp_path / "a.txt"))
    with pytest.raises(UnwritableError, match=r"a\.txt: found no permission to write"):
        raise unwritable.explain(here, tmp_path / "a.txt")
