"""PS, MS and GR never train on a frame that is held out, and GR on nobody that it is judged by."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vermilion.config.regressors import (
    regressors_of,
    regressors_of_study,
    trained_on,
    with_variants,
)
from vermilion.config.takes import Take
from vermilion.database.read import LipDatabase
from vermilion.database.schema import SubjectEntry, TakeEntry
from vermilion.database.write import write_database
from vermilion.geometry.mesh import topology_hash
from vermilion.regression.training import Selection, train

TRIANGLES = np.array([[0, 1, 2], [1, 3, 2]])
NAMES = ("shape_01", "outer_width")

ranges = st.tuples(st.integers(0, 11), st.integers(0, 11)).map(sorted)
splits = st.one_of(
    st.sampled_from(["train", "test", "none"]),
    st.lists(ranges, min_size=1, max_size=3).map(
        lambda found: "test:" + ",".join(f"{low}-{high}" for low, high in found)
    ),
)
sheets = st.dictionaries(
    st.tuples(st.sampled_from(["ana", "bo", "cy"]), st.sampled_from(["rom", "talk"])),
    splits,
    min_size=2,
)


def take_of(subject, name, split):
    return Take(subject, name, "tattoo", "captures", 0, 11, 30.0, split)


def write(path, takes):
    """A database of the takes, each frame's first feature its number."""
    rng = np.random.default_rng(0)
    subjects = sorted({take.subject for take in takes})
    neutrals = {s: rng.normal(scale=30.0, size=(4, 3)) for s in subjects}
    entries = [
        TakeEntry(
            take.subject, take.take, take.fps, take.split,
            np.arange(12), rng.normal(size=(12, 2)).astype("f4"),
            rng.normal(size=(12, 2, 9)).astype("f4"), np.zeros((12, 4, 3), "f4"), np.ones(12, bool),
            np.isin(np.arange(12), take.train_frames()),
        )
        for take in takes
    ]  # fmt: skip
    people = [SubjectEntry(s, neutrals[s], np.arange(2)) for s in subjects]
    write_database(path, TRIANGLES, NAMES, people, entries)


@settings(max_examples=25, deadline=None)
@given(sheet=sheets)
def test_no_regressor_trains_on_what_it_is_judged_by(sheet, tmp_path_factory):
    takes = [take_of(*name, split) for name, split in sheet.items()]
    path = tmp_path_factory.mktemp("split") / "lips.h5"
    write(path, takes)
    with LipDatabase(path) as database:
        trained = {take.subject for take in takes if take.train_frames()}
        for name in regressors_of_study(database.subjects, trained):
            people = trained_on(name, database.subjects)
            assert not trained or set(people) & trained
            wanted = {(t.name, f) for t in takes if t.subject in people for f in t.train_frames()}
            if len(wanted) < 5:
                continue
            data = database.training_set(people)
            seen = {
                (data.takes[k], int(f)) for k, f in zip(data.sequences, data.frames, strict=True)
            }
            assert seen == wanted
            assert tuple(data.neutrals_mm) == data.subjects  # a bias is found by its place
            for take in takes:
                assert not seen & {(take.name, f) for f in take.test_frames()}
            if name.startswith("GR-"):
                judged = name.removeprefix("GR-")
                assert not {take for take, _ in seen if take.startswith(f"{judged}/")}


def test_a_take_held_out_whole_is_in_no_regressor(tmp_path):
    takes = [
        take_of("ana", "rom", "train"), take_of("ana", "talk", "test"),
        take_of("bo", "rom", "test:3-5,9-11"),
    ]  # fmt: skip
    write(tmp_path / "lips.h5", takes)
    place = (NAMES, np.arange(2), np.ones(2), topology_hash(TRIANGLES), np.arange(4))
    with LipDatabase(tmp_path / "lips.h5") as database:
        for name, expected in {
            "MS": {"ana/rom", "bo/rom"}, "PS-ana": {"ana/rom"}, "GR-ana": {"bo/rom"},
        }.items():  # fmt: skip
            data = database.training_set(trained_on(name, database.subjects))
            model, _ = train(name, data, *place, Selection(folds=2, clip_frames=2))
            assert set(model.training_frames) == expected
            if "bo/rom" in expected:
                np.testing.assert_array_equal(model.training_frames["bo/rom"], [0, 1, 2, 6, 7, 8])


def test_a_regressor_for_unseen_subjects_is_chosen_by_such(tmp_path):
    takes = [take_of(name, "rom", "train") for name in ("ana", "bo", "cy", "di")]
    write(tmp_path / "lips.h5", takes)
    place = (NAMES, np.arange(2), np.ones(2), topology_hash(TRIANGLES), np.arange(4))
    chosen = Selection(folds=5, clip_frames=2)
    with LipDatabase(tmp_path / "lips.h5") as database:
        frames = {}
        for name, people in (("MS", 4), ("GR-ana", 3), ("GR-ana-affine", 3)):
            data = database.training_set(trained_on(name, database.subjects))
            assert len(data.subjects) == people
            frames[name] = list(train(name, data, *place, chosen)[1].frames)
        assert len(frames["MS"]) == 5  # folds of clips
        assert frames["GR-ana"] == frames["GR-ana-affine"] == [12, 12, 12]  # a person each
        two = database.training_set(["bo", "cy"])
        assert len(train("GR-ana", two, *place, chosen)[1].frames) == 5  # too few to tell


@pytest.mark.parametrize("split", ["train", "test", "none", "test:0-4,8-8"])
def test_a_frame_trains_or_is_held_out_but_never_both(split):
    take = take_of("ana", "rom", split)
    assert not set(take.train_frames()) & set(take.test_frames())
    both = set(take.train_frames()) | set(take.test_frames())
    assert both == (set() if split == "none" else set(range(12)))


@given(people=st.lists(st.sampled_from("abcde"), min_size=1, unique=True), data=st.data())
def test_a_person_is_judged_by_what_was_trained_and_by_nothing_twice(people, data):
    trained = data.draw(st.sets(st.sampled_from(people), min_size=1))
    study = regressors_of_study(people, trained)
    for subject in people:
        names = regressors_of(subject, trained)
        assert set(names) <= set(study)
        rows = [frozenset(trained_on(name, sorted(trained))) for name in names]
        for name, row in zip(names, rows, strict=True):
            assert row == set(trained_on(name, people)) & trained
        if len(trained) > 1:  # with one person who trains, PS and MS are the same
            assert len(set(rows)) == len(rows)
        if subject not in trained:
            assert names == [f"GR-{subject}"]


def test_variants_are_made_of_the_kinds_asked_for():
    names = with_variants(["PS-an-na", "MS", "GR-an-na"], ["rbf"], ["MS", "GR"])
    own, paper = ["PS-an-na", "MS", "GR-an-na"], ["PS-an-na-paper", "MS-paper", "GR-an-na-paper"]
    assert names == [*own, *paper, "MS-rbf", "GR-an-na-rbf"]
    assert with_variants(own, ["paper"], ["MS"]) == [*own, *paper]
