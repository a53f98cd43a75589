"""With `capture.confined_to`, nothing of a capture leads out of the folders that it names."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from vermilion.config.load import load_configuration
from vermilion.imaging.images import write_srgb8
from vermilion.storage.errors import ConfigurationError

HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder where the workflow starts, with a capture in `incoming` and a file that is private."""
    import numpy as np

    (tmp_path / "private").mkdir()
    write_srgb8(tmp_path / "private" / "000000.png", np.zeros((8, 8, 3), np.uint8))
    (tmp_path / "private" / "weights.csv").write_text("frame,jawOpen\n0,1\n")
    take = tmp_path / "incoming" / "s1" / "phone" / "frames" / "cam"
    take.mkdir(parents=True)
    write_srgb8(take / "000000.png", np.zeros((8, 8, 3), np.uint8))
    (tmp_path / "incoming" / "tracks").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def load(source, confined=("incoming",), **more):
    """Problems of a sheet of one row."""
    Path("takes.tsv").write_text(HEADER + f"s1\tphone\tvideo\t{source}\t0\t0\t25\tnone\n")
    raw = {"takes": "takes.tsv", "capture": {"confined_to": list(confined)}, **more}
    try:
        load_configuration(raw, "config.yaml")
    except ConfigurationError as error:
        return error.problems
    return []


CAPTURE = "incoming/s1/phone"


def test_a_capture_in_its_folder_is_read(place):
    assert load(CAPTURE) == []
    assert load(place / CAPTURE) == []  # absolute, but within


@pytest.mark.parametrize(
    "source", ["private", "incoming/../private", "/etc", "../outside", "incoming/s1/../../private"]
)
def test_a_source_that_leads_out_is_named_before_it_is_opened(place, source):
    problems = load(source)
    assert len(problems) == 1
    assert "takes.tsv, row 1, source" in problems[0] and source in problems[0]
    assert "capture.confined_to" in problems[0]


def test_without_the_key_any_path_is_allowed(place):
    assert load(place / "private", confined=()) == []


def test_a_further_folder_may_be_allowed(place):
    assert load("private", confined=("incoming", "private")) == []


@pytest.mark.parametrize("kind", ["source", "folder", "file", "through another link"])
def test_links_that_lead_out_are_named(place, kind):
    frames = place / CAPTURE / "frames"
    source = CAPTURE
    if kind == "source":
        (place / "incoming" / "take").symlink_to(place / "private")
        source = "incoming/take"
    elif kind == "folder":
        (frames / "left").symlink_to(place / "private")
    elif kind == "file":
        (frames / "cam" / "000001.png").symlink_to("../../../../../private/000000.png")
    else:
        (place / "incoming" / "far").symlink_to(place / "private")
        (frames / "left").symlink_to("../../../far")
    problems = load(source)
    assert len(problems) == 1 and "private" in problems[0]


def test_links_that_stay_within_are_followed(place):
    frames = place / CAPTURE / "frames" / "cam"
    (frames / "000001.png").symlink_to("000000.png")
    (place / "incoming" / "again").symlink_to("s1/phone")
    assert load("incoming/again") == []


def test_a_link_to_itself_and_a_pipe_are_named(place):
    frames = place / CAPTURE / "frames" / "cam"
    (frames / "000001.png").symlink_to("000001.png")
    os.mkfifo(frames / "000002.png")
    problems = " ".join(load(CAPTURE))
    assert "000001.png" in problems and "pipe" in problems


def test_labels_beside_a_video_are_looked_at(place):
    (place / "incoming" / "clip.mp4").write_bytes(b"")
    (place / "incoming" / "clip.mp4.labels").symlink_to(place / "private")
    problems = load("incoming/clip.mp4")
    assert len(problems) == 1 and "clip.mp4.labels" in problems[0]


def test_what_a_usd_names_is_looked_at(place):
    from pxr import Sdf, Usd

    Usd.Stage.CreateNew(str(place / "private" / "face.usda")).Save()
    layer = Sdf.Layer.CreateNew(str(place / CAPTURE / "track.usda"))
    layer.subLayerPaths.append("../../../private/face.usda")
    layer.Save()
    problems = load(CAPTURE)
    assert len(problems) == 1 and "track.usda" in problems[0] and "face.usda" in problems[0]


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ({"landmarks": {"detector": "files", "files": {"path": "private/{camera}.csv"}}}, "landmarks.files.path"),
        (
            {"tracking": {"external": {"base": {"weights": "private/{take}.csv"}}}},
            "tracking.external.base.weights",
        ),
        ({"tracking": {"scans": {"s1": {"path": "incoming/../private/s.obj"}}}}, "tracking.scans.s1"),
        ({"evaluation": {"truth": "private"}}, "evaluation.truth"),
    ],
)  # fmt: skip
def test_keys_that_name_data_of_captures_are_looked_at(place, more, key):
    problems = load(CAPTURE, **more)
    assert len(problems) == 1 and key in problems[0] and "config.yaml" in problems[0]
    assert load(CAPTURE, confined=("incoming", "private"), **more) == []
