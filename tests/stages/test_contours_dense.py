"""Contours from the lips of dense landmarks: no track is needed, and errors of the rings are taken out."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stages.run_script import run_script
from tests.unit.mouths import draw_mouth
from vermilion.contours.detector_file import load_detector
from vermilion.contours.maps import read_maps
from vermilion.imaging.images import write_image
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.landmarks.sets import MEDIAPIPE478
from vermilion.storage.tables import read_table

pytestmark = pytest.mark.slow

OPENINGS = (6.0, 12.0, 9.0, 7.0)
CENTRE, HEIGHT, WIDTH = np.array([120.0, 150.0]), 26.0, 52.0
NAME = {"subject": "s1", "take": "phone"}


def dense_points(opening: float, landmarks: np.ndarray) -> np.ndarray:
    """(478, 2) px: the rings of the drawn mouth, the outer one 3 px too far out, as the network has it."""
    points = np.tile(CENTRE, (478, 1))
    points[MEDIAPIPE478.ibug66] = landmarks
    angle = np.linspace(np.pi, 3 * np.pi, 20, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points[MEDIAPIPE478.lip_outer] = CENTRE + circle * [WIDTH + 3, HEIGHT + 3]
    points[MEDIAPIPE478.lip_inner] = CENTRE + circle * [0.75 * WIDTH, opening + 1.5]
    return points


@pytest.fixture(scope="module", params=["track", "landmarks"])
def maps(request, tmp_path_factory):
    """Maps of four drawn frames by the scripts of the stage, from images and landmarks alone."""
    root = tmp_path_factory.mktemp("dense")
    points = []
    for frame, opening in enumerate(OPENINGS):
        image, landmarks, _ = draw_mouth(opening, HEIGHT, seed=frame)
        write_image(root / f"take/frames/cam/{frame:06d}.png", image)
        points.append(dense_points(opening, landmarks))
    n = len(points)
    track = LandmarkTrack(
        np.arange(n), np.stack(points), np.ones((n, 478)), np.ones(n, bool), MEDIAPIPE478
    )
    track.save(root / "landmarks.npz")
    params = {
        "cfg": {"contours.detector": {"kind": request.param}, "contours.maps": {}},
        "source": str(root / "take"),
        "capture": str(root / "take"),
        "camera": "cam",
    }
    detector, landmarks = root / "detector.npz", root / "landmarks.npz"
    run_script(
        "contours/contour_detector",
        wildcards=NAME,
        params=params,
        input={"landmarks": [landmarks], "around": []},
        output={"detector": detector, "quality": root / "labels.tsv"},
    )
    run_script(
        "contours/contours",
        wildcards=NAME,
        params=params,
        input={"landmarks": landmarks, "detector": detector},
        output={"maps": root / "maps", "quality": root / "maps.tsv", "overlay": root / "maps.png"},
    )
    return root


def test_all_frames_have_maps(maps):
    assert read_table(maps / "maps.tsv")["valid"].tolist() == [1] * len(OPENINGS)


@pytest.mark.parametrize("frame", range(len(OPENINGS)))
def test_crests_lie_on_the_lips_borders(maps, frame):
    """Above and below the mouth's middle; the outer ring that they began from is 3 px off."""
    inner, outer = read_maps(maps / f"maps/{frame:06d}.exr")
    for plane, half in ((outer, HEIGHT), (inner, OPENINGS[frame])):
        column = plane[:, 118:122].mean(axis=1)
        middle = int(CENTRE[1])
        above, below = column[:middle].argmax() + 0.5, middle + column[middle:].argmax() + 0.5
        assert abs(CENTRE[1] - above - half) < 1.5  # px
        assert abs(below - CENTRE[1] - half) < 1.5


def test_a_short_take_learns_from_the_frames_around_it(tmp_path):
    """Twelve drawn mouths tell how high this person's lips are; the take alone, two of them, does not."""
    points = []
    for frame in range(12):
        image, landmarks, _ = draw_mouth(6.0 + frame % 7, HEIGHT, seed=frame)
        write_image(tmp_path / f"take/frames/cam/{frame:06d}.png", image)
        points.append(dense_points(6.0 + frame % 7, landmarks))

    def track(name, frames):
        found = np.stack([points[frame] for frame in frames])
        ones = np.ones((len(frames), 478)), np.ones(len(frames), bool)
        LandmarkTrack(np.array(frames), found, *ones, MEDIAPIPE478).save(tmp_path / name)
        return tmp_path / name

    own, around = track("own.npz", [5, 6]), track("around.npz", [0, 1, 2, 3, 4, 7, 8, 9, 10, 11])
    learnt = []
    for name, more in (("alone.npz", []), ("whole.npz", around)):
        run_script(
            "contours/contour_detector",
            wildcards=NAME,
            params={
                "cfg": {"contours.detector": {"kind": "track"}},
                "source": str(tmp_path / "take"),
                "capture": str(tmp_path / "take"),
                "camera": "cam",
            },
            input={"landmarks": [own], "around": more},
            output={"detector": tmp_path / name, "quality": tmp_path / "labels.tsv"},
        )
        learnt.append(load_detector(tmp_path / name))
    assert not len(learnt[0].usual_heights) and len(learnt[1].usual_heights)
