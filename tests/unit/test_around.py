"""Frames around a short take: which they are, and whose face counts in them."""

import numpy as np
import pytest

from tests.unit.test_following import choice, face, scene
from vermilion.landmarks.around import frames_around_take, track_around
from vermilion.landmarks.faces import find_faces
from vermilion.landmarks.following import follow_face


@pytest.mark.parametrize(
    ("take", "source", "expected"),
    [
        ((100, 109), (0, 999), [60, 70, 80, 90, 119, 129, 139, 149]),  # in the middle
        ((0, 9), (0, 999), [19, 29, 39, 49, 59, 69, 79, 89, 99]),  # at the beginning
        ((990, 999), (0, 999), [900, 910, 920, 930, 940, 950, 960, 970, 980]),  # at the end
        ((24, 29), (20, 59), [20, 33, 37, 41, 45, 49, 53, 57]),  # a short source
        ((0, 59), (0, 59), []),  # all of it
        ((0, 99), (0, 999), []),  # as long as the span
    ],
)
def test_frames_around_a_take(take, source, expected):
    assert frames_around_take(take, source, 100, 10) == expected


OWN = range(40, 52)


def track_of(faces, images, values=(), own=OWN):
    """The track around the frames `own` of a clip with these faces and images: of every tenth frame."""

    def finds(frames):
        return find_faces(lambda frame: images[frame], lambda frame, _image: faces[frame], frames)

    around = [frame for frame in range(0, len(faces), 10) if frame not in own]
    seen = finds(own).seen()
    return track_around(finds(around), seen, follow_face(seen, choice(values)), choice(values))


def middles(track):
    """Mean x (n,) of the face in the frames in which it is."""
    return np.nanmean(track.points_px[track.valid][..., 0], axis=1)


def test_the_face_of_the_take_is_followed_beyond_its_ends():
    faces = [[face((200 + frame, 200), 160)] for frame in range(100)]
    track = track_of(faces, [scene(0)] * 100)
    assert track.frames.tolist() == [0, 10, 20, 30, 60, 70, 80, 90] and track.valid.all()
    assert np.allclose(middles(track) - track.frames, 200, atol=5)


def test_a_face_that_is_the_largest_only_outside_the_take_is_not_taken():
    mine = [face((200, 200), 120) for _ in range(100)]
    other = [face((600, 200), 100 if n in OWN else 190) for n in range(100)]
    faces = [
        [a, b] if n in OWN else [b, a] for n, (a, b) in enumerate(zip(mine, other, strict=True))
    ]
    assert not track_of(faces, [scene(0)] * 100).valid.any()
    pointed = track_of(faces, [scene(0)] * 100, values=(200, 200))
    assert pointed.valid.all() and np.allclose(middles(pointed), 200, atol=5)


def test_frames_behind_a_cut_and_without_the_face_do_not_count():
    faces = [[] if frame == 20 else [face((300, 200), 160)] for frame in range(100)]
    images = [scene(1)] * 75 + [scene(2)] * 25
    track = track_of(faces, images)
    assert track.frames[track.valid].tolist() == [0, 10, 30, 60, 70]


def test_a_take_without_a_face_or_without_frames_around_it_has_nothing_around():
    faces = [[] if frame in OWN else [face((300, 200), 160)] for frame in range(100)]
    assert not track_of(faces, [scene(0)] * 100).valid.any()
    whole = track_of([[face((300, 200), 160)]] * 100, [scene(0)] * 100, own=range(100))
    assert whole.points_px.shape == (0, 66, 2)
