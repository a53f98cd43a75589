"""A take sheet whose takes have another tracker's sequences as their base."""

import pytest

from vermilion.config.external_base import sequences_of
from vermilion.config.load import load_configuration
from vermilion.config.skip import without_skipped
from vermilion.storage.errors import ConfigurationError

HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\tof\n"
CAPTURE = (
    ("s", "plain", "plain", "c/plain", "0", "0", "30", "none", ""),
    ("s", "rom", "tattoo", "c/rom", "3", "46", "30", "train", ""),
    ("s", "shot", "video", "c/shot", "0", "9", "24", "none", ""),
)
SEQUENCES = (
    ("s", "rom_ft", "tracked", "t/rom", "", "", "30", "none", "rom"),
    ("s", "shot_ft", "tracked", "t/shot.usd", "", "", "30", "none", "shot"),
)


def sheet(tmp_path, *rows):
    path = tmp_path / "takes.tsv"
    path.write_text(HEADER + "".join("\t".join(row) + "\n" for row in rows))
    return path


def load(tmp_path, *rows, **raw):
    path = sheet(tmp_path, *rows)
    return load_configuration({"takes": str(path), **raw}, "mine.yaml", check_disk=False)


def test_a_sequence_has_the_frames_of_the_take_that_it_is_of(tmp_path):
    _, takes = load(tmp_path, *CAPTURE, *SEQUENCES)
    assert {name: row.take for name, row in sequences_of(takes).items()} == {
        "s/rom": "rom_ft", "s/shot": "shot_ft",
    }  # fmt: skip
    shot = sequences_of(takes)["s/shot"]
    assert (shot.first, shot.last, shot.fps) == (0, 9, 24.0)


def test_our_tracker_rests_and_the_head_stays(tmp_path):
    ours, _ = load(tmp_path, *CAPTURE)
    assert ours.tracking.image_fit.enabled and ours.correction.image.repose
    theirs, _ = load(tmp_path, *CAPTURE, *SEQUENCES)
    assert not theirs.tracking.image_fit.enabled and not theirs.correction.image.repose
    asked = {"correction": {"image": {"repose": True}}}
    assert load(tmp_path, *CAPTURE, *SEQUENCES, **asked)[0].correction.image.repose


@pytest.mark.parametrize(
    ("row", "found"),
    [
        (("s", "a", "tracked", "x", "", "", "30", "none", "gone"), "take s/a, of: found 'gone'"),
        (("s", "a", "tracked", "x", "", "", "30", "none", "plain"), "take s/a, of: found 'plain'"),
        (("s", "a", "tracked", "x", "", "", "30", "none", "rom"), "whose base is s/rom_ft already"),
        (("s", "a", "video", "x", "0", "1", "30", "none", "rom"), "in a row of role video"),
    ],
)
def test_rows_that_are_of_nothing_are_named(tmp_path, row, found):
    with pytest.raises(ConfigurationError) as error:
        load(tmp_path, *CAPTURE, *SEQUENCES, row)
    assert found in error.value.problems[0]


def test_a_run_has_one_base(tmp_path):
    with pytest.raises(ConfigurationError) as error:
        load(tmp_path, *CAPTURE, SEQUENCES[0])
    assert "takes: found no sequence of s/shot; expected a `tracked` row" in str(error.value)
    ours_alone = {
        "apply": {"export": {"topology": "full", "live_link": True}, "makeup": {"enabled": True}},
        "detail": {"takes": ["s/shot"]},
    }
    with pytest.raises(ConfigurationError) as error:
        load(tmp_path, *CAPTURE, *SEQUENCES, **ours_alone)
    for key in ("export.topology", "export.live_link", "makeup.enabled", "detail.takes"):
        assert key in str(error.value)


def test_a_take_is_left_out_with_its_sequence(tmp_path):
    configuration, takes = load(
        tmp_path, *CAPTURE, *SEQUENCES, skip_takes={"s/shot_ft": "unreadable"}
    )
    _, left = without_skipped(configuration, takes)
    assert {take.name for take in left} == {"s/plain", "s/rom", "s/rom_ft"}


def test_a_sequence_that_is_not_there_is_named_before_any_job(tmp_path):
    path = sheet(tmp_path, *CAPTURE, *SEQUENCES)
    base = {"weights": "w/{subject}_{of}.csv", "model": "other.npz"}
    raw = {"takes": str(path), "tracking": {"external": {"base": base}}}
    with pytest.raises(ConfigurationError, match="s/rom_ft: source: found no 't/rom'") as error:
        load_configuration(raw, "mine.yaml")
    for words in ("base.weights: found no 'w/s_rom.csv'", "base.model: found no 'other.npz'"):
        assert f"mine.yaml, key tracking.external.{words}" in str(error.value)


@pytest.mark.parametrize(
    ("source", "flame", "more", "words"),
    [
        (None, None, {}, "apply.export.flame: found true; expected false, since the base is our own"),
        ("t/shot.npz", None, {}, "tracking.external.flame: found nothing; expected your FLAME model"),
        ("t/shot.usd", "flame.npz", {}, "the base s/shot_ft is 't/shot.usd', which holds meshes"),
        (
            "t/shot.npz", "flame.npz", {"guided": {"takes": {"s/rom": "H"}}},
            "guided.takes corrects the sequence H of s/rom",
        ),
        ("t/shot.npz", "flame.npz", {}, None),
    ],
)  # fmt: skip
def test_flames_weights_need_its_parameters_and_a_model(tmp_path, source, flame, more, words):
    rows = [] if source is None else [(*row[:3], source, *row[4:]) for row in SEQUENCES]
    options = {"apply": {"export": {"flame": True}}, **more}
    options["tracking"] = {"external": {"flame": flame}}
    if words is None:
        load(tmp_path, *CAPTURE, *rows, **options)
        return
    with pytest.raises(ConfigurationError) as error:
        load(tmp_path, *CAPTURE, *rows, **options)
    assert words in str(error.value)
