"""Intermediate results that were removed on purpose are not missed; others are."""

from pathlib import Path

import pytest

from vermilion.provenance.cleaning import (
    LIST,
    clean,
    cleaned,
    forget_remade,
    intermediate_outputs,
    matches,
)


@pytest.fixture
def results(tmp_path):
    for name in (
        "takes/s1/rom/inpaint/000000-000007/000000.png",
        "takes/s1/rom/inpaint/overlay/000000-000007.png",
        "takes/s1/rom/inpaint/reference.exr",
        "takes/s1/rom/multiview/clips/0001.npz",
        "takes/s1/rom/features/000000-000007.npz",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"12345")
    return tmp_path


@pytest.fixture
def patterns(results):
    take = f"{results}/takes/{{subject}}/{{take}}"
    return [f"{take}/inpaint/{{chunk}}", f"{take}/multiview/clips/{{clip}}.npz"]


def test_only_chunks_and_clips_match(results, patterns):
    found = intermediate_outputs(results, patterns)
    assert [path.name for path in found] == ["000000-000007", "0001.npz"]
    assert not matches(results / "takes/s1/rom/inpaint/overlay", patterns)


def test_cleaned_ones_are_known_until_they_are_made_again(results, patterns):
    found = intermediate_outputs(results, patterns)
    clean(results, found)
    assert cleaned(results) == frozenset(found) and not any(path.exists() for path in found)
    found[1].write_bytes(b"again")
    assert cleaned(results) == {found[0]}
    forget_remade(results)
    found[1].unlink()  # lost: it is missed
    assert cleaned(results) == {found[0]}
    clean(results, [])
    assert cleaned(results) == {found[0]}


def test_nothing_was_cleaned(results):
    forget_remade(results)
    assert cleaned(results) == frozenset() and not (results / LIST).exists()


def test_the_list_has_paths_within_the_results(results, patterns):
    clean(results, intermediate_outputs(results, patterns))
    listed = (results / LIST).read_text().splitlines()
    assert listed == [
        "takes/s1/rom/inpaint/000000-000007",
        "takes/s1/rom/multiview/clips/0001.npz",
    ]
    assert not any(Path(name).is_absolute() for name in listed)
