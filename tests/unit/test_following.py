"""One face is followed: chosen, linked over time, never another's; cuts divide."""

import numpy as np
import pytest

from tests.unit.synthetic_face import landmark_layout
from vermilion.config.takes import read_takes
from vermilion.imaging.images import srgb_to_linear
from vermilion.landmarks.cuts import FrameLooks, find_cuts, frame_look, pieces_of
from vermilion.landmarks.detect import followed_track
from vermilion.landmarks.detector import Landmarks
from vermilion.landmarks.faces import FaceFinds, SeenFaces, find_faces, sharp_eyes_px
from vermilion.landmarks.following import FaceChoice, FollowedFace, follow_face
from vermilion.landmarks.sets import IBUG66

LAYOUT = landmark_layout()
RNG = np.random.default_rng(0)


def face(centre, size, sure=0.95, shape=LAYOUT, deep=True):
    """A frontal face of a width of `size` px."""
    scaled = shape * size / 140.0
    points = np.asarray(centre) + scaled[:, :2] * [1, -1]
    depth = -scaled[:, 2] if deep else None
    return Landmarks(points, np.full(66, sure), True, IBUG66, depth)


def scene(seed, shift=(0, 0)):
    """A background (90, 160, 3) of smooth blotches, linear RGB, moved by `shift` px."""
    blotches = np.random.default_rng(seed).uniform(0.05, 0.95, (9, 16, 3))
    image = np.kron(blotches, np.ones((10, 10, 1)))
    return srgb_to_linear(np.roll(image, shift, axis=(0, 1)).astype(np.float32))


def finds_of(tmp_path, faces, images):
    def find(frame, _image):
        return faces[frame]

    finds = find_faces(lambda frame: images[frame], find, range(len(faces)))
    finds.save(tmp_path / "000000-000099.npz")
    return tmp_path / "000000-000099.npz"


def seen_of(tmp_path, faces, images=None):
    return SeenFaces.load([finds_of(tmp_path, faces, images or [scene(0)] * len(faces))])


def choice(values=()):
    return FaceChoice.of(values, 16.0, 0.028)


def test_the_largest_face_is_kept_where_it_is_lost_and_where_another_grows(tmp_path):
    faces = []
    for frame in range(40):
        mine, other = face((300 + frame, 200), 160), face((700, 220 - frame), 100 + 2.0 * frame)
        # The detector's order changes, and the face is hidden for three frames.
        shown = [mine, other] if frame % 2 else [other, mine]
        faces.append([other] if 20 <= frame < 23 else shown)
    path = finds_of(tmp_path, faces, [scene(0)] * 40)
    followed = follow_face(SeenFaces.load([path]), choice())
    followed.save(tmp_path / "followed.npz")
    track, rows = followed_track(FaceFinds.load(path), FollowedFace.load(tmp_path / "followed.npz"))
    assert list(np.flatnonzero(~track.valid)) == [20, 21, 22]
    middle = np.nanmean(track.points_px[track.valid][..., 0], axis=1)
    assert np.abs(middle - (300 + track.frames[track.valid])).max() < 5
    assert "other face(s) are not taken for it" in rows[21].reason
    assert rows[0].reason == "2 faces: the largest is followed" and rows[0].valid
    assert rows[5].figures["faces"] == 2


@pytest.mark.parametrize(
    ("values", "x"), [((), 300), ((690, 100), 700), ((600, 0, 1000, 900), 700)]
)
def test_a_point_or_a_box_says_which_face(tmp_path, values, x):
    faces = [[face((300, 200), 160), face((700, 200), 100)] for _ in range(10)]
    seen = seen_of(tmp_path, faces)
    followed = follow_face(seen, choice(values))
    assert followed.valid.all()
    assert {round(float(faces[0][k].points_px[:, 0].mean())) for k in followed.face} == {x}


def test_no_face_in_the_box_is_no_face(tmp_path):
    seen = seen_of(tmp_path, [[face((300, 200), 160)] for _ in range(5)])
    followed = follow_face(seen, choice((0, 0, 100, 100)))
    assert not followed.valid.any()
    assert "1 other face(s) are not taken for it" in followed.reason[0]


def test_a_cut_divides_and_its_first_frame_says_so(tmp_path):
    faces = [[face((300, 200), 160)]] * 12 + [[face((620, 240), 120)]] * 12
    images = [scene(1)] * 12 + [scene(2)] * 12
    followed = follow_face(seen_of(tmp_path, faces, images), choice())
    assert followed.valid.all()
    assert list(followed.piece) == [0] * 12 + [1] * 12
    assert followed.reason[12] == "a cut: piece 2 begins"
    assert set(np.delete(followed.reason, 12)) == {""}
    whole = follow_face(seen_of(tmp_path, faces, images), choice(), one_shot=True)
    assert not whole.piece.any()


def cuts_of(images):
    return list(find_cuts(FrameLooks.of([frame_look(image) for image in images])))


def test_pans_flashes_and_brightening_are_no_cuts():
    pan = [scene(3, (0, 10 * max(0, frame - 10))) for frame in range(30)]
    flash = [scene(3) * (6.0 if frame == 12 else 1.0) for frame in range(30)]
    brighter = [scene(3) * (0.3 + 0.05 * frame) for frame in range(30)]
    for images in (pan, flash, brighter):
        assert cuts_of(images) == []
    assert cuts_of([scene(3)] * 10 + [scene(4)] * 10 + [scene(3)] * 10) == [10, 20]


def test_a_jump_of_the_face_before_the_same_background_is_a_cut(tmp_path):
    def image(x):
        pixels = scene(5).copy()
        pixels[30:60, x : x + 24] = [0.9, 0.5, 0.3]
        return pixels + RNG.normal(0, 0.002, pixels.shape).astype(np.float32)

    x = np.where(np.arange(40) < 20, 30, 44) + np.round(np.sin(np.arange(40) / 3)).astype(int)
    faces = [[face((8 * k, 200), 160)] for k in x]
    followed = follow_face(seen_of(tmp_path, faces, [image(k) for k in x]), choice())
    assert list(np.flatnonzero(np.diff(followed.piece))) == [19]
    moving = [[face((8 * 30 + 6 * k, 200), 160)] for k in range(40)]
    still = follow_face(seen_of(tmp_path, moving, [image(30)] * 40), choice())
    assert not still.piece.any()


def test_an_unreadable_image_is_no_cut():
    looks = [frame_look(scene(1)) for _ in range(9)]
    looks[4] = (np.zeros_like(looks[0][0]), np.zeros_like(looks[0][1]))
    assert list(pieces_of(9, find_cuts(FrameLooks.of(looks)))) == [0] * 9


def test_a_small_or_blurred_face_is_flagged_with_its_size(tmp_path):
    small = follow_face(seen_of(tmp_path, [[face((80, 45), 14)]] * 3), choice())
    assert not small.valid.any()
    assert small.reason[0].startswith("the face is too small: eyes 9 px apart, at least 16 px")
    sharp = np.kron(np.indices((24, 40)).sum(axis=0) % 2, np.ones((8, 8)))[..., None] * np.ones(3)
    found = face((160, 96), 150)
    eyes = float(np.linalg.norm(found.points_px[36] - found.points_px[45]))
    assert sharp_eyes_px(sharp.astype(np.float32), found) == pytest.approx(eyes)
    import cv2

    blurred = cv2.GaussianBlur(sharp.astype(np.float32), (0, 0), 3.0)
    assert sharp_eyes_px(blurred, found) < 0.6 * eyes


@pytest.mark.parametrize(
    ("degrees", "command"), [(90, "transpose=2"), (-90, "transpose=1"), (180, "hflip,vflip")]
)
def test_a_face_on_its_side_is_told_with_the_command_that_turns_it(tmp_path, degrees, command):
    angle = np.radians(-degrees)  # in the image y runs down
    across, up = LAYOUT[:, 0], LAYOUT[:, 1]
    lying = np.column_stack(
        [
            np.cos(angle) * across - np.sin(angle) * up,
            np.sin(angle) * across + np.cos(angle) * up,
            LAYOUT[:, 2],
        ]
    )
    found = follow_face(seen_of(tmp_path, [[face((300, 200), 160, shape=lying)]] * 3), choice())
    assert found.valid.all() and f"turned by {abs(degrees)} degrees" in found.reason[0]
    assert command in found.reason[0] and found.reason[1] == ""
    upright = follow_face(seen_of(tmp_path, [[face((300, 200), 160)]] * 3), choice())
    assert (upright.reason == "").all()


def test_another_person_after_a_cut_is_told_and_left_out(tmp_path):
    other = LAYOUT * [1.12, 0.94, 0.8] + 3.0 * np.sin(LAYOUT / 17.0)
    images = [scene(1)] * 10 + [scene(2)] * 10 + [scene(1)] * 10
    shapes = [LAYOUT] * 10 + [other] * 10 + [LAYOUT] * 10
    noise = np.random.default_rng(2)

    def noisy(shape):
        return face((300, 200), 160, shape=shape + noise.normal(0, 0.4, shape.shape))

    followed = follow_face(seen_of(tmp_path, [[noisy(s)] for s in shapes], images), choice())
    assert list(followed.valid) == [True] * 10 + [False] * 10 + [True] * 10
    assert "another person than in the first piece" in followed.reason[15]
    flat = [[face((300, 200), 160, shape=s, deep=False)] for s in shapes]
    assert follow_face(seen_of(tmp_path, flat, images), choice()).valid.all()  # nothing tells


def test_the_take_sheet_may_say_which_face(tmp_path):
    sheet = tmp_path / "takes.tsv"
    header = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\tface\n"
    row = "a\tt\tvideo\tx.mp4\t0\t9\t25\tnone\t"
    sheet.write_text(header + row + "640, 200\n")
    assert read_takes(sheet)[0][0].face == (640.0, 200.0)
    sheet.write_text(header.replace("face", "focal") + row + "0.83\n")
    assert read_takes(sheet)[0][0].focal == 0.83
    sheet.write_text(header.replace("face", "focal") + row + "28mm\n")
    assert "focal: found '28mm'" in read_takes(sheet)[1][0]
    for wrong in ("1,2,3", "left", "10,10,5,20"):
        sheet.write_text(header + row + wrong + "\n")
        takes, problems = read_takes(sheet)
        assert not takes and "face: found" in problems[0]
