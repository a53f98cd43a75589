"""Frames of a subject's takes to which the person is fitted."""

import numpy as np
import pytest

from vermilion.landmarks.detector import LandmarkTrack
from vermilion.storage.errors import InputError
from vermilion.tracking.identity.sampling import sample_takes


def test_a_video_without_a_face_names_the_images_to_look_at(tmp_path):
    paths = [tmp_path / "clip" / "landmarks" / f"{n}.npz" for n in (0, 1)]
    for n, path in enumerate(paths):
        path.parent.mkdir(parents=True, exist_ok=True)
        frames = np.arange(10 * n, 10 * n + 10)
        LandmarkTrack(
            frames, np.full((10, 66, 2), np.nan), np.zeros((10, 66)), np.zeros(10, bool)
        ).save(path)
    take = {"take": "clip", "camera": "cam", "neutral": None, "chunks": 2}
    with pytest.raises(InputError, match="no usable face in any of 20 frames of clip") as raised:
        sample_takes([take], [str(path) for path in paths], ["cameras"], ["cameras.json"], 8)
    assert str(tmp_path / "clip" / "landmarks" / "overlay") in str(raised.value)
