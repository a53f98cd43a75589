"""Video as people have it: turned, squeezed, interlaced, unevenly timed, in other colours."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace

import av
import numpy as np
import pytest
from av.video.reformatter import Colorspace

from tests.unit.small_videos import HEIGHT, WIDTH, mean_difference, scene, write_clip
from vermilion.capture.video_facts import field_warning, load_video_facts, video_facts
from vermilion.imaging.colour import colour_of_frame
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import srgb_to_linear
from vermilion.imaging.orientation import Orientation, orientation_of_matrix
from vermilion.imaging.pixel_aspect import square_size
from vermilion.imaging.video import VideoIndex, VideoReader, write_video
from vermilion.storage.errors import InputError, RefusedInputError

SCENES = [scene(moment) for moment in range(12)]
BT709 = {"colorspace": 1, "color_range": 1, "color_trc": 1, "color_primaries": 1}
BT601 = {"matrix": Colorspace.ITU601}


def interlaced(moments=6):
    """Frames of two moments each; the encoder marks the lower field as the first."""
    upper = (np.arange(HEIGHT) % 2 == 0)[:, None, None]
    return [np.where(upper, scene(2 * i + 1), scene(2 * i)) for i in range(moments)]


def write_interlaced(path):
    options = {"flags": "+ilme+ildct"}
    return write_clip(path, interlaced(), pix_fmt="yuv422p", options=options, **BT601)


def turned(degrees, mirrored=False):
    return lambda stream: stream.set_display_rotation(degrees, mirrored)


def squeezed(aspect):
    return lambda stream: setattr(stream.codec_context, "sample_aspect_ratio", aspect)


def test_plain_video_is_what_the_decoder_gives(tmp_path):
    path = write_clip(tmp_path / "a.mp4", SCENES, pix_fmt="yuv420p", tags=BT709)
    decoded = [f.to_ndarray(format="rgb24") for f in av.open(str(path)).decode(video=0)]
    source = open_frames(path)
    for frame in (3, 0, 11, 4, 5):
        assert np.array_equal(VideoReader(path).read(frame), decoded[frame])
        linear = srgb_to_linear(np.arange(256, dtype=np.float32) / 255.0)[decoded[frame]]
        assert np.array_equal(source.read("cam", frame), linear)


@pytest.mark.parametrize(
    ("prepare", "shown"),
    [
        (turned(-90), lambda image: np.rot90(image, -1)),
        (turned(90), np.rot90),
        (turned(180), lambda image: image[::-1, ::-1]),
        (turned(0, True), lambda image: image[:, ::-1]),
    ],
)
def test_display_matrix_is_honoured(tmp_path, prepare, shown):
    reader = VideoReader(write_clip(tmp_path / "a.mp4", SCENES, prepare=prepare, **BT601))
    for frame in (7, 2):
        assert mean_difference(reader.read(frame), shown(SCENES[frame])) < 1.5  # display values
    assert reader.size == shown(SCENES[0]).shape[1::-1]


def test_matrix_that_turns_by_no_quarter_is_refused(tmp_path):
    assert orientation_of_matrix([0, 65536, 0, -65536, 0]) == Orientation(True, True)
    path = write_clip(tmp_path / "a.mp4", SCENES[:2], prepare=turned(30))
    with pytest.raises(RefusedInputError, match=r"a\.mp4.*turn by .*30\.0 degrees.*ffmpeg -i"):
        VideoReader(path).read(0)


def test_pixels_become_square_and_nothing_shrinks(tmp_path):
    wide = VideoReader(
        write_clip(tmp_path / "wide.mp4", SCENES, prepare=squeezed(Fraction(4, 3)), **BT601)
    )
    assert wide.size == (128, 64) and wide.read(4).shape == (64, 128, 3)
    assert mean_difference(wide.read(4)[:, 2::4], SCENES[4][:, 1::3]) < 4  # the bar's border moves
    assert square_size(720, 480, 8 / 9) == (720, 540)
    assert square_size(720, 480, 0.0) == (720, 480)
    with pytest.raises(ValueError, match="9 times as wide"):
        square_size(720, 480, 9.0)


def test_interlaced_frames_become_images_of_their_first_field(tmp_path):
    reader = VideoReader(write_interlaced(tmp_path / "a.mp4"))
    assert reader.n_frames == 6
    for frame in range(1, 5):
        image = reader.read(frame)
        assert mean_difference(image, scene(2 * frame)) < 1.7
        assert mean_difference(image, scene(2 * frame + 1)) > 3
        combed = mean_difference(image[:40:2], image[1:41:2])
        assert combed < 0.6 * mean_difference(
            interlaced()[frame][:40:2], interlaced()[frame][1:41:2]
        )


def test_interlaced_video_is_said_with_the_command_for_both_moments(tmp_path):
    facts = video_facts(write_interlaced(tmp_path / "a.mp4"))
    facts.save(tmp_path / "facts.json")
    assert load_video_facts(tmp_path / "facts.json").interlaced
    assert "half the lines" in field_warning(facts)
    assert "ffmpeg -i a.mp4 -vf bwdif=mode=send_field" in field_warning(facts)
    progressive = video_facts(write_clip(tmp_path / "b.mp4", SCENES[:3], tags=BT709))
    assert not progressive.interlaced
    assert field_warning(progressive) == ""


@pytest.mark.parametrize(
    "kind", ["turned", "squeezed", "interlaced", "uneven", "open groups", "edited"]
)
def test_every_frame_is_the_same_in_any_order(tmp_path, kind):
    path, images = tmp_path / "a.mp4", [scene(i % 30) for i in range(40)]
    short = {"g": "8", "x264-params": "bframes=3:b-adapt=0:scenecut=0"}
    if kind == "interlaced":
        write_interlaced(path)
    elif kind == "open groups":
        short["x264-params"] += ":open-gop=1:keyint=8:min-keyint=8"
        write_clip(path, images, options=short)
    else:
        more = {
            "turned": {"prepare": turned(90)},
            "squeezed": {"prepare": squeezed(Fraction(16, 9))},
            "uneven": {"stamps": [i + i // 2 for i in range(40)]},
            "edited": {"stamps": range(-5, 35), "container": {"avoid_negative_ts": "disabled"}},
        }[kind]
        write_clip(path, images, options=short, **more)
    reader = VideoReader(path)
    forward = [reader.read(frame) for frame in range(reader.n_frames)]
    for frame in np.random.default_rng(0).permutation(reader.n_frames)[:15].tolist():
        assert np.array_equal(reader.read(frame), forward[frame]), frame
    assert np.array_equal(VideoReader(path).read(4), forward[4])
    assert len({image.tobytes() for image in forward[:20]}) == min(20, reader.n_frames)


def test_frames_that_an_edit_list_cuts_away_do_not_count(tmp_path):
    path = write_clip(
        tmp_path / "a.mp4",
        SCENES,
        stamps=range(-4, 8),
        container={"avoid_negative_ts": "disabled"},
        **BT601,
    )
    reader = VideoReader(path)
    assert reader.n_frames == 8
    for frame in (5, 0, 7):
        assert mean_difference(reader.read(frame), SCENES[frame + 4]) < 1.5


def test_times_are_those_of_the_file(tmp_path):
    stamps = [0, 1, 3, 4, 6, 7, 9, 10, 12, 13, 15, 16]
    reader = VideoReader(write_clip(tmp_path / "a.mp4", SCENES, stamps=stamps, **BT601))
    assert np.allclose(reader.times_s, np.array(stamps) / 25)
    for frame in (9, 2):
        assert mean_difference(reader.read(frame), SCENES[frame]) < 1.5


def test_an_index_that_is_given_saves_listing_the_packets(tmp_path):
    path = write_clip(tmp_path / "a.mp4", SCENES)
    whole = VideoReader(path)
    again = VideoReader(path, VideoIndex(whole.index.stamps, whole.index.keys))
    assert again.n_frames == 12 and np.array_equal(again.read(9), whole.read(9))


@pytest.mark.parametrize(
    ("clip", "lines"),
    [
        ({"matrix": Colorspace.ITU709, "tags": BT709}, 64),
        ({"matrix": Colorspace.ITU601, "tags": {"colorspace": 5}}, 64),
        ({"matrix": Colorspace.BT2020, "tags": {"colorspace": 9}}, 64),
        (
            {
                "matrix": Colorspace.ITU709,
                "tags": {"colorspace": 1, "color_range": 2},
            },
            64,
        ),
        ({"matrix": Colorspace.ITU601}, 64),
        ({"matrix": Colorspace.ITU709}, 720),
    ],
    ids=["BT.709", "BT.601", "BT.2020", "full range", "untagged, small", "untagged, 720 lines"],
)
def test_matrix_and_range_are_as_tagged_or_by_resolution(tmp_path, clip, lines):
    image = np.full((lines, max(WIDTH, lines), 3), (190, 80, 60), dtype=np.uint8)
    reader = VideoReader(write_clip(tmp_path / "a.mp4", [image], **clip))
    assert np.abs(reader.read(0)[20, 20].astype(int) - [190, 80, 60]).max() <= 2
    # A wrong matrix is off by more than that.
    other = Colorspace.ITU601 if clip["matrix"] != Colorspace.ITU601 else Colorspace.ITU709
    wrong = VideoReader(write_clip(tmp_path / "b.mp4", [image], **{**clip, "matrix": other}))
    assert np.abs(wrong.read(0)[20, 20].astype(int) - [190, 80, 60]).max() >= 5


def test_a_portrait_and_its_turned_landscape_have_one_matrix(tmp_path):
    """Lines are counted along the shorter side, so that 480 x 720 is no high definition."""
    image = np.full((720, 480, 3), (190, 80, 60), dtype=np.uint8)
    plain = VideoReader(write_clip(tmp_path / "a.mp4", [image], **BT601))
    tagged = VideoReader(
        write_clip(tmp_path / "b.mp4", [np.rot90(image)], prepare=turned(-90), **BT601)
    )
    assert plain.size == tagged.size == (480, 720)
    assert mean_difference(plain.read(0), tagged.read(0)) < 1


@pytest.mark.parametrize(
    ("tags", "found"),
    [
        ({"color_trc": 9}, "logarithmic"),
        ({"color_trc": 8}, "linear"),
        ({"colorspace": 14}, "matrix of code 14"),
        ({"color_primaries": 10}, "primaries of code 10"),
    ],
)
def test_colours_that_are_not_converted_are_refused_with_the_command(tmp_path, tags, found):
    path = write_clip(tmp_path / "clip.mp4", SCENES[:2], tags={**BT709, **tags})
    with pytest.raises(RefusedInputError, match=rf"clip\.mp4.*{found}.*ffmpeg -i clip\.mp4"):
        VideoReader(path).read(0)


def test_written_video_says_its_colours_and_comes_back(tmp_path):
    colours = [(200, 60, 60), (60, 180, 80), (40, 60, 200), (255, 255, 255), (0, 0, 0)]
    for height in (240, 720):
        images = [np.full((height, 320, 3), colour, np.uint8) for colour in colours]
        write_video(tmp_path / "a.mp4", images, 25)
        reader = VideoReader(tmp_path / "a.mp4")
        for frame, colour in enumerate(colours):
            assert np.abs(reader.read(frame).reshape(-1, 3).mean(axis=0) - colour).max() < 3
        first = next(av.open(str(tmp_path / "a.mp4")).decode(video=0))
        assert (first.colorspace, first.color_range, first.color_trc) == (1, 1, 1)


def test_time_stamps_out_of_order_are_refused_with_the_command(tmp_path):
    options = {"x264-params": "bframes=3:b-adapt=0:scenecut=0"}
    reader = VideoReader(
        write_clip(tmp_path / "old.avi", [scene(i) for i in range(30)], options=options)
    )
    with pytest.raises(RefusedInputError, match=r"B-frames.*ffmpeg -i old\.avi"):
        [reader.read(frame) for frame in range(5)]


def test_dolby_vision_without_a_base_layer_is_refused():
    tags = SimpleNamespace(type=SimpleNamespace(name="DOVI_METADATA"))
    values = {"color_trc": 2, "color_primaries": 2, "colorspace": 2, "side_data": [tags]}
    with pytest.raises(RefusedInputError, match=r"Dolby Vision.*ffmpeg"):
        colour_of_frame(SimpleNamespace(**values))


def test_a_frame_that_is_not_there_is_an_error_not_a_neighbour(tmp_path):
    path = write_clip(tmp_path / "a.mp4", SCENES)
    whole = VideoReader(path)
    stamps = whole.index.stamps
    shifted = VideoReader(
        path, VideoIndex((*stamps[:3], stamps[3] + 7, *stamps[4:]), whole.index.keys)
    )
    with pytest.raises(InputError, match=r"frame 3.*cannot be decoded.*no such frame"):
        shifted.read(3)
    assert np.array_equal(shifted.read(5), whole.read(5))
