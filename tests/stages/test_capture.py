"""The capture stage on tiny captures: its scripts from files to files."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.small_videos import HEIGHT, scene, write_clip
from tests.unit.test_calibrate import BOARD, SIZE, board_poses, make_rig, render
from vermilion.geometry.camera import read_cameras
from vermilion.imaging.images import write_srgb8
from vermilion.storage.tables import read_table

FRAMES = [0, 1, 2]


def write_capture(folder) -> dict:
    """Two cameras with three frames each, and nine views of a ChArUco board."""
    rig = {name: camera for name, camera in make_rig().items() if name != "right"}
    rng = np.random.default_rng(0)
    for name, camera in rig.items():
        for frame in FRAMES:
            pixels = rng.integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
            write_srgb8(folder / f"frames/{name}/{frame:06d}.png", pixels)
        for i, pose in enumerate(board_poses(9)):
            write_srgb8(folder / f"calibration/{name}/{i:03d}.png", render(BOARD, camera, pose, 2))
    return rig


def check(source, out, frames=FRAMES):
    chunk = f"{frames[0]:06d}-{frames[-1]:06d}"
    run_script(
        "capture/capture",
        wildcards={"subject": "s1", "take": "t1", "chunk": chunk},
        params={
            "cfg": {"capture.manifest": {"hash_decoded": False}},
            "source": str(source),
            "camera": "mid",
            "multiview": True,
            "frames": frames,
            "fps": None,
        },
        output={
            "manifest": out / f"capture/{chunk}.json",
            "quality": out / f"capture/quality/{chunk}.tsv",
            "overlay": out / f"capture/overlay/{chunk}.png",
        },
        log=out / "log",
    )
    return out / f"capture/{chunk}.json"


@pytest.mark.slow
def test_a_capture_is_checked_and_calibrated_from_its_board(tmp_path):
    source, out = tmp_path / "capture", tmp_path / "out"
    truth = write_capture(source)
    (source / "frames/mid/000001.png").write_bytes(b"not an image")
    manifests = [check(source, out, [0, 1]), check(source, out, [2])]
    rows = read_table(out / "capture/quality/000000-000001.tsv")
    assert list(rows["valid"]) == [1, 0] and "mid: an unreadable image" in rows["reason"][1]
    assert json.loads(manifests[1].read_text())["bad"] == {}
    run_script(
        "capture/cameras",
        wildcards={"subject": "s1", "take": "t1"},
        params={
            "cfg": {
                "capture.calibration": {"camera_model": "PINHOLE"},
                "capture.refinement": {},
            },
            "camera": "mid",
            "frames": [0, 2],
            "focal": None,
        },
        input={"manifests": manifests},
        output={
            "cameras": out / "cameras",
            "summary": out / "capture/cameras.json",
            "overlay": out / "capture/overlay/cameras.png",
        },
        log=out / "log",
    )
    summary = json.loads((out / "capture/cameras.json").read_text())
    assert summary["calibrated"] and summary["method"] == "charuco"
    assert summary["reprojection_px"] < 0.25
    cameras = read_cameras(out / "cameras")
    baseline_mm = np.linalg.norm(cameras["left"].centre_mm - cameras["mid"].centre_mm)
    expected_mm = np.linalg.norm(truth["left"].centre_mm - truth["mid"].centre_mm)
    assert abs(baseline_mm - expected_mm) < 1.0
    assert (out / "capture/overlay/cameras.png").is_file()


def test_a_video_is_hashed_once_and_its_rate_held_against_the_sheet(tmp_path):
    frames = [scene(moment) for moment in range(8)]
    turned = write_clip(
        tmp_path / "clip.mp4", frames, prepare=lambda stream: stream.set_display_rotation(-90)
    )
    facts = tmp_path / "video.json"
    run_script("capture/video_facts", input={0: turned}, output={0: facts}, log=tmp_path / "log")
    for first, last, fps in ((0, 3, 30.0), (4, 7, None)):
        chunk = f"{first:06d}-{last:06d}"
        run_script(
            "capture/capture",
            wildcards={"subject": "s1", "take": "t1", "chunk": chunk},
            params={
                "cfg": {"capture.manifest": {"hash_decoded": False}},
                "source": str(turned),
                "camera": "cam",
                "multiview": False,
                "frames": list(range(first, last + 1)),
                "fps": fps,
            },
            input={"video": facts},
            output={
                "manifest": tmp_path / f"{chunk}.json",
                "quality": tmp_path / f"{chunk}.tsv",
                "overlay": tmp_path / f"{chunk}.png",
            },
            log=tmp_path / "log",
        )
    manifests = [
        json.loads((tmp_path / f"{chunk}.json").read_text())
        for chunk in ("000000-000003", "000004-000007")
    ]
    sha256 = json.loads(facts.read_text())["sha256"]
    assert [manifest["video"]["sha256"] for manifest in manifests] == [sha256, sha256]
    assert manifests[0]["cameras"]["cam"]["width_px"] == HEIGHT  # upright
    rows = read_table(tmp_path / "000000-000003.tsv")
    assert "25 frames a second, the take sheet says 30" in rows["reason"][0]
    assert read_table(tmp_path / "000004-000007.tsv")["reason"].isna().all()
