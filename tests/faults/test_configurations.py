"""Configurations with what YAML allows and nobody means, and with what no key takes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.faults.case import Case, check, parametrized
from vermilion.config.load import load_configuration, read_keys

SHEET = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\ns1\tphone\tvideo\tclip.mp4\t0\t9\t25\tnone\n"


def load(path: Path):
    """As `make run` does: the file's keys, then all of them checked."""
    keys = read_keys(path)
    if keys.get("takes") == "takes.tsv":
        keys["takes"] = str(path.parent / "takes.tsv")
    return load_configuration(keys, str(path), check_disk=False)[0]


def file(text, encoding="utf-8"):
    """A configuration of some lines, beside a good sheet."""

    def make(folder, rng):
        (folder / "takes.tsv").write_text(SHEET)
        path = folder / "config.yaml"
        content = text if isinstance(text, bytes) else f"takes: takes.tsv\n{text}".encode(encoding)
        path.write_bytes(content)
        return path

    return make


def cut(folder, rng):
    make = file("capture:\n  frontal_camera: 'face2'\n")
    path = make(folder, rng)
    path.write_bytes(path.read_bytes()[: -int(rng.integers(2, 8))])
    return path


def named(name: str, text, says: str = "", right=None, **options):
    return Case(name, file(text, **options), load, says, right)


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 9)
)
CASES = [
    named("anchors that are used", "capture: &c\n  frontal_camera: &name face3\n", right=lambda c:
          c.capture.frontal_camera == "face3"),
    named("anchors that are merged", "capture: {<<: {exr_layer: a}, frontal_camera: face3}\n", right=lambda c:
          (c.capture.exr_layer, c.capture.frontal_camera) == ("a", "face3")),
    named("anchors that multiply", BOMB, "more than 100000 values"),
    named("an anchor within itself", "capture: &a\n  exr_layer: *a\n", "config.yaml"),
    named("an alias of no anchor", "capture: *nothing\n", "line 2"),
    named("a key twice", "chunk_frames: 5\nchunk_frames: 50\n", "line 3: the key 'chunk_frames' a second"),
    named("a key twice within a section", "capture:\n  exr_layer: a\n  exr_layer: b\n", "'exr_layer' a second"),
    named("a section twice", "capture: {exr_layer: a}\nlandmarks: {}\ncapture: {}\n", "'capture' a second"),
    named("a power as text", "landmarks:\n  training: {ridge: 1e-3}\n", right=lambda c:
          c.landmarks.training.ridge == 1e-3),
    named("a tab", "capture:\n\texr_layer: a\n", "line 3.*tab"),
    named("an unknown key", "capture:\n  frontal_cam: face2\n", "capture.frontal_cam: found an unknown key"),
    named("an unknown section", "captures: {}\n", "captures: found an unknown key"),
    named("a key that is a number", "7: seven\n", "7"),
    named("a number with its unit", "capture:\n  calibration: {square_mm: 20 mm}\n", "square_mm: found '20 mm'"),
    named("a size in metres", "capture:\n  calibration: {square_mm: 0.02, marker_mm: 0.015}\n", "square_mm"),
    named("an angle with its unit", "capture:\n  refinement: {gate_deg: 1 deg}\n", "gate_deg: found '1 deg'"),
    named("a number out of its range", "chunk_frames: -5\n", "chunk_frames: found -5"),
    named("not a number", "landmarks:\n  training: {ridge: .nan}\n", "ridge: found nan"),
    named("infinite", "capture:\n  calibration: {square_mm: .inf}\n", "square_mm: found inf"),
    named("a fraction of frames", "chunk_frames: 2.5\n", "chunk_frames: found 2.5"),
    named("a list for a section", "capture: [1, 2]\n", "capture: found \\[1, 2\\]"),
    named("text for a section", "capture: yes please\n", "capture: found 'yes please'"),
    named("nothing for a section", "capture:\n", "capture: found None"),
    named("a list of 10^4 values for a number", f"chunk_frames: [{'1, ' * 10_000}]\n", "chunk_frames: found"),
    named("text of 10^5 letters for a number", f"chunk_frames: {'x' * 10**5}\n", "chunk_frames: found"),
    named("more than 10^6 letters", "# x" * 10**6, "bytes"),
    named("a choice that is none", "landmarks: {detector: eyes}\n", "detector: found 'eyes'"),
    named("a truth value for a name", "capture: {frontal_camera: no}\n", "frontal_camera: found False"),
    Case("a sheet that is none", file(b'takes: "a\\0b"\n'), load, "takes|sheet", names="a\0b"),
    Case("a sheet that is a list", file(b"takes: [a, b]\n"), load, "takes"),
    named("a tag that runs code", "results: !!python/object/apply:os.getcwd []\n", "line 2.*python"),
    named("two documents", "results: a\n---\nresults: b\n", "document"),
    named("quotes that do not end", "results: 'a\n", "line"),
    named("brackets that do not end", "capture: {exr_layer: a\n", "line"),
    named("deeply nested", "capture: " + "[" * 600 + "\n", "nested too deeply"),
    Case("cut", cut, load, "line"),
    Case("empty", file(b""), read_keys, right=lambda keys: keys == {}),
    Case("a list", file(b"- a\n- b\n"), load, "keys and values"),
    Case("text", file(b"hello\n"), load, "keys and values"),
    Case("UTF-16", file("results: a\n".encode("utf-16")), load, "UTF-8"),
    Case("noise", lambda folder, rng: file(rng.bytes(2000))(folder, rng), load, "config.yaml"),
    Case("a folder", lambda folder, rng: _folder(folder), load, "config.yaml"),
    named("byte order mark", "results: a\n", right=lambda c: c.results == "a", encoding="utf-8-sig"),
    Case("CRLF", file(b"takes: takes.tsv\r\nresults: a\r\n"), load, right=lambda c: c.results == "a"),
]  # fmt: skip


def _folder(folder: Path) -> Path:
    (folder / "config.yaml").mkdir()
    return folder / "config.yaml"


@parametrized(CASES)
def test_configuration(case, seed, tmp_path):
    check(case, seed, tmp_path)


@pytest.mark.parametrize("path", sorted((ROOT / "config").glob("*.yaml")), ids=lambda p: p.name)
def test_the_configurations_of_the_project_are_read(path):
    assert read_keys(path)
