"""Which rules run again after each kind of change: exactly these, and no others."""

import contextlib
import os
import time

import pytest

from vermilion.imaging.images import read_image, write_image

pytestmark = pytest.mark.slow

TAKE = "s1/rom"
#: What follows from new regressors.
AFTER_TRAINING = {
    "evaluate", "evaluation_figures", "measures", "apply", "apply_export", "lips_page", "quality",
    "summary",
}  # fmt: skip
AFTER_FEATURES = AFTER_TRAINING | {"database", "train"}
AFTER_CONTOURS = AFTER_FEATURES | {"features", "neutral_pair"}
AFTER_TRACKING = AFTER_CONTOURS | {
    "appearance", "image_fit", "image_fit_join", "residuals", "ablations", "tracking_meshes", "correspondence", "layers", "lip_shapes", "evaluate_reconstruction",
}  # fmt: skip
AFTER_INPAINT = AFTER_TRACKING | {
    "landmarks_faces", "landmarks_followed", "landmarks", "image_identity", "tracking",
    "tracking_topology", "contour_detector", "contours",
}  # fmt: skip
AFTER_MULTIVIEW = AFTER_INPAINT | {"inpaint_reference", "inpaint"}
AFTER_CAMERAS = AFTER_MULTIVIEW | {
    "landmarks_views", "multiview_neutral", "multiview_anchor", "multiview_clip",
    "multiview_track", "multiview_refine", "multiview_drift", "multiview_report",
}  # fmt: skip


@contextlib.contextmanager
def changed(path, content: bytes):
    """Give a file another content, then its own content and time back."""
    before, state = path.read_bytes(), path.stat()
    time.sleep(0.01)
    path.write_bytes(content)
    try:
        yield
    finally:
        path.write_bytes(before)
        os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


@contextlib.contextmanager
def configured(project, change):
    """Change the configuration, then give it back."""
    path = project.folder / project.configuration
    before = path.read_bytes()
    project.edit_configuration(change)
    try:
        yield
    finally:
        path.write_bytes(before)


def test_finished_run_has_nothing_to_do(finished):
    assert finished.would_run() == {}


def test_ridge_parameter(finished):
    def change(content):
        content.setdefault("training", {})["alphas"] = [0.25]

    with configured(finished, change):
        assert set(finished.would_run()) == AFTER_TRAINING | {"train"}


def test_when_an_edge_of_the_lips_counts_as_rough(finished):
    def change(content):
        measures = content.setdefault("evaluation", {}).setdefault("measures", {})
        measures["surface"] = {"rough_ratio": 2.0}

    with configured(finished, change):
        assert set(finished.would_run()) == AFTER_TRAINING | {"evaluate_reconstruction"}


def test_neutral_frame_of_a_video(finished):
    def change(content):
        content["correction"] = {"neutral_frames": {"s1/phone": 1}}

    with configured(finished, change):
        jobs = finished.would_run()
    assert set(jobs) == AFTER_TRAINING | {"neutral_pair"}
    assert (jobs["neutral_pair"], jobs["evaluate"]) == (1, 1)  # of this take only


def test_feather_width(finished):
    def change(content):
        content.setdefault("inpaint", {})["mask"] = {"feather_mm": 1.25}

    with configured(finished, change):
        jobs = finished.would_run()
    assert set(jobs) == AFTER_INPAINT | {"inpaint_reference", "inpaint"}


def test_landmarks_corrected_by_flow(finished):
    def change(content):
        content["landmarks"]["correction"] = {"mode": "flow"}

    with configured(finished, change):
        jobs = finished.would_run()
    kept = {"landmarks_faces", "landmarks_followed"}
    corrected = {"landmarks_key_frames", "landmarks_corrected"}
    assert set(jobs) == (AFTER_INPAINT - kept) | corrected


def test_which_face_is_followed(finished):
    def change(content):
        content["landmarks"]["following"] = {"face": [10.0, 10.0]}

    with configured(finished, change):
        jobs = set(finished.would_run())
    assert {"landmarks_followed", "landmarks", "tracking"} <= jobs
    assert not jobs & {"landmarks_faces", "inpaint"}  # faces are not looked for again


def test_contour_label(finished):
    labels = sorted((finished.folder / "captures" / TAKE / "labels" / "contours").rglob("*.json"))
    text = labels[0].read_bytes()
    with changed(labels[0], text + b"\n"):
        jobs = finished.would_run()
    assert set(jobs) == AFTER_CONTOURS | {"contour_detector", "contours"}
    assert jobs["contour_detector"] == 1  # of this take only


def test_image_of_one_frame(finished, tmp_path):
    path = finished.folder / "captures" / TAKE / "frames" / "face1" / "000010.png"
    write_image(tmp_path / "darker.png", read_image(path) * 0.9)
    with changed(path, (tmp_path / "darker.png").read_bytes()):
        jobs = finished.would_run()
    assert set(jobs) == AFTER_CAMERAS | {"capture", "cameras", "plain_texture"}
    assert jobs["capture"] == 1  # the chunk that holds it
    assert jobs["multiview_neutral"] == 2  # of this take, and of the plain one on its points


def test_touched_image_with_the_same_content(finished):
    path = finished.folder / "captures" / TAKE / "frames" / "face1" / "000010.png"
    with changed(path, path.read_bytes()):
        assert finished.would_run() == {}


def test_chunk_size(finished):
    everything = AFTER_CAMERAS | {"capture", "cameras", "landmark_model", "plain_texture"}
    with configured(finished, lambda content: content.update(chunk_frames=6)):
        jobs = set(finished.would_run())
    assert {"capture", "multiview_refine", "tracking_meshes"} <= jobs <= everything


def test_comment_in_a_library_module(finished):
    path = finished.folder / "src" / "vermilion" / "geometry" / "mesh.py"
    with changed(path, path.read_bytes() + b"\n# a comment\n"):
        assert finished.would_run() == {}


def test_overlay_of_the_refinement(finished):
    with configured(
        finished, lambda content: content["tracking"]["image_fit"].update(overlay_frames=2)
    ):
        assert set(finished.would_run()) == {"residuals", "ablations", "summary"}


def test_refinement_switched_off(finished):
    with configured(
        finished, lambda content: content["tracking"]["image_fit"].update(enabled=False)
    ):
        jobs = set(finished.would_run())
    assert {"tracking", "tracking_meshes"} <= jobs
    assert not jobs & {"appearance", "image_fit", "image_fit_join", "residuals", "ablations"}


def test_identity_from_landmarks_alone(finished):
    def change(content):
        content["tracking"]["identity"]["images"] = {"enabled": False}

    with configured(finished, change):
        jobs = set(finished.would_run())
    assert {"identity", "tracking", "tracking_meshes", "train"} <= jobs
    assert not jobs & {"image_identity", "landmarks", "inpaint"}


def test_relief_of_a_take(finished):
    def change(content):
        content["detail"] = {"relief": {"takes": [TAKE]}}

    added = {"relief_start", "relief_evidence", "relief_light", "relief", "relief_meshes"}
    with configured(finished, change):
        assert set(finished.would_run()) == added | {"ablations", "lips_page", "quality", "summary"}


def test_relief_after_the_corrective_flow(finished):
    def change(content):
        content["detail"] = {"takes": [TAKE], "relief": {"takes": [TAKE]}}

    added = {
        "detail_flow",
        "relief_start",
        "relief_evidence",
        "relief_light",
        "relief",
        "relief_meshes",
    }
    with configured(finished, change):
        assert set(finished.would_run()) == added | {"ablations", "lips_page", "quality", "summary"}


def test_line_of_code_in_the_tracking_module(finished):
    path = finished.folder / "src" / "vermilion" / "tracking" / "landmark_fit" / "expression.py"
    with changed(path, path.read_bytes() + b"\nCHANGED = True\n"):
        jobs = set(finished.would_run())
    contours = {"contour_detector", "contours"}  # they start from the track or are held against it
    assert jobs == AFTER_TRACKING | contours | {"image_identity", "tracking", "tracking_topology"}


def test_camera_file(finished):
    path = finished.folder / "captures" / TAKE / "cameras" / "images.txt"
    with changed(path, path.read_bytes() + b"# checked\n"):
        jobs = finished.would_run()
    assert set(jobs) == AFTER_CAMERAS | {"capture", "cameras", "plain_texture"}
    assert jobs["cameras"] == 1  # of this take only
