"""Take sheets and tables as editors, spreadsheets and accidents make them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.faults.case import Case, check, parametrized
from vermilion.config.takes import read_takes
from vermilion.landmarks.table import read_landmark_csv
from vermilion.scan.landmarks import read_scan_landmarks
from vermilion.storage.errors import ConfigurationError
from vermilion.storage.tables import read_table
from vermilion.studio.live_link import read_live_link

HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit"
ROW = "s1\tphone\tvideo\tclip.mp4\t0\t9\t25\tnone"
SHEET = f"{HEADER}\n{ROW}\n"
WIDE = 10**6


def sheet(path: Path):
    """The rows of a sheet; what is wrong with them is one error, as `load_configuration` raises it."""
    takes, problems = read_takes(path)
    if problems:
        raise ConfigurationError(problems)
    return takes


def landmarks(path: Path):
    return read_landmark_csv(path).by_frame


def curves(path: Path):
    return read_live_link(path, ("jawOpen",), 3, 30.0)


def quality(path: Path):
    return read_table(path, ("frame", "valid"))


def file(name: str, data):
    def make(folder, rng):
        path = folder / name
        data_now = data() if callable(data) else data
        path.write_bytes(data_now if isinstance(data_now, bytes) else data_now.encode())
        return path

    return make


def row(**cells) -> str:
    """A sheet of one row with other cells."""
    named = dict(zip(HEADER.split("\t"), ROW.split("\t"), strict=True)) | cells
    return f"{HEADER}\n" + "\t".join(named.values()) + "\n"


def tracked(rows: int = 3, points: int = 66, sep: str = ",") -> str:
    """Landmarks of another tracker."""
    names = ["frame", *(f"{axis}_{k}" for axis in "xy" for k in range(points))]
    lines = [sep.join(names)]
    lines += [sep.join([str(n + 1), *["100.5"] * (2 * points)]) for n in range(rows)]
    return "\n".join(lines) + "\n"


def noisy(folder, rng):
    path = folder / "takes.tsv"
    path.write_bytes(rng.bytes(3000))
    return path


CURVES = "Timecode,BlendShapeCount,JawOpen\n" + "0,61,0.5\n" * 4
SCAN = "landmark\tx\ty\tz\n" + "".join(f"{k}\t{k}\t{k * k}\t1\n" for k in range(8))
QUALITY = "frame\tvalid\treason\n0\t1\t\n1\t0\tdark\n"


def a_folder(folder):
    (folder / "q.tsv").mkdir()
    return folder / "q.tsv"


def one_take(takes):
    return [take.name for take in takes] == ["s1/phone"]


def three(by_frame):
    return sorted(by_frame) == [0, 1, 2]


WIDE_SHEET = lambda: HEADER + "".join(f"\tc{k}" for k in range(WIDE)) + f"\n{ROW}\n"  # noqa: E731
CASES = [
    Case("sheet: no fps", file("takes.tsv", SHEET.replace("\tfps", "")), sheet, "fps"),
    Case("sheet: unknown column", file("takes.tsv", SHEET.replace("split", "spilt")), sheet, "spilt"),
    Case("sheet: commas", file("takes.tsv", SHEET.replace("\t", ",")), sheet, "tabs"),
    Case("sheet: empty", file("takes.tsv", ""), sheet, "columns"),
    Case("sheet: header alone", file("takes.tsv", HEADER + "\n"), sheet, "no take"),
    Case("sheet: 10^6 columns", file("takes.tsv", WIDE_SHEET), sheet, "columns", heavy=True),
    Case("sheet: UTF-16", file("takes.tsv", SHEET.encode("utf-16")), sheet, "UTF-8"),
    Case("sheet: noise", noisy, sheet, "UTF-8|columns"),
    Case("sheet: too few cells", file("takes.tsv", f"{HEADER}\ns1\tphone\n"), sheet, "role"),
    Case("sheet: too many cells", file("takes.tsv", f"{HEADER}\n{ROW}\tmore\n"), sheet, "cells"),
    Case("sheet: column twice", file("takes.tsv", f"{HEADER}\tfps\n{ROW}\t30\n"), sheet, "twice"),
    Case("sheet: formula as a name", file("takes.tsv", row(take="=HYPERLINK(0)")), sheet, "letters"),
    Case("sheet: formula as a number", file("takes.tsv", row(first="=A1+1")), sheet, "whole number"),
    Case("sheet: name that leaves its folder", file("takes.tsv", row(take="..")), sheet, "take"),
    Case("sheet: two rows of one take", file("takes.tsv", f"{SHEET}{ROW}\n"), sheet, "2 rows"),
    Case("sheet: last before first", file("takes.tsv", row(first="9", last="3")), sheet, "first <= last"),
    Case("sheet: 10^15 frames", file("takes.tsv", row(last="1000000000000000")), sheet, "999999",
         heavy=True),
    Case("sheet: rate NaN", file("takes.tsv", row(fps="nan")), sheet, "fps"),
    Case("sheet: rate infinite", file("takes.tsv", row(fps="inf")), sheet, "fps"),
    Case("sheet: digits of another script", file("takes.tsv", row(first="٣")), sheet,
         right=one_take),
    Case("sheet: zero byte in a path", file("takes.tsv", row(source="a\0b.mp4")), sheet, "source"),
    Case("sheet: quote that does not end", file("takes.tsv", row(source='"clip.mp4') + ROW.replace("phone", "two") + "\n"),
         sheet, "row 1.*quotation mark"),
    Case("sheet: quotes of a spreadsheet", file("takes.tsv", row(source='"clip.mp4"')), sheet,
         right=one_take),
    Case("sheet: byte order mark", file("takes.tsv", SHEET.encode("utf-8-sig")), sheet, right=one_take),
    Case("sheet: CRLF", file("takes.tsv", SHEET.replace("\n", "\r\n")), sheet, right=one_take),
    Case("sheet: CR", file("takes.tsv", SHEET.replace("\n", "\r")), sheet, right=one_take),
    Case("sheet: blanks at the ends", file("takes.tsv", SHEET.replace("\t", " \t ")), sheet, right=one_take),
    Case("sheet: empty rows", file("takes.tsv", f"{SHEET}\n\t\t\t\t\t\t\t\n"), sheet, right=one_take),
    Case("landmarks: no y", file("a.csv", tracked().replace("y_3,", "")), landmarks, "columns"),
    Case("landmarks: other count", file("a.csv", tracked(points=51)), landmarks, "columns"),
    Case("landmarks: 10^6 columns", file("a.csv", lambda: ",".join(map(str, range(WIDE)))), landmarks,
         "columns", heavy=True),
    Case("landmarks: empty", file("a.csv", ""), landmarks, "unreadable table"),
    Case("landmarks: a word", file("a.csv", tracked().replace("100.5", "left", 1)), landmarks, "no number"),
    Case("landmarks: formula", file("a.csv", tracked().replace("100.5", "=1+1", 1)), landmarks, "no number"),
    Case("landmarks: ragged", file("a.csv", tracked() + "1,2,3" + ",4" * 300 + "\n"), landmarks,
         "unreadable table"),
    Case("landmarks: frame twice", file("a.csv", tracked() + tracked().splitlines()[1] + "\n"), landmarks,
         "frame 1 in 2 rows"),
    Case("landmarks: frame NaN", file("a.csv", tracked().replace("\n2,", "\n,")), landmarks, "frame"),
    Case("landmarks: column twice", file("a.csv", tracked().replace("x_1,", "x_0,", 1)), landmarks, "'x_0' twice"),
    Case("landmarks: UTF-16", file("a.csv", lambda: tracked().encode("utf-16")), landmarks,
         "unreadable table"),
    Case("landmarks: zero bytes inside", file("a.csv", tracked().replace("100.5", "1\0", 3)), landmarks,
         "no number|unreadable"),
    Case("landmarks: byte order mark", file("a.csv", lambda: tracked().encode("utf-8-sig")), landmarks,
         right=three),
    Case("landmarks: CRLF", file("a.csv", tracked().replace("\n", "\r\n")), landmarks, right=three),
    Case("landmarks: NaN is no landmark", file("a.csv", tracked().replace("100.5", "nan", 1)), landmarks,
         right=lambda by_frame: sorted(by_frame) == [1, 2]),
    Case("curves: no JawOpen", file("a.csv", CURVES.replace("JawOpen", "Jaw")), curves, "columns"),
    Case("curves: too few rows", file("a.csv", CURVES[:50]), curves, "rows"),
    Case("curves: byte order mark", file("a.csv", CURVES.encode("utf-8-sig")), curves,
         right=lambda weights: np.allclose(weights, 0.5)),
    Case("curves: infinite", file("a.csv", CURVES.replace("0.5", "inf")), curves, "finite"),
    Case("scan: no z", file("a.tsv", SCAN.replace("\tz", "")), read_scan_landmarks, "columns|'z'"),
    Case("scan: words", file("a.tsv", SCAN.replace("4\t16", "left\t16")), read_scan_landmarks, "number"),
    Case("scan: NaN", file("a.tsv", SCAN.replace("4\t16", "\t16")), read_scan_landmarks, "number"),
    Case("scan: number twice", file("a.tsv", SCAN + "3\t0\t0\t0\n"), read_scan_landmarks, "twice"),
    Case("scan: fractions", file("a.tsv", SCAN.replace("\n3\t", "\n3.5\t")), read_scan_landmarks, "3.5"),
    Case("scan: CRLF", file("a.tsv", SCAN.replace("\n", "\r\n")), read_scan_landmarks,
         right=lambda found: found.known.sum() == 8),
    Case("results: column missing", file("q.tsv", QUALITY.replace("valid", "good")), quality, "valid"),
    Case("results: empty", file("q.tsv", ""), quality, "unreadable table"),
    Case("results: 10^6 columns", file("q.tsv", lambda: "\t".join(map(str, range(WIDE)))), quality,
         "columns", heavy=True),
    Case("results: quote that does not end", file("q.tsv", QUALITY.replace("dark", '"dark')), quality,
         "unreadable table"),
    Case("results: a folder", lambda folder, rng: a_folder(folder), quality, "unreadable table"),
]  # fmt: skip


@parametrized(CASES)
def test_table(case, seed, tmp_path):
    check(case, seed, tmp_path)
