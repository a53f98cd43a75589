"""The landmarks stage on a tiny capture of drawn faces."""

import json

import cv2
import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.test_landmark_descent import drawn_face
from vermilion.config.landmarks import LandmarksConfig
from vermilion.geometry.camera import pinhole, write_cameras
from vermilion.imaging.images import read_image, write_image
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.scheme import face_size_px
from vermilion.landmarks.views import LandmarkViews
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow
N_LABELLED, N_FRAMES = 20, 4


def section(**changes):
    return LandmarksConfig(training_takes=["a/b"], **changes).model_dump(mode="json")


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """A trained model, a capture with frame 2 damaged, and its true landmarks."""
    root = tmp_path_factory.mktemp("landmarks")
    rng = np.random.default_rng(4)
    labels = root / "people" / "labels" / "landmarks" / "cam"
    labels.mkdir(parents=True)
    for frame in range(N_LABELLED):
        image, points = drawn_face(rng)
        write_image(root / "people" / "frames" / "cam" / f"{frame:06d}.png", image)
        text = json.dumps({"unit": "px", "points": points.tolist()})
        (labels / f"{frame:06d}.json").write_text(text)
    truth = []
    for frame in range(N_FRAMES):
        image, points = drawn_face(rng)
        write_image(root / "take" / "frames" / "cam" / f"{frame:06d}.png", image)
        truth.append(points)
    write_image(root / "take" / "frames" / "empty" / "000000.png", np.full((60, 80, 3), 0.3))
    damaged = root / "take" / "frames" / "cam" / "000002.png"
    damaged.write_bytes(damaged.read_bytes()[:400])
    training = section()["training"] | {"stages": 3, "perturbations": 3}
    run_script(
        "landmarks/landmark_model",
        params={
            "cfg": {"landmarks.training": training},
            "takes": [{"subject": "a", "take": "b", "source": str(root / "people")}],
        },
        output={"model": root / "model.npz", "overlay": root / "model.png"},
    )
    return root, np.array(truth)


def parameters(root, detector="trained", **files):
    values = section(detector=detector, files=files)
    return {
        "cfg": {f"landmarks.{key}": values[key] for key in ("detector", "networks", "files")},
        "source": str(root / "take"),
        "model": str(root / "model.npz"),
    }


def find(root, frames, params, face=(), **inputs):
    wildcards, camera = {"subject": "a", "take": "t"}, params | {"camera": "cam"}
    faces, followed = root / "faces.npz", root / "followed.npz"
    following = section()["following"] | {"least_eyes_px": 0.0}
    run_script(
        "landmarks/landmarks_faces",
        wildcards=wildcards,
        params=camera | {"frames": frames},
        input={"files": [], **inputs},
        output={"faces": faces},
    )
    run_script(
        "landmarks/landmarks_followed",
        wildcards=wildcards,
        params={"cfg": {"landmarks.following": following}, "face": face, "one_shot": False},
        input={"faces": [faces]},
        output={"followed": followed, "table": root / "followed.tsv"},
    )
    run_script(
        "landmarks/landmarks",
        wildcards=wildcards,
        params=camera,
        input={"faces": faces, "followed": followed},
        output={
            "landmarks": root / "out.npz",
            "quality": root / "out.tsv",
            "overlay": root / "out.png",
        },
    )
    return LandmarkTrack.load(root / "out.npz"), read_table(root / "out.tsv")


def test_landmarks_around_a_short_take_are_those_of_its_face(stage):
    """Frames 0 and 1 are the take; of the source's others the damaged one has no face."""
    root, truth = stage
    params = parameters(root)
    find(root, [0, 1], params)
    more = {"landmarks.following": section()["following"] | {"least_eyes_px": 0.0}}
    more |= {f"contours.detector.track.{key}": 100 for key in ("span", "frames")}
    own = {"cfg": params["cfg"] | more, "camera": "cam", "frames": [0, 1], "face": ()}
    run_script(
        "landmarks/landmarks_around",
        wildcards={"subject": "a", "take": "t"},
        params=params | own | {"source_frames": [0, N_FRAMES - 1]},
        input={"files": [], "faces": [root / "faces.npz"], "followed": root / "followed.npz"},
        output={"landmarks": root / "around.npz"},
    )
    around = LandmarkTrack.load(root / "around.npz")
    others = [frame for frame in range(N_FRAMES) if frame not in (0, 1)]
    assert around.frames.tolist() == others
    assert around.frames[~around.valid].tolist() == [2]
    seen = np.array(others)[around.valid]
    assert np.abs(around.points_px[around.valid] - truth[seen]).mean() < 4.0  # px


def test_landmarks_are_found_and_a_damaged_image_is_flagged(stage):
    root, truth = stage
    track, quality = find(root, list(range(N_FRAMES)), parameters(root))
    good = [0, 1, 3]
    assert list(track.frames[track.valid]) == good
    error = np.linalg.norm(track.points_px[good] - truth[good], axis=-1).mean(axis=1)
    assert (error < 0.05 * face_size_px(truth[good])).all()
    assert list(quality["valid"]) == [1, 1, 0, 1]
    assert "000002.png" in quality["reason"][2]
    assert read_image(root / "out.png").shape[0] > 100


def test_landmarks_do_not_depend_on_chunks(stage):
    root, _ = stage
    whole, _ = find(root, [0, 1, 3], parameters(root))
    parts = [find(root, [frame], parameters(root))[0] for frame in (0, 1, 3)]
    assert np.array_equal(whole.points_px, np.concatenate([part.points_px for part in parts]))


def two_people(root, rng, cut=None):
    """A take of two drawn people side by side; from frame `cut` on, the same before another wall, moved."""
    (mine, points), (other, _) = drawn_face(rng), drawn_face(rng)
    smaller = cv2.resize(other, None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA)
    truth = []
    for frame in range(8):
        image = np.full((190, 400, 3), 0.35, dtype=np.float32)
        left, top = 10 + frame, 20
        if cut is not None and frame >= cut:
            image[:] = [0.1, 0.25, 0.6]
            image[:, ::37] = 0.9
            left, top = 100, 35
        image[60 : 60 + len(smaller), 255 : 255 + smaller.shape[1]] = smaller
        if cut is not None or frame != 5:  # there only the other one is seen
            image[top : top + len(mine), left : left + mine.shape[1]] = mine
        write_image(root / "frames" / "cam" / f"{frame:06d}.png", image)
        truth.append(points + np.array([left, top]))
    return np.array(truth)


def test_of_two_people_one_is_followed(stage, tmp_path):
    root, _ = stage
    truth = two_people(tmp_path / "two", np.random.default_rng(5))
    params = parameters(root) | {"source": str(tmp_path / "two")}
    track, quality = find(root, list(range(8)), params)
    assert list(np.flatnonzero(~track.valid)) == [5]
    good = track.valid
    error = np.linalg.norm(track.points_px[good] - truth[good], axis=-1).mean(axis=1)
    assert (error < 0.08 * face_size_px(truth[good])).all()
    assert "1 other face(s) are not taken for it" in quality["reason"][5]
    assert quality["reason"][0] == "2 faces: the largest is followed"
    other, _ = find(root, list(range(8)), params, face=[320.0, 120.0])
    assert (other.points_px[other.valid][..., 0].mean(axis=1) > 250).all() and other.valid.sum() > 6


def test_a_cut_divides_the_landmarks(stage, tmp_path):
    root, _ = stage
    two_people(tmp_path / "cut", np.random.default_rng(5), cut=3)
    params = parameters(root) | {"source": str(tmp_path / "cut")}
    track, quality = find(root, list(range(8)), params)
    assert list(track.pieces) == [0, 0, 0, 1, 1, 1, 1, 1]
    assert "a cut: piece 2 begins" in quality["reason"][3]
    assert LandmarkTrack.load([root / "out.npz"]).pieces[-1] == 1


def test_landmarks_of_another_tracker_are_taken_from_its_file(stage):
    root, truth = stage
    header = ["frame", *(f"x_{k}" for k in range(66)), *(f"y_{k}" for k in range(66))]
    rows = [[f + 1, *(truth[f].T.reshape(-1) - 0.5)] for f in (0, 1)]
    path = root / "t.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in [header, *rows]))
    params = parameters(root, "files", path=str(path))
    track, quality = find(root, [0, 1, 3], params, files=path)
    assert np.allclose(track.points_px[:2], truth[:2])
    assert list(track.valid) == [True, True, False]
    assert quality["reason"][2] == "no face found"


def test_views_hold_the_cameras_that_see_a_face(stage):
    root, truth = stage
    cameras = {name: pinhole(name, 400.0, 180, 150) for name in ("cam", "empty")}
    write_cameras(root / "cameras", cameras)
    run_script(
        "landmarks/landmarks_views",
        wildcards={"subject": "a", "take": "t"},
        params=parameters(root) | {"frame": 0, "files": ""},
        input={"cameras": root / "cameras"},
        output={"views": root / "views.npz", "overlay": root / "views.png"},
    )
    views = LandmarkViews.load(root / "views.npz")
    assert list(views.cameras) == ["cam"]
    error = np.linalg.norm(views.points_px[0] - truth[0], axis=-1).mean()
    assert error < 0.05 * face_size_px(truth[0])


@pytest.fixture(scope="module")
def moving(stage, tmp_path_factory):
    """A take whose face moves by two pixels a frame, frame 2 damaged, detected landmarks noisy."""
    root = tmp_path_factory.mktemp("moving")
    rng = np.random.default_rng(9)
    image, points = drawn_face(rng)
    for frame in range(N_FRAMES):
        path = root / "take" / "frames" / "cam" / f"{frame:06d}.png"
        write_image(path, np.roll(image, 2 * frame, axis=1))
    damaged = root / "take" / "frames" / "cam" / "000002.png"
    damaged.write_bytes(damaged.read_bytes()[:400])
    truth = points + 2.0 * np.arange(N_FRAMES)[:, None, None] * [1, 0]
    valid = np.arange(N_FRAMES) != 2
    noisy = np.where(valid[:, None, None], truth + rng.normal(size=truth.shape), np.nan)
    confidence = np.full(truth.shape[:2], 0.9) * valid[:, None]
    LandmarkTrack(np.arange(N_FRAMES), noisy, confidence, valid).save(root / "raw.npz")
    label = root / "labels" / "cam" / "000000.json"
    label.parent.mkdir(parents=True)
    label.write_text(json.dumps({"unit": "px", "points": truth[0].tolist()}))
    return root, truth, label


def correction_settings():
    """What the default says of correction, for small images."""
    return {"landmarks.correction": section()["correction"] | {"face_px": 100.0}}


def key_frames_of(root, **inputs):
    """Run the stage; the table of key frames."""
    run_script(
        "landmarks/landmarks_key_frames",
        wildcards={"subject": "a", "take": "t"},
        params={
            "cfg": {"landmarks.key_frames": section()["key_frames"]} | correction_settings(),
            "source": str(root / "take"),
            "camera": "cam",
        },
        input={"landmarks": [root / "raw.npz"], "labels": [], "files": []} | inputs,
        output={"key_frames": root / "keys.npz", "table": root / "keys.tsv"},
    )
    return read_table(root / "keys.tsv", ["frame", "key_frame", "region_distance"])


def corrected_of(root, frames):
    run_script(
        "landmarks/landmarks_corrected",
        wildcards={"subject": "a", "take": "t"},
        params={
            "cfg": correction_settings(),
            "source": str(root / "take"),
            "camera": "cam",
            "frames": frames,
        },
        input={"landmarks": [root / "raw.npz"], "key_frames": root / "keys.npz"},
        output={
            "landmarks": root / "out.npz",
            "quality": root / "out.tsv",
            "overlay": root / "out.png",
        },
    )
    return LandmarkTrack.load(root / "out.npz"), read_table(root / "out.tsv")


def test_a_frame_marked_by_hand_is_the_key_frame_and_flow_carries_it_on(moving):
    root, truth, label = moving
    table = key_frames_of(root, labels=[label])
    assert table["key_frame"].tolist()[0] == "given"
    assert np.isnan(table["region_distance"][2])  # the damaged frame
    whole, quality = corrected_of(root, list(range(N_FRAMES)))
    assert np.array_equal(whole.points_px[0], truth[0])
    raw = LandmarkTrack.load(root / "raw.npz")
    before = np.linalg.norm(raw.points_px - truth, axis=-1)[3, 17:].mean()
    assert np.linalg.norm(whole.points_px - truth, axis=-1)[3, 17:].mean() < 0.7 * before
    assert list(quality["valid"]) == [1, 1, 0, 1] and quality["reason"][2]
    parts = [corrected_of(root, frames)[0] for frames in ([0, 1], [2, 3])]
    points = np.concatenate([part.points_px for part in parts])
    assert np.array_equal(points, whole.points_px, equal_nan=True)
    assert read_image(root / "out.png").shape[0] > 100


def test_landmarks_of_openface_are_key_frames(moving):
    root, truth, _ = moving
    extra = np.concatenate([truth, truth[:, :2]], axis=1)  # 68 points
    header = ["frame", "confidence", "success"]
    header += [f"{axis}_{k}" for axis in "xy" for k in range(68)]
    rows = [[f + 1, 0.98, int(f != 1), *(extra[f].T.reshape(-1) - 0.5)] for f in (0, 1, 3)]
    path = root / "openface.csv"
    path.write_text("\n".join(", ".join(map(str, row)) for row in [header, *rows]))
    kinds = key_frames_of(root, files=[path])["key_frame"].fillna("")
    assert [frame for frame, kind in enumerate(kinds) if kind == "given"] == [0, 3]
