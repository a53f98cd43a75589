"""The contours and features stages on a tiny capture: their scripts from files to files."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.mouths import draw_mouth, facing_camera, mouth_model
from vermilion.contours.maps import read_maps
from vermilion.features.vector import FeatureTable
from vermilion.imaging.images import write_image
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.sequences import write_sequence
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow

SHAPES = [(2.0, 20.0), (12.0, 28.0), (7.0, 24.0), (9.0, 26.0), (5.0, 22.0)]  # opening, height
LABELLED = (0, 1, 2)
UNREADABLE = 4
FRAMES = list(range(len(SHAPES)))
CFG = {
    "contours.detector": {
        "features": 300,
        "variants": 1,
        "max_samples": 5000,
        "boosting": {"trees": 40, "features_per_tree": 64},
    },
    "contours.maps": {},
    "features.shape": {},
    "features.contours": {},
}
NAME = {"subject": "s1", "take": "phone"}


def of_take(root) -> dict:
    """What the detector of the take reads."""
    return {
        "landmarks": [root / "landmarks.npz"],
        "tracker": root / "tracker.npz",
        "fit": root / "fit.npz",
        "coarse": [root / "000000-000004.npy"],
        "around": [],
    }


def to(folder) -> dict:
    """What it writes."""
    return {"detector": folder / "detector.npz", "quality": folder / "labels.tsv"}


def train(root, params, folder, **changed) -> None:
    """The detector of the take into a folder; `changed` inputs in place of the take's."""
    run_script(
        "contours/contour_detector",
        wildcards=NAME,
        params=params,
        input={**of_take(root), **changed},
        output=to(folder),
    )


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """Five frames of a drawn mouth, three of them labelled, one damaged, and its coarse track."""
    root = tmp_path_factory.mktemp("contours")
    capture = root / "capture"
    points = []
    for frame, (opening, height) in enumerate(SHAPES):
        image, landmarks, label = draw_mouth(opening, height, seed=frame)
        points.append(landmarks)
        path = capture / f"frames/cam/{frame:06d}.png"
        write_image(path, image)
        if frame == UNREADABLE:
            path.write_bytes(path.read_bytes()[:500])
        if frame in LABELLED:
            lines = {
                name: {"closed": True, "points": getattr(label, name).points_px.tolist()}
                for name in ("inner", "outer")
            }
            path = capture / f"labels/contours/cam/{frame:06d}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps({"unit": "px", **lines}))
    n = len(FRAMES)
    LandmarkTrack(np.arange(n), np.stack(points), np.ones((n, 66)), np.ones(n, dtype=bool)).save(
        root / "landmarks.npz"
    )
    _write_track(root, n)
    coarse = np.tile(mouth_model(8.0, 24.0).neutral_mm, (n, 1, 1))
    write_sequence(root / "000000-000004.npy", coarse)
    params = {
        "cfg": CFG,
        "source": str(capture),
        "capture": str(capture),
        "camera": "cam",
        "frames": FRAMES,
    }
    train(root, params, root)
    run_stages(root, params, "000000-000004", FRAMES)
    return root, params


def _write_track(root, n) -> None:
    from vermilion.tracking.landmark_fit.expression import HeadMotion
    from vermilion.tracking.result import Identity, TrackedTake

    model, camera = mouth_model(8.0, 24.0), facing_camera()
    model.save(root / "tracker.npz")
    motion = HeadMotion(
        rotation=np.tile(np.diag([1.0, -1.0, -1.0]), (n, 1, 1)),
        translation_mm=np.tile([0.0, 0.0, 1000.0], (n, 1)),
        weights=np.zeros((n, 3)),
        reprojection_px=np.zeros(n),
    )
    fit = TrackedTake.of(np.arange(n), motion, np.ones(n, dtype=bool), camera, model)
    fit.save(root / "fit.npz")
    identity = Identity(
        identity=np.zeros(0),
        neutral_mm=model.neutral_mm,
        landmark_offset_mm=np.zeros((66, 3)),
        takes=np.array(["phone"]),
        focal_px=np.array([1000.0]),
        calibrated=np.array([True]),
    )
    identity.save(root / "identity.npz")


def run_stages(root, params, chunk, frames) -> None:
    """Maps and features of one chunk of the take."""
    track = LandmarkTrack.load(root / "landmarks.npz")
    rows = np.isin(track.frames, frames)
    LandmarkTrack(
        track.frames[rows], track.points_px[rows], track.confidence[rows], track.valid[rows]
    ).save(root / chunk / "landmarks.npz")
    coarse = np.tile(mouth_model(8.0, 24.0).neutral_mm, (len(frames), 1, 1))
    write_sequence(root / chunk / "C.npy", coarse)
    run_script(
        "contours/contours",
        wildcards=NAME,
        params=params,
        input={
            "landmarks": root / chunk / "landmarks.npz",
            "detector": root / "detector.npz",
        },
        output={
            "maps": root / chunk / "maps",
            "quality": root / chunk / "contours.tsv",
            "overlay": root / chunk / "contours.png",
        },
    )
    run_script(
        "features/features",
        wildcards=NAME,
        params={**params, "frames": frames},
        input={
            "model": root / "tracker.npz",
            "identity": root / "identity.npz",
            "fit": root / "fit.npz",
            "coarse": root / chunk / "C.npy",
            "maps": root / chunk / "maps",
            "landmarks": root / "landmarks.npz",
        },
        output={
            "features": root / chunk / "features.npz",
            "quality": root / chunk / "features.tsv",
            "overlay": root / chunk / "features.png",
        },
    )


def test_the_unlabelled_frame_has_its_true_distances(take):
    root, _ = take
    table = FeatureTable.load(root / "000000-000004/features.npz")
    value = dict(zip(table.names, table.features[3], strict=True))
    tolerance = 2.0 / 200  # 2 px
    assert value["head_outer_width"] == pytest.approx(104 / 200, abs=2 * tolerance)
    assert value["head_outer_height_5"] == pytest.approx(52 / 200, abs=tolerance)
    assert value["head_upper_lip_5"] == pytest.approx(17 / 200, abs=tolerance)
    assert value["head_lower_lip_5"] == pytest.approx(17 / 200, abs=tolerance)


def test_a_frame_that_cannot_be_read_is_flagged_and_the_others_go_on(take):
    root, _ = take
    for name in ("contours", "features"):
        table = read_table(root / f"000000-000004/{name}.tsv")
        assert table["valid"].tolist() == [1, 1, 1, 1, 0]
    assert "unreadable" in read_table(root / "000000-000004/contours.tsv")["reason"][4]
    assert not (root / "000000-000004/maps" / f"{UNREADABLE:06d}.exr").exists()
    features = FeatureTable.load(root / "000000-000004/features.npz")
    assert features.valid.tolist() == [True] * 4 + [False]
    assert np.isfinite(features.features).all()


def test_maps_have_the_images_size_and_lie_in_range(take):
    root, _ = take
    inner, outer = read_maps(root / "000000-000004/maps/000003.exr")
    assert inner.shape == outer.shape == (240, 240)
    for plane in (inner, outer):
        assert plane.min() >= 0
        assert 0.4 < plane.max() <= 1


def test_chunks_change_nothing(take):
    root, params = take
    run_stages(root, params, "000002-000003", [2, 3])
    whole = FeatureTable.load(root / "000000-000004/features.npz")
    part = FeatureTable.load(root / "000002-000003/features.npz")
    np.testing.assert_array_equal(part.features, whole.features[2:4])
    np.testing.assert_array_equal(part.inner_px, whole.inner_px[2:4])


def test_without_labels_auto_follows_the_track_and_boosted_says_what_is_missing(take, tmp_path):
    from vermilion.contours.detector_file import load_detector
    from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
    from vermilion.contours.track_ridge import TrackRidgeDetector
    from vermilion.storage.errors import InputError

    root, params = take
    track = of_take(root)
    bare = {**params, "capture": str(tmp_path)}
    train(root, bare, tmp_path)
    assert isinstance(load_detector(tmp_path / "detector.npz"), TrackRidgeDetector)
    run_script(
        "contours/contours",
        wildcards=NAME,
        params=bare,
        input={**track, "landmarks": track["landmarks"][0], "detector": tmp_path / "detector.npz"},
        output={
            "maps": tmp_path / "maps",
            "quality": tmp_path / "quality.tsv",
            "overlay": tmp_path / "overlay.png",
        },
    )
    _, outer = read_maps(tmp_path / "maps/000003.exr")
    line = draw_mouth(*SHAPES[3])[2].outer.points_px
    on_line = outer[tuple(np.floor(line[5:55, ::-1]).astype(int).T)]
    assert on_line.mean() > 0.5 * outer.max()
    plain = {"cfg": {"contours.detector": {"kind": "landmarks"}}}
    train(root, {**bare, **plain}, tmp_path)
    assert isinstance(load_detector(tmp_path / "detector.npz"), LandmarkRidgeDetector)
    demanding = {**bare, "cfg": {"contours.detector": {"kind": "boosted"}}}
    with pytest.raises(InputError, match="no usable contour labels"):
        train(root, demanding, tmp_path)


def test_labels_of_which_none_serves_leave_the_track(take, tmp_path):
    from vermilion.contours.detector_file import load_detector
    from vermilion.contours.track_ridge import TrackRidgeDetector

    root, params = take
    lost = LandmarkTrack.load(root / "landmarks.npz")
    valid = ~np.isin(lost.frames, LABELLED)
    LandmarkTrack(lost.frames, lost.points_px, lost.confidence, valid).save(tmp_path / "lost.npz")
    train(root, params, tmp_path, landmarks=[tmp_path / "lost.npz"])
    assert isinstance(load_detector(tmp_path / "detector.npz"), TrackRidgeDetector)
    said = read_table(tmp_path / "labels.tsv")
    assert said["frame"].tolist() == list(LABELLED)
    assert said["reason"].str.contains("left out").all()


def test_labels_beside_the_border_are_warned_of_and_a_damaged_frame_left_out(take, tmp_path):
    root, params = take
    capture = tmp_path / "capture"
    shutil.copytree(root / "capture", capture)
    labels = capture / "labels/contours/cam"
    for path in labels.iterdir():
        drawn = json.loads(path.read_text())
        points = np.array(drawn["outer"]["points"])
        middle = points.mean(axis=0)
        drawn["outer"]["points"] = (middle + 0.9 * (points - middle)).tolist()
        path.write_text(json.dumps(drawn))
    (labels / "000900.json").write_text("of another take, and no label at all")
    image = capture / "frames/cam/000002.png"
    image.write_bytes(image.read_bytes()[:500])
    train(root, {**params, "capture": str(capture), "source": str(capture)}, tmp_path)
    said = read_table(tmp_path / "labels.tsv")
    assert said["frame"].tolist() == [0, 1, 2]
    assert said["reason"][:2].str.contains("inside the border of the lips' colour: check").all()
    assert "unreadable" in said["reason"][2]
    assert (said["outer_offset"][:2] * 200).between(-5.0, -1.5).all()  # 2 to 5 px


def test_a_take_whose_frames_are_all_damaged_falls_back_on_landmarks(take, tmp_path):
    from vermilion.contours.detector_file import load_detector
    from vermilion.contours.landmark_ridge import LandmarkRidgeDetector

    root, params = take
    for frame in FRAMES:
        path = tmp_path / f"frames/cam/{frame:06d}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"no image")
    train(root, {**params, "capture": str(tmp_path), "source": str(tmp_path)}, tmp_path)
    assert isinstance(load_detector(tmp_path / "detector.npz"), LandmarkRidgeDetector)
