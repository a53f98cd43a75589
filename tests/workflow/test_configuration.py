"""The configuration is checked as a whole, before any job runs; what is generated is up to date."""

import difflib

import pytest
import yaml

from vermilion.config.load import load_configuration
from vermilion.config.moved import MOVED, REMOVED
from vermilion.config.reference import generated_files
from vermilion.config.root import Configuration
from vermilion.config.takes import STUDIO
from vermilion.storage.errors import ConfigurationError

from .conftest import ROOT


@pytest.mark.parametrize("name", ["config", "tiny", "sample"])
def test_examples_are_valid(name, monkeypatch):
    monkeypatch.chdir(ROOT)
    raw = yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text())
    _, takes = load_configuration(raw, f"{name}.yaml", check_disk=False)
    assert takes
    if name != "sample":
        assert {take.source for take in takes} == {STUDIO}


def test_sample_takes_exist(monkeypatch, data_root):
    monkeypatch.chdir(ROOT)
    raw = yaml.safe_load((ROOT / "config" / "sample.yaml").read_text())
    if (ROOT / "../shared/data").resolve() != data_root.resolve():
        pytest.skip("config/sample.yaml names ../shared/data, the data lie elsewhere")
    load_configuration(raw, "sample.yaml", check_disk=True)


def test_problems_of_both_files_are_listed_at_once(tmp_path):
    sheet = tmp_path / "takes.tsv"
    sheet.write_text(
        "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"
        "anna\trom\ttattoo\tstudio\t0\t9\t30\ttrain\n"
        f"anna\tshot\tvideo\t{tmp_path}/no.mp4\t0\t9\t25\tnone\n"
    )
    raw = {
        "takes": str(sheet),
        "chunk_frames": 0,
        "tranining": {},
        "capture": {"frontal_camera": 3},
    }
    with pytest.raises(ConfigurationError) as error:
        load_configuration(raw, "mine.yaml")
    text = str(error.value)
    assert "mine.yaml, key chunk_frames: found 0" in text
    assert "mine.yaml, key tranining: found an unknown key" in text
    assert "mine.yaml, key capture.frontal_camera: found 3" in text
    assert "take anna/rom: found 0 `plain` takes" in text
    assert f"found no '{tmp_path}/no.mp4'" in text


def test_takes_that_are_named_must_exist(tmp_path):
    sheet = tmp_path / "takes.tsv"
    sheet.write_text(
        "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"
        "anna\tshot\tvideo\tstudio\t0\t9\t25\tnone\n"
    )
    raw = {
        "takes": str(sheet),
        "apply": {"takes": ["anna/other"]},
        "correction": {"neutral_frames": {"anna/shot": 0}},
        "studio": {"subjects": {"berta": {}}},
    }
    with pytest.raises(ConfigurationError) as error:
        load_configuration(raw, "mine.yaml")
    text = str(error.value)
    assert "key apply.takes: found 'anna/other'" in text
    assert "neutral_frames: found 'anna/shot'; expected a take of role video of a subject" in text
    assert "studio.subjects: found ['berta']; expected also 'anna'" in text
    assert "studio.subjects.berta: found a subject without takes" in text


def test_a_neutral_frame_is_one_of_the_take(tmp_path):
    sheet = tmp_path / "takes.tsv"
    sheet.write_text(
        "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"
        "anna\trom\ttattoo\trig\t0\t9\t25\ttrain\n"
        "anna\tshot\tvideo\tx.mp4\t5\t9\t25\tnone\n"
    )
    raw = {"takes": str(sheet), "correction": {"neutral_frames": {"anna/shot": 4}}}
    with pytest.raises(ConfigurationError) as error:
        load_configuration(raw, "mine.yaml", check_disk=False)
    assert (
        "mine.yaml, key correction.neutral_frames.anna/shot: found frame 4; expected one of 5 to 9"
        in str(error.value)
    )


@pytest.mark.parametrize("name", sorted(generated_files()))
def test_generated_files_are_up_to_date(name):
    path = ROOT / name
    stored = path.read_text() if path.is_file() else ""
    expected = generated_files()[name]
    difference = difflib.unified_diff(
        stored.splitlines(), expected.splitlines(), name, "generated", lineterm=""
    )
    assert stored == expected, "run `make docs`:\n" + "\n".join(difference)


def error_of_key(key):
    """What the check says of a configuration that sets this key alone."""
    raw = {"takes": str(ROOT / "config/takes.tsv")}
    section = raw
    *parts, last = key.split(".")
    for part in parts:
        section = section.setdefault(part, {})
    section[last] = True
    with pytest.raises(ConfigurationError) as caught:
        load_configuration(raw, "old.yaml", check_disk=False)
    return str(caught.value)


@pytest.mark.parametrize(("old", "new"), sorted(MOVED.items()))
def test_key_of_an_earlier_version_is_named_with_its_new_name(old, new):
    message = error_of_key(old)
    assert f"key {old}: found a key of an earlier version; expected {new}. Rename it." in message
    assert "unknown key" not in message


@pytest.mark.parametrize(("key", "reason"), sorted(REMOVED.items()))
def test_key_that_is_gone_is_named_with_the_reason(key, reason):
    message = error_of_key(key)
    assert f"key {key}: found a key of an earlier version; expected none" in message
    assert reason in message and message.endswith("Remove it.")
    assert "unknown key" not in message


def test_no_key_that_is_gone_is_a_key():
    for key in REMOVED:
        section = Configuration
        *parts, last = key.split(".")
        for part in parts:
            section = section.model_fields[part].annotation
        assert last not in section.model_fields


def test_every_new_name_is_a_key():
    for new in MOVED.values():
        section = Configuration
        for part in new.split("."):
            field = section.model_fields[part]
            section = field.annotation
