"""Every wrong row of a take sheet is named at once."""

import pytest

from vermilion.config.takes import Take, read_takes

HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"


def sheet(tmp_path, *rows):
    path = tmp_path / "takes.tsv"
    path.write_text(HEADER + "".join("\t".join(row) + "\n" for row in rows))
    return path


def test_good_sheet(tmp_path):
    path = sheet(
        tmp_path,
        ("s1", "plain", "plain", "studio", "0", "0", "30", "none"),
        ("s1", "rom", "tattoo", "captures/s1/rom", "0", "46", "30", "test:34-46"),
    )
    takes, problems = read_takes(path)
    assert problems == []
    assert takes[1].test_frames() == list(range(34, 47))
    assert takes[1].train_frames() == list(range(34))
    assert takes[0].test_frames() == [] and takes[0].train_frames() == []


def test_all_problems_at_once(tmp_path):
    path = sheet(
        tmp_path,
        ("s 1", "rom", "tatoo", "", "9", "3", "fast", "half"),
        ("s2", "rom", "tattoo", "studio", "0", "9", "30", "test:5-12"),
        ("s3", "rom", "tattoo", "studio", "0", "9", "30", "train"),
        ("s4", "p", "plain", "studio", "0", "5", "30", "none"),
        ("s4", "p", "plain", "studio", "0", "0", "30", "none"),
    )
    _, problems = read_takes(path)
    text = "\n".join(problems)
    for fact in (
        "row 1 (s 1/rom): subject: found 's 1'",
        "role: found 'tatoo'; expected one of tattoo, plain, video, tracked",
        "source: found nothing",
        "frames: found 9 to 3",
        "fps: found 'fast'; expected a number",
        "split: found 'half'",
        "held-out frames 5 to 12; expected them within 0 to 9",
        "take s3/rom: found 0 `plain` takes",
        "take s4/p: found 2 rows",
        "take s4/p: found 6 frames",
    ):
        assert fact in text, fact
    assert all(str(path) in problem for problem in problems)


def test_header_is_named(tmp_path):
    path = tmp_path / "takes.tsv"
    path.write_text("subject take\n")
    takes, problems = read_takes(path)
    assert takes == [] and "header: found columns ['subject take']" in problems[0]


@pytest.mark.parametrize(
    ("split", "train", "test"),
    [("train", 10, 0), ("test", 0, 10), ("none", 0, 0), ("test:2-4", 7, 3), ("test:2-4,8-9", 5, 5)],
)
def test_no_frame_is_both_trained_and_tested(split, train, test):
    take = Take("s", "t", "tattoo", "x", 0, 9, 30.0, split)
    assert (len(take.train_frames()), len(take.test_frames())) == (train, test)
    assert not set(take.train_frames()) & set(take.test_frames())
