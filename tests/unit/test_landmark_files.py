"""The 66-point scheme, and landmarks in files: tracks, labels, tables of other trackers."""

import json

import numpy as np
import pytest

from tests.unit.synthetic_face import landmark_layout
from vermilion.landmarks.detect import followed_track
from vermilion.landmarks.detector import Landmarks, LandmarkTrack
from vermilion.landmarks.faces import SeenFaces, find_faces
from vermilion.landmarks.following import FaceChoice, follow_face
from vermilion.landmarks.labels import label_files, read_labels, read_landmark_label
from vermilion.landmarks.point_file import read_point_file
from vermilion.landmarks.scheme import FROM_68, LIP_INNER, LIP_OUTER, MIRROR, interocular_px
from vermilion.landmarks.sets import IBUG66, MEDIAPIPE478
from vermilion.landmarks.table import GivenLandmarks, read_landmark_csv
from vermilion.landmarks.views import LandmarkViews
from vermilion.storage.errors import InputError


def face_px():
    """A frontal face in an image, (66, 2) px."""
    return landmark_layout()[:, :2] * [1.5, -1.5] + [160.0, 140.0]


def found(points=None, confidence=0.9):
    return Landmarks(face_px() if points is None else points, np.full(66, confidence), True)


def test_mirroring_twice_is_nothing_and_a_symmetric_face_is_its_mirror():
    assert (MIRROR[MIRROR] == np.arange(66)).all()
    face = landmark_layout()
    assert np.allclose(face[MIRROR] * [-1, 1, 1], face, atol=1e-9)


def test_the_66_points_are_the_68_without_inner_corners():
    assert sorted(FROM_68) == [k for k in range(68) if k not in (60, 64)]
    assert set(LIP_OUTER) & set(LIP_INNER) == {58, 62}
    assert FROM_68[58] == 48 and FROM_68[62] == 54


def test_interocular_distance_is_that_of_the_outer_corners():
    assert interocular_px(face_px()) == pytest.approx(92 * 1.5)


def test_tracks_are_saved_and_joined_in_order_of_frame(tmp_path):
    for first in (10, 0):
        frames = range(first, first + 3)
        entries = [found(face_px() + f) for f in frames]
        entries[1] = Landmarks.none()
        LandmarkTrack.of(list(frames), entries).save(tmp_path / f"{first}.npz")
    track = LandmarkTrack.load([tmp_path / "10.npz", tmp_path / "0.npz"])
    assert list(track.frames) == [0, 1, 2, 10, 11, 12]
    assert list(track.valid) == [True, False, True] * 2
    assert np.allclose(track.points_px[3], face_px() + 10)
    assert np.isnan(track.points_px[1]).all()


def test_a_damaged_track_names_its_file(tmp_path):
    (tmp_path / "t.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"t\.npz"):
        LandmarkTrack.load(tmp_path / "t.npz")


def test_views_without_a_face_are_left_out(tmp_path):
    views = LandmarkViews.of({"face0": Landmarks.none(), "face2": found()})
    views.save(tmp_path / "v.npz")
    again = LandmarkViews.load(tmp_path / "v.npz")
    assert list(again.cameras) == ["face2"]
    assert again.points_px.shape == (1, 66, 2) and again.confidence.shape == (1, 66)
    assert LandmarkViews.of({"lip0": Landmarks.none()}).points_px.shape == (0, 66, 2)


def test_an_unreadable_frame_is_flagged_and_the_rest_goes_on(tmp_path):
    def read(frame):
        if frame == 1:
            raise InputError("a truncated image", "a whole one", "Export it.", frame=1)
        return np.full((90, 160, 3), 0.5, dtype=np.float32)

    def find(frame, image):
        return [] if image is None or frame == 2 else [found()]

    finds = find_faces(read, find, [0, 1, 2, 3])
    finds.save(tmp_path / "000000-000003.npz")
    seen = SeenFaces.load([tmp_path / "000000-000003.npz"])
    track, rows = followed_track(finds, follow_face(seen, FaceChoice(least_eyes_px=0.0)))
    assert list(track.valid) == [True, False, False, True]
    assert "truncated" in rows[1].reason and rows[2].reason == "no face found"
    assert rows[3].figures["confidence"] == pytest.approx(0.9)


def write_label(capture, camera, frame, points):
    path = capture / "labels" / "landmarks" / camera / f"{frame:06d}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"unit": "px", "image": "x", "points": np.asarray(points).tolist()}))
    return path


def test_labels_are_read_in_order_and_68_points_become_66(tmp_path):
    sixty_eight = np.arange(136.0).reshape(68, 2)
    write_label(tmp_path, "cam", 3, face_px())
    write_label(tmp_path, "cam", 1, sixty_eight)
    labels = list(read_labels(tmp_path))
    assert [label.frame for label in labels] == [1, 3]
    assert np.array_equal(labels[0].points_px, sixty_eight[FROM_68])
    assert len(label_files(tmp_path / "nothing")) == 0


@pytest.mark.parametrize("points", [face_px()[:60], [["a", "b"]] * 66])
def test_wrong_labels_name_their_file(tmp_path, points):
    path = tmp_path / "000004.json"
    path.write_text(json.dumps({"points": np.asarray(points).tolist()}))
    with pytest.raises(InputError, match=r"000004\.json"):
        read_landmark_label(path)


def write_csv(path, count=68, frames=(1, 2, 3), confidence=(0.98, 0.9, 0.2), success=(1, 0, 1)):
    header = ["frame", " confidence", " success"]
    header += [f" x_{k}" for k in range(count)] + [f" y_{k}" for k in range(count)]
    lines = [",".join(header)]
    for frame, sure, good in zip(frames, confidence, success, strict=True):
        x = [f"{100 * frame + k}" for k in range(count)]
        y = [f"{200 * frame + k}" for k in range(count)]
        lines.append(", ".join([str(frame), str(sure), str(good), *x, *y]))
    path.write_text("\n".join(lines))
    return path


def test_openface_tables_count_from_one_and_from_pixel_centres(tmp_path):
    table = read_landmark_csv(write_csv(tmp_path / "of.csv"))
    first = table.at(0)
    assert first.found
    assert np.allclose(first.points_px[0], [100.5, 200.5])
    assert np.allclose(first.points_px[58], [148.5, 248.5])  # point 48 of 68
    assert not table.at(1).found  # success is 0
    assert not table.at(2).found  # confidence is 0.2
    assert not table.at(99).found


def test_tables_of_66_points_are_taken_as_they_are(tmp_path):
    path = write_csv(tmp_path / "t.csv", count=66)
    table = read_landmark_csv(path, first_frame=0, pixel_centre=0.5)
    assert np.allclose(table.at(1).points_px[65], [165.0, 265.0])


def test_a_table_without_landmarks_says_which_columns_it_wants(tmp_path):
    path = tmp_path / "pose.csv"
    path.write_text("frame,pose_Tx\n1,2.0\n")
    with pytest.raises(InputError, match="x_0 to x_65"):
        read_landmark_csv(path)


def test_a_table_with_text_for_a_number_is_refused(tmp_path):
    path = write_csv(tmp_path / "t.csv")
    path.write_text(path.read_text().replace("100,", "left,", 1))
    with pytest.raises(InputError, match="no number"):
        read_landmark_csv(path)


def write_json(path, frames, **content):
    path.write_text(json.dumps({"unit": "px", "frames": frames} | content))
    return path


def dense_points(count=478, depth=True):
    rng = np.random.default_rng(4)
    return rng.uniform(0.2, 0.8, (count, 3 if depth else 2))


def test_points_in_image_sizes_are_those_of_mediapipe(tmp_path):
    points = dense_points()
    frames = {"0": points.tolist(), "1": None, "3": {"points": points.tolist(), "confidence": 0.4}}
    path = write_json(tmp_path / "m.json", frames, unit="image", size_px=[640, 360])
    found = read_point_file(path, MEDIAPIPE478)
    assert list(found) == [0]
    assert np.allclose(found[0].points_px, points[:, :2] * [640, 360])
    assert np.allclose(found[0].depth_px, points[:, 2] * 640)
    assert list(read_point_file(path, MEDIAPIPE478, min_confidence=0.3)) == [0, 3]


def test_pixels_in_json_are_those_of_a_csv(tmp_path):
    points = np.array([[100 + k, 200 + k] for k in range(68)])
    json_path = write_json(tmp_path / "p.json", {"0": points.tolist()})
    csv_path = write_csv(tmp_path / "of.csv", frames=(1,), confidence=(1.0,), success=(1,))
    options = {"set": "ibug66", "first_frame": None, "pixel_centre": 0.0, "min_confidence": 0.5}
    tables = [GivenLandmarks(path=str(path), **options).read() for path in (json_path, csv_path)]
    assert [table.landmark_set for table in tables] == [IBUG66, IBUG66]
    assert np.allclose(tables[0].at(0).points_px, tables[1].at(0).points_px)


def test_a_csv_of_478_points_has_dense_lips(tmp_path):
    path = write_csv(tmp_path / "m.csv", count=478, frames=(1,), confidence=(1.0,), success=(1,))
    found = read_landmark_csv(path, MEDIAPIPE478).at(0)
    assert found.points_px.shape == (478, 2) and found.landmark_set is MEDIAPIPE478
    with pytest.raises(InputError, match="x_0 to x_477"):
        read_landmark_csv(write_csv(tmp_path / "of.csv"), MEDIAPIPE478)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"frames": {"7": [[1.0, 2.0]] * 66}}, r"frame 7.*478 points"),
        ({"frames": {"7": [["a", "b"]] * 478}}, r"frame 7.*no lists of numbers"),
        ({"frames": {"x": None}}, "a frame 'x'"),
        ({"frames": [[1.0, 2.0]]}, "no object with frames"),
        ({"frames": {}, "unit": "mm"}, "the unit 'mm'"),
        ({"frames": {}, "unit": "image", "size_px": [0, 5]}, r"size_px \[0, 5\]"),
    ],
)
def test_wrong_files_of_points_say_what_is_wrong(tmp_path, content, says):
    path = write_json(tmp_path / "m.json", **({"frames": {}} | content))
    with pytest.raises(InputError, match=rf"m\.json.*{says}|{says}"):
        read_point_file(path, MEDIAPIPE478)
