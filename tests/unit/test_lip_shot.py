"""`vermilion lips`: the configuration that it writes is one that the workflow takes."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from vermilion.app.face_files import ModelChoice
from vermilion.app.frame_megapixels import frame_megapixels
from vermilion.app.lip_regressor import check_regressor
from vermilion.app.lip_shot import LipShot, take_name, write_shot
from vermilion.app.lips import correct_lips, expected
from vermilion.config.load import load_configuration
from vermilion.config.regressors import generic_file
from vermilion.config.studio import StudioConfig
from vermilion.config.takes import eye_distances, read_takes
from vermilion.faces.build import TRACKER_TOPOLOGIES, face_model_of
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import write_video
from vermilion.regression.model import FORMAT, FORMAT_VERSION, model_topology
from vermilion.storage.errors import InputError, VermilionError


@pytest.fixture
def clip(tmp_path):
    """A portrait clip of 30 frames at 29.97 a second, with a space and umlauts in its path."""
    path = tmp_path / "Über uns" / "Größe 1 (final).mp4"
    path.parent.mkdir()
    grey = np.full((96, 54, 3), 90, np.uint8)
    write_video(path, [grey] * 30, 30000 / 1001)
    return path


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Größe 1 (final)", "groesse_1_final"),
        ("IMG_0001", "img_0001"),
        ("été", "ete"),
        ("映像", "clip"),
    ],
)
def test_a_take_is_named_after_its_file(text, name):
    assert take_name(text) == name


def test_the_workflow_takes_what_is_written(clip, tmp_path):
    scan, model = tmp_path / "a b.obj", tmp_path / "MS: 1.h5"
    scan.write_text("")
    results = str(tmp_path / "out put")
    shot = LipShot(clip, results, {"name": "procedural"}, model, scan)
    assert write_shot(shot, cores=2) == (30, 50)
    raw = yaml.safe_load(shot.configuration.read_text(encoding="utf-8"))
    configuration, takes = load_configuration(raw, "config.yaml")
    assert configuration.results == results and configuration.apply.model == str(model)
    assert configuration.tracking.scans["face"].path == str(scan)
    (take,) = takes
    assert take.source == str(clip) and (take.first, take.last) == (0, 29)
    assert take.fps == pytest.approx(29.97, abs=0.01)


def test_a_photograph_is_a_take_of_one_frame(tmp_path):
    photo = tmp_path / "Größe.jpg"
    write_srgb8(photo, np.full((96, 54, 3), 90, np.uint8))
    shot = LipShot(photo, str(tmp_path / "out"), {"name": "procedural"})
    assert shot.take == "groesse" and write_shot(shot)[0] == 1
    raw = yaml.safe_load(shot.configuration.read_text(encoding="utf-8"))
    _, (take,) = load_configuration(raw, "config.yaml")
    assert take.source == str(photo) and (take.first, take.last) == (0, 0)
    assert frame_megapixels(take, StudioConfig()) == [pytest.approx(96 * 54 / 1e6)]
    with pytest.raises(InputError, match="frames 0 to 0"):
        write_shot(LipShot(photo, str(tmp_path / "out"), {"name": "procedural"}, last=1))


def test_without_a_model_nothing_is_learnt(clip, tmp_path):
    shot = LipShot(clip, str(tmp_path / "out"), {"name": "procedural"}, last=9)
    assert write_shot(shot) == (10, 50)
    raw = yaml.safe_load(shot.configuration.read_text(encoding="utf-8"))
    configuration, _ = load_configuration(raw, "config.yaml")
    assert not configuration.apply.trains and configuration.apply.model is None
    assert configuration.tracking.image_fit.appearance.frames == 10


def test_a_configuration_that_somebody_changed_is_kept_beside(clip, tmp_path):
    shot = LipShot(clip, str(tmp_path / "out"), {"name": "procedural"})
    write_shot(shot)
    written = shot.configuration.stat().st_mtime_ns
    write_shot(shot)
    assert shot.configuration.stat().st_mtime_ns == written  # the same: nothing runs again
    shot.configuration.write_text("changed: 1\n")
    write_shot(shot)
    assert shot.configuration.with_name("config.yaml.before").read_text() == "changed: 1\n"


def test_frames_that_the_clip_does_not_have_are_refused(clip, tmp_path):
    with pytest.raises(InputError, match="frames 0 to 29"):
        write_shot(LipShot(clip, str(tmp_path), {"name": "procedural"}, last=30))


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("README.md", "# a text", "no video"),
        ("notes.mp4", "a text", "unreadable video"),
        ("notes.jpg", "a text", "unreadable image"),
        ("empty", None, "without numbered images"),
        ("gone.mp4", "", "no file or folder"),
        ("", None, "Name a video: make lips VIDEO=clip.mp4"),
    ],
)
def test_what_is_no_video_stops_before_anything_is_fetched(
    tmp_path, monkeypatch, name, content, said
):
    monkeypatch.setattr("vermilion.app.lips.face_model", lambda **_: pytest.fail("fetched"))
    source = tmp_path / name if name else ""
    if name and content is None:
        source.mkdir()
    elif content:
        source.write_text(content)
    with pytest.raises(VermilionError, match=said):
        correct_lips(
            str(source), model=None, scan=None, out=str(tmp_path / "out"), span=(None, None),
            options=[],
        )  # fmt: skip
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("eyes", "scan", "said"),
    [("6.3", None, "EYES: found '6.3'"), ("63", __file__, "Give SCAN or EYES, not both")],
)
def test_a_size_that_cannot_be_is_told_before_anything_is_fetched(
    clip, tmp_path, monkeypatch, eyes, scan, said
):
    monkeypatch.setattr("vermilion.app.lips.face_model", lambda **_: pytest.fail("fetched"))
    with pytest.raises(VermilionError, match=said):
        correct_lips(
            str(clip), model=None, scan=scan, eye_distance=eyes, out=str(tmp_path / "out"),
            span=(None, None), options=[],
        )  # fmt: skip
    assert not (tmp_path / "out").exists()


def test_a_measured_person_stands_in_the_sheet(clip, tmp_path):
    shot = LipShot(clip, str(tmp_path / "out"), {"name": "procedural"}, eye_distance_mm=61.5)
    write_shot(shot)
    takes, problems = read_takes(tmp_path / "out" / "takes.tsv")
    assert not problems and eye_distances(takes) == {"face": 61.5}


def test_the_generic_regressor_needs_ict_facekit(clip, tmp_path, monkeypatch):
    monkeypatch.setenv("VERMILION_ICT_FACEKIT", "procedural")
    with pytest.raises(VermilionError, match="MODEL=generic needs ICT-FaceKit") as raised:
        correct_lips(
            str(clip), model="generic", scan=None, out=str(tmp_path / "out"), span=(None, None),
            options=[],
        )  # fmt: skip
    assert "export VERMILION_ICT_FACEKIT=" in str(raised.value)
    assert not (tmp_path / "out").exists()


def regressor_of(path, topology):
    """The header of a regressor's file."""
    with h5py.File(path, "w") as file:
        file.attrs.update(
            format=FORMAT, format_version=FORMAT_VERSION, topology_sha256=topology, name="MS"
        )
    return path


@pytest.mark.parametrize(
    ("trained_for", "named", "remedy"),
    [
        (TRACKER_TOPOLOGIES["ict"], "ICT-FaceKit", "`export VERMILION_ICT_FACEKIT=/path/to"),
        ("0" * 64, "of other triangles", "Give a regressor that was trained for"),
    ],
)
def test_a_regressor_of_another_face_model_is_told_before_anything_runs(
    clip, tmp_path, monkeypatch, trained_for, named, remedy
):
    monkeypatch.setenv("VERMILION_ICT_FACEKIT", "procedural")
    model = regressor_of(tmp_path / "MS.h5", trained_for)
    with pytest.raises(VermilionError) as raised:
        correct_lips(
            str(clip), model=str(model), scan=None, out=str(tmp_path / "out"), span=(None, None),
            options=[],
        )  # fmt: skip
    (told,) = str(raised.value).splitlines()
    assert f"{model} was trained for another face model ({named}) than that of" in told
    assert "of this clip, embedded (VERMILION_ICT_FACEKIT=procedural). " in told
    assert remedy in told and told.endswith("leave MODEL out.")
    assert not (tmp_path / "out").exists()


def test_a_regressor_of_the_embedded_model_is_refused_for_ict_facekit(tmp_path):
    model = regressor_of(tmp_path / "MS.h5", TRACKER_TOPOLOGIES["procedural"])
    ict = ModelChoice({"name": "ict", "path": "x"}, "ICT-FaceKit", "")
    with pytest.raises(
        VermilionError, match=r"\(embedded\) than that of this clip, ICT-F.*=procedural`"
    ):
        check_regressor(model, ict)


def test_a_regressor_of_the_clips_own_triangles_is_taken_whatever_they_are(tmp_path, monkeypatch):
    embedded = ModelChoice({"name": "procedural"}, "embedded", "")
    model = regressor_of(tmp_path / "MS.h5", TRACKER_TOPOLOGIES["procedural"])
    check_regressor(model, embedded)
    monkeypatch.setattr("vermilion.faces.build.TRACKER_TOPOLOGIES", {})  # as of another decimation
    check_regressor(model, embedded)


def test_the_regressor_of_the_project_is_of_ict_facekit():
    path = Path(__file__).parents[2] / generic_file("ict")
    assert face_model_of(model_topology(path)) == "ict"


def test_a_file_that_is_no_regressor_is_told_before_anything_runs(clip, tmp_path, monkeypatch):
    monkeypatch.setenv("VERMILION_ICT_FACEKIT", "procedural")
    (tmp_path / "MS.h5").write_text("a text")
    with pytest.raises(VermilionError, match="damaged model file"):
        correct_lips(
            str(clip), model=str(tmp_path / "MS.h5"), scan=None, out=str(tmp_path / "out"),
            span=(None, None), options=[],
        )  # fmt: skip
    assert not (tmp_path / "out").exists()


def test_why_nothing_was_made_is_not_said_twice(clip, tmp_path, monkeypatch, capsys):
    why = "found no usable face"  # `run_workflow` says it, with the log
    monkeypatch.setenv("VERMILION_ICT_FACEKIT", "procedural")
    monkeypatch.setenv("VERMILION_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("SNAKEMAKE_OUTPUT_CACHE", str(tmp_path / "cache" / "built"))
    monkeypatch.setattr("vermilion.app.lips.run_all", lambda *_, **__: (1, {"face/x": why}))
    code = correct_lips(
        str(clip), model=None, scan=None, out=str(tmp_path / "out"), span=(None, None), options=[]
    )
    said = capsys.readouterr()
    assert code == 1 and why not in said.err + said.out
    assert f"Nothing was made of {clip.name}." in said.err and "Look at" not in said.out


def test_a_longer_clip_is_expected_to_take_longer():
    assert expected(300, 300)("apply") > 2 * expected(50, 300)("apply")
    assert expected(3000, 300)("apply") == expected(300, 300)("apply")  # of one job
