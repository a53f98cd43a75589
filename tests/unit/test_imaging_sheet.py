"""The take sheet's ranges and rates against the files', and what lies beside a video file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.unit.small_videos import scene, write_clip
from vermilion.capture.board import Board
from vermilion.capture.manifest import capture_manifest, quality_rows
from vermilion.capture.rig import rig_cameras
from vermilion.capture.video_facts import load_video_facts, rate_warning, video_facts
from vermilion.config.load import check_source
from vermilion.config.takes import Take, read_takes
from vermilion.contours.labels import label_paths
from vermilion.geometry.camera import pinhole, write_cameras
from vermilion.imaging.images import ImageReading, write_channels, write_srgb8
from vermilion.imaging.source import folder_of
from vermilion.landmarks.labels import label_files
from vermilion.storage.errors import InputError

SCENES = [scene(moment) for moment in range(8)]
HEADER = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"


def read_rows(tmp_path, *rows):
    path = tmp_path / "takes.tsv"
    path.write_text(HEADER + "".join("\t".join(map(str, row)) + "\n" for row in rows))
    return read_takes(path)


def test_ranges_that_are_left_empty_are_those_of_the_source(tmp_path):
    clip = write_clip(tmp_path / "clip.mp4", SCENES)
    rig, meshes = tmp_path / "rig", tmp_path / "meshes"
    for camera, frames in {"a": range(3, 9), "b": range(4, 11)}.items():
        for frame in frames:
            (rig / "frames" / camera).mkdir(parents=True, exist_ok=True)
            (rig / "frames" / camera / f"shot.{frame:04d}.exr").touch()
    meshes.mkdir()
    for frame in (7, 8):
        (meshes / f"tst{frame:03d}.ply").touch()
    np.savez(tmp_path / "t.npz", vertices_mm=np.zeros((5, 3, 3)), triangles=np.zeros((1, 3)))
    takes, problems = read_rows(
        tmp_path,
        ("s", "clip", "video", clip, "", "", 25, "test:6-7"),
        ("s", "end", "video", clip, 2, "", 25, "none"),
        ("s", "rig", "tattoo", rig, "", "", 25, "train"),
        ("s", "plain", "plain", rig, "", "", 25, "none"),
        ("s", "other", "tracked", meshes, "", "", 25, "none"),
        ("s", "more", "tracked", tmp_path / "t.npz", "", 3, 25, "none"),
    )
    assert problems == []
    ranges = [(take.first, take.last) for take in takes]
    assert ranges == [(0, 7), (2, 7), (4, 8), (4, 4), (7, 8), (0, 3)]


def test_a_source_that_does_not_tell_its_range_is_named(tmp_path):
    (tmp_path / "empty").mkdir()
    _, problems = read_rows(
        tmp_path,
        ("s", "a", "video", "studio", "", 9, 25, "none"),
        ("s", "b", "video", tmp_path / "gone.mp4", 0, "", 25, "none"),
        ("s", "c", "video", tmp_path / "empty", "", "", 25, "none"),
    )
    assert "row 1 (s/a): first: found nothing; expected frame numbers" in problems[0]
    assert "row 2 (s/b): last" in problems[1] and "gone.mp4" in problems[1]
    assert "row 3 (s/c): first and last" in problems[2] and "does not tell" in problems[2]


def test_a_rate_that_differs_is_a_warning_on_the_first_frame(tmp_path):
    even = video_facts(write_clip(tmp_path / "even.mp4", SCENES))
    stamps = [i + i // 2 for i in range(8)]
    uneven = video_facts(write_clip(tmp_path / "uneven.mp4", SCENES, stamps=stamps))
    assert rate_warning(even, 25.0) == rate_warning(even, 24.97) == ""
    assert "the file has 25 frames a second, the take sheet says 30" in rate_warning(even, 30)
    assert "0.040 to 0.080 s apart" in rate_warning(uneven, 25)
    assert "ffmpeg -i uneven.mp4 -vf fps=25" in rate_warning(uneven, 25)
    manifest = capture_manifest(tmp_path / "uneven.mp4", "s", "t", [0, 1, 2], ["cam"], fps=25.0)
    rows = quality_rows(manifest, [0, 1, 2], ["cam"])
    assert [row.valid for row in rows] == [True, True, True]
    assert "0.040 to 0.080 s apart" in rows[0].reason and rows[1].reason == ""
    assert manifest.video["even"] is False and manifest.video["frames"] == 8


def test_facts_of_a_video_are_found_once_and_kept(tmp_path, monkeypatch):
    path = write_clip(tmp_path / "clip.mp4", SCENES)
    facts = video_facts(path)
    facts.save(tmp_path / "video.json")
    again = load_video_facts(tmp_path / "video.json")
    assert again == facts and len(facts.sha256) == 64
    assert np.allclose(again.times_s, np.arange(8) / 25)
    whole = capture_manifest(path, "s", "t", [3, 4], ["cam"])
    # With them, the file is neither hashed nor listed again.
    for name in ("capture.video_facts.sha256_of", "imaging.video._list_packets"):
        monkeypatch.setattr(f"vermilion.{name}", lambda *_: pytest.fail("read again"))
    assert capture_manifest(path, "s", "t", [3, 4], ["cam"], video=again) == whole
    content = json.loads((tmp_path / "video.json").read_text())
    (tmp_path / "video.json").write_text(json.dumps({**content, "format_version": 9}))
    with pytest.raises(InputError, match=r"video\.json.*format 9"):
        load_video_facts(tmp_path / "video.json")


def test_cameras_and_labels_beside_a_video_are_its_own(tmp_path):
    clip = write_clip(tmp_path / "clip.mp4", SCENES)
    for kind in ("landmarks", "contours"):
        folder = tmp_path / "clip.mp4.labels" / kind / "cam"
        folder.mkdir(parents=True)
        (folder / "000003.json").write_text("{}")
    write_cameras(tmp_path / "clip.mp4.cameras", {"phone": pinhole("phone", 120.0, 96, 64)})
    assert [path.name for path in label_files(clip)] == ["000003.json"]
    assert list(label_paths(clip, "cam")) == [3]
    board = Board("charuco", (9, 7), 20.0, 15.0)
    rig = rig_cameras(clip, {"cam": (96, 64)}, "cam", board)
    assert rig.method == "given" and rig.cameras["cam"].params[0] == 120.0
    assert rig.cameras["cam"].name == "cam"
    with pytest.raises(InputError, match=r"clip\.mp4\.cameras.*calibrated at 96x64.*are 64x96"):
        rig_cameras(clip, {"cam": (64, 96)}, "cam", board)
    assert folder_of({"path": "captures/p1"}, "labels").as_posix() == "captures/p1/labels"


def test_what_is_not_read_stops_before_any_job(tmp_path):
    def row(source):
        return Take("s", "t", "video", str(source), 0, 1, 25.0, "none")

    log = write_clip(tmp_path / "log.mp4", SCENES, tags={"color_trc": 9})
    assert "ffmpeg -i log.mp4" in check_source(row(log))[0]
    layers = {f"{layer}.{c}": np.zeros((4, 4)) for layer in "ab" for c in "RGB"}
    for frame in (0, 1):
        write_channels(tmp_path / f"exr/f{frame}.exr", layers)
    assert "'a', 'b'" in check_source(row(tmp_path / "exr"))[0]
    assert check_source(row(tmp_path / "exr"), ImageReading("b")) == []
    for name in ("a0", "a1", "b0"):
        write_srgb8(tmp_path / f"two/{name}.png", np.zeros((4, 4, 3), np.uint8))
    assert "2 sequences" in check_source(row(tmp_path / "two"))[0]
    (tmp_path / "phone").mkdir()
    (tmp_path / "phone/IMG_0001.HEIC").touch()
    assert (
        "found frames none (files of .heic; read are .png"
        in check_source(row(tmp_path / "phone"))[0]
    )
    (tmp_path / "clip.mts").touch()
    assert "ffmpeg -i clip.mts" in check_source(row(tmp_path / "clip.mts"))[0]
