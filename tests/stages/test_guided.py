"""Guided correction from files to files: sketches and a sculpt, training, chunks, suggestions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.stages.run_script import run_script
from tests.unit import guided_mouths as mouths
from tests.unit.procedural_mouth import mouth
from vermilion.config.apply import OverlayConfig
from vermilion.config.guided import GuidedConfig
from vermilion.correction.lip_crossings import LipCrossings
from vermilion.export.objs import write_obj
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.geometry.camera import Camera, write_cameras
from vermilion.geometry.mesh import Mesh, adjacency
from vermilion.geometry.mesh_files import write_ply
from vermilion.geometry.polygons import Polygons
from vermilion.guided.inputs import read_sketch_views
from vermilion.guided.refined_frame import RefinedFrame
from vermilion.guided.refinement import RefinementSettings, SketchView
from vermilion.guided.sketch import write_sketch
from vermilion.imaging.images import read_image, write_srgb8
from vermilion.storage.errors import InputError
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.landmark_fit.expression import HeadMotion
from vermilion.tracking.result import Identity, TrackedTake

pytestmark = pytest.mark.slow

N_FRAMES, SKETCHED, SCULPTED = 6, (1, 4), 5
PLACE = {"subject": "s", "take": "t"}
FACE = mouths.face


@cache
def camera() -> Camera:
    return mouths.camera("cam")


def config(name: str):
    """A key of the section `guided`, as a rule's parameter carries it: small inner lips, nothing else moves."""
    chosen = GuidedConfig(regions={"inner_mm": 5.0}, propagation={"predict": "change"})
    return chosen.model_dump(mode="json")[name]


@pytest.fixture(scope="module")
def meshes():
    """(true, base) sequences (F, V, 3) float32: the base lacks the smile that comes with the jaw."""
    jaws = np.linspace(0.2, 0.45, N_FRAMES)
    true = [mouth(FACE(), j, mouthFunnel=j, mouthSmile_L=j) for j in jaws]
    base = [mouth(FACE(), j) for j in jaws]
    return np.array(true, dtype=np.float32), np.array(base, dtype=np.float32)


@pytest.fixture(scope="module")
def take(tmp_path_factory, meshes):
    """A folder with what the stage reads, the sequence in one chunk, and its frames refined."""
    root = tmp_path_factory.mktemp("guided")
    true, base = meshes
    face, frames = FACE(), np.arange(N_FRAMES)
    face.save(root / "tracker.npz")
    neutral = face.neutral_mm
    none = np.zeros(0)
    Identity(none, neutral, np.zeros((66, 3)), none.astype(str), none, none.astype(bool)).save(
        root / "identity.npz"
    )
    motion = HeadMotion(
        np.repeat(camera().rotation[None], N_FRAMES, axis=0),
        np.repeat(camera().translation[None], N_FRAMES, axis=0),
        np.zeros((N_FRAMES, face.n_expressions)),
        np.zeros(N_FRAMES),
    )
    valid = np.ones(N_FRAMES, dtype=bool)
    TrackedTake.of(frames, motion, valid, camera(), face).save(root / "fit.npz")
    write_cameras(root / "cameras", {"cam": camera()})
    for frame in frames:
        write_srgb8(root / "frames" / "cam" / f"{frame:06d}.png", np.full((640, 640, 3), 90, "u1"))
    write_sequence(root / "C" / "000000-000005.npy", base)
    for frame in SKETCHED:
        sketch = replace(mouths.drawn(true[frame].astype(float), camera()), frame=frame)
        write_sketch(sketch_file(root, frame), sketch)
        refine(root, frame)
    sculpt = Mesh(sculpted(base[SCULPTED]), face.triangles)
    write_ply(root / "labels" / "sculpts" / "000005.ply", sculpt)
    refine(root, SCULPTED, "sculpt")
    return root


def sculpted(mesh):
    """A mesh (V, 3) whose inner lips are 1.5 mm fuller, which fades to nothing at their border."""
    near = adjacency(FACE().triangles, FACE().n_vertices)
    count = np.asarray(near.sum(axis=1)).ravel()
    free = np.zeros(FACE().n_vertices)
    free[mouths.regions().free] = 1.0
    height = free.copy()
    for _ in range(20):
        height = free * (near @ height) / count
    return mesh.astype(float) + 1.5 * height[:, None] * [0.0, 0.0, 1.0]


def sketch_file(root, frame):
    return root / "labels" / "sketches" / "cam" / f"{frame:06d}.json"


def refine(root, frame, kind="sketch", corrections=None, **more):
    sculpt = root / "labels" / "sculpts" / f"{frame:06d}.ply"
    given = corrections or [sketch_file(root, frame) if kind == "sketch" else sculpt]
    run_script(
        "guided/guided_refine",
        wildcards={**PLACE, "frame": f"{frame:06d}"},
        params={
            "cfg": {f"guided.{key}": config(key) for key in ("regions", "refinement", "contact")},
            "source": str(root), "kind": kind, "tracked": True,
        },
        input={
            "corrections": given, "face": root / "tracker.npz", "fit": root / "fit.npz",
            "sequence": root / "C" / "000000-000005.npy", "cameras": root / "cameras", **more,
        },
        output={
            "refined": root / f"refined/{frame:06d}.npz", "quality": root / f"{frame:06d}.tsv",
            "overlay": root / f"{frame:06d}.png",
        },
    )  # fmt: skip


def train(root, frames, **chosen):
    options = {**config("propagation"), **chosen}
    options = {f"guided.propagation.{key}": value for key, value in options.items()}
    run_script(
        "guided/guided_train",
        params={"cfg": {"guided.regions": config("regions"), **options}},
        input={
            "face": root / "tracker.npz", "identity": root / "identity.npz",
            "refined": [root / f"refined/{frame:06d}.npz" for frame in frames],
        },
        output={"model": root / "propagator.npz"},
    )  # fmt: skip


def correct(root, base, sizes):
    """Corrected frames, with the sequence in chunks of `sizes`; files in `root`/chunks."""
    found = []
    for first, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        name = f"{first:06d}-{first + size - 1:06d}"
        write_sequence(root / "parts" / f"{name}.npy", base[first : first + size])
        run_script(
            "guided/guided_correct",
            wildcards={**PLACE, "chunk": name},
            params={
                "cfg": {
                    "apply.overlay": OverlayConfig(panel_height_px=160).model_dump(mode="json"),
                    "guided.contact": True, "guided.propagation.novelty_limit": 0.5,
                },
                "frames": list(range(first, first + size)), "fps": 30.0, "source": str(root),
                "camera": "cam", "sequence": "base",
            },
            input={
                "face": root / "tracker.npz", "tracker": root / "tracker.npz",
                "identity": root / "identity.npz", "fit": root / "fit.npz",
                "sequence": root / "parts" / f"{name}.npy", "model": root / "propagator.npz",
            },
            output={
                "corrected": root / "chunks" / f"{name}.npy", "video": root / f"{name}.mp4",
                "quality": root / f"quality{name}.tsv", "overlay": root / f"{name}.png",
            },
        )  # fmt: skip
        found.append(root / "chunks" / f"{name}.npy")
    return read_sequence(found)


@pytest.fixture(scope="module")
def corrected(take, meshes):
    """The take from its two sketches, in two chunks."""
    train(take, SKETCHED)
    return correct(take, meshes[1], [2, 4])


def off_px(mesh, sketch):
    """Mean distance (px) of a mesh's contours from a sketch."""
    view = SketchView.of(sketch, camera(), RefinementSettings())
    found = view.contours(mesh.astype(float), mouths.surface())
    return np.concatenate(
        [found[name].nearest(view.samples[name])[1] for name in view.samples]
    ).mean()


def test_a_refined_frame_lies_on_its_strokes_and_is_shown(take, meshes):
    outside = np.setdiff1d(np.arange(FACE().n_vertices), mouths.regions().mouth_vertices)
    for frame in SKETCHED:
        row = read_table(take / f"{frame:06d}.tsv").iloc[0]
        assert row["stage"] == "guided_refine" and row["valid"] == 1
        assert row["stroke_mean_px"] < 0.3 and row["stroke_largest_px"] < 1.0
        refined = RefinedFrame.load(take / f"refined/{frame:06d}.npz")
        np.testing.assert_array_equal(refined.vertices_mm[outside], meshes[1][frame][outside])
        assert read_image(take / f"{frame:06d}.png").std() > 0.01


def test_the_frames_without_a_sketch_follow(corrected, meshes):
    true, base = meshes
    for frame in sorted(set(range(N_FRAMES)) - set(SKETCHED)):
        sketch = mouths.drawn(true[frame].astype(float), camera())
        assert off_px(corrected[frame], sketch) < 0.6 * off_px(base[frame], sketch)


def test_chunk_size_changes_no_result(take, corrected, meshes):
    train(take, SKETCHED)
    np.testing.assert_array_equal(correct(take, meshes[1], [N_FRAMES]), corrected)


def test_border_and_the_rest_of_the_face_stay_as_they_are(corrected, meshes):
    moved = np.concatenate([mouths.regions().free, mouths.regions().followers])
    still = np.setdiff1d(np.arange(FACE().n_vertices), moved)
    np.testing.assert_array_equal(corrected[:, still], meshes[1][:, still])
    assert np.isin(mouths.regions().border, still).all()


def test_of_a_track_the_whole_mouth_region_is_corrected(take):
    """Chin and cheeks of a track are at a wrong depth; `change` holds the lips at them."""
    for predict, whole in (("auto", True), ("change", False), ("mouth", True)):
        train(take, [SCULPTED], predict=predict)
        with np.load(take / "propagator.npz") as made:
            assert ("change_scale" in made) == whole


def test_lips_do_not_pass_through_each_other(corrected):
    crossings = LipCrossings(FACE())
    assert max(crossings.find(mesh.astype(float)).deepest_mm for mesh in corrected) < 0.05


def test_a_sculpted_frame_is_learnt_as_it_is(take, meshes):
    base, sculpt = meshes[1], sculpted(meshes[1][SCULPTED])
    train(take, [SCULPTED])
    found = correct(take, base, [N_FRAMES])
    free = mouths.regions().free
    assert np.linalg.norm(sculpt - base[SCULPTED], axis=1)[free].max() > 0.5
    assert np.abs(found[SCULPTED] - sculpt)[free].max() < 0.02
    assert (np.linalg.norm(found - base, axis=2)[1:, free].max(axis=1) > 0.3).all()


@pytest.mark.parametrize(("suffix", "turned"), [("obj", True), ("ply", False)])
def test_a_sculpt_of_another_trackers_sequence_is_in_its_own_world_and_unit(
    take, meshes, tmp_path, suffix, turned
):
    sculpt = sculpted(meshes[1][SCULPTED])
    turn = Rotation.from_euler("xyz", [170, 20, 5], degrees=True).as_matrix()
    placement = Placement(turn, np.array([40.0, -30, 250]), 0.0, False)
    polygons = Polygons.of_triangles(FACE().triangles)
    origin = Origin(1000.0, "z" if turned else "y", turned, polygons, 0)
    placement.save(tmp_path / "placement.npz")
    origin.save(tmp_path / "origin.npz")
    given = tmp_path / f"{SCULPTED:06d}.{suffix}"
    in_file = origin.in_file(placement.undo(sculpt))
    if suffix == "ply":
        write_ply(given, Mesh(in_file, FACE().triangles))
    else:
        write_obj(given, in_file, polygons)
    own = {name: tmp_path / f"{name}.npz" for name in ("placement", "origin")}
    refine(take, SCULPTED, "sculpt", [given], **own)
    found = RefinedFrame.load(take / f"refined/{SCULPTED:06d}.npz").vertices_mm
    assert np.abs(found - sculpt).max() < 1e-3  # mm


def test_a_frame_without_a_mesh_is_left_and_named(take, meshes):
    train(take, SKETCHED)
    base = meshes[1].copy()
    base[2] = np.nan
    found = correct(take, base, [N_FRAMES])
    assert np.isnan(found[2]).all() and np.isfinite(np.delete(found, 2, axis=0)).all()
    rows = read_table(take / "quality000000-000005.tsv").set_index("frame")
    assert rows.loc[2, "valid"] == 0 and "left as it was" in rows.loc[2, "reason"]


def test_suggestions_are_frames_that_nobody_corrected(take):
    run_script(
        "guided/guided_suggest",
        params={
            "cfg": {"guided.regions": config("regions"), "guided.suggestion": {"count": 3}},
            "corrected": list(SKETCHED),
        },
        input={
            "face": take / "tracker.npz", "identity": take / "identity.npz",
            "fit": take / "fit.npz", "sequence": [take / "C" / "000000-000005.npy"],
        },
        output={"table": take / "suggestions.tsv"},
    )  # fmt: skip
    table = read_table(take / "suggestions.tsv", ["rank", "frame", "unexplained_after"])
    assert 1 <= len(table) <= 3
    assert not set(table["frame"]) & set(SKETCHED)
    assert (np.diff(table["unexplained_after"]) <= 1e-9).all()


def test_what_a_person_gave_is_checked(take):
    sketch = replace(mouths.drawn(mouths.open_mouth(), camera()), frame=3)
    path = take / "wrong" / "side" / "000003.json"
    write_sketch(path, replace(sketch, camera="side"))
    with pytest.raises(InputError, match="one of the take's cameras: cam"):
        read_sketch_views([path], {"cam": camera()}, 3)
    write_sketch(path, sketch)
    with pytest.raises(InputError, match="expected camera side, frame 3, as the file is named"):
        read_sketch_views([path], {"cam": camera()}, 3)
    sculpt = take / "wrong" / "000003.ply"
    write_ply(sculpt, Mesh(np.zeros((4, 3)), np.array([[0, 1, 2]], dtype=np.int32)))
    with pytest.raises(InputError, match="a sculpt of 4 vertices and 1 triangles"):
        refine(take, 3, "sculpt", [sculpt])
