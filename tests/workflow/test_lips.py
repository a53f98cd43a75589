"""What `vermilion lips` runs: a track with contours and its exports, no learning and no measures."""

import json
import os
import sys

import h5py
import numpy as np
import pytest

from vermilion.app.lip_shot import LipShot, write_shot
from vermilion.faces.build import TRACKER_TOPOLOGIES
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.video import write_video
from vermilion.regression.model import FORMAT, FORMAT_VERSION

from .conftest import Project

TRACK = {
    "face_model", "video_facts", "capture", "cameras", "landmarks_faces",
    "landmarks_followed", "landmarks", "landmarks_around", "image_identity", "tracking", "tracking_topology",
    "appearance", "image_fit", "image_fit_join", "tracking_meshes", "contour_detector", "contours", "features", "apply", "apply_export", "quality", "lips_page",
}  # fmt: skip


def write_clip(path):
    write_video(path, [np.full((64, 48, 3), 90, np.uint8)] * 12, 25.0)


def write_photo(path):
    write_srgb8(path, np.full((64, 48, 3), 90, np.uint8))


def write_images(path):
    path.mkdir()
    for frame in range(1, 41):
        write_photo(path / f"{frame:04d}.png")


def lips_of(fresh_project, tmp_path, name, write, **asked):
    """A project whose configuration is that of a file, and options of Snakemake."""
    environment = tmp_path / "landmarks" / "bin"
    environment.mkdir(parents=True)
    (environment / "python").symlink_to(sys.executable)  # a dry run does not start it
    clip = tmp_path / name
    write(clip)
    results = tmp_path / "out put"
    write_shot(LipShot(clip, str(results), {"name": "procedural"}, **asked))
    project = Project(fresh_project.folder, str(results / "config.yaml"))
    place = json.dumps(
        {"detector": "mediapipe", "mediapipe": {"environment": str(environment.parent)}}
    )
    return project, ("--config", f"landmarks={place}")


@pytest.fixture
def shot(fresh_project, tmp_path):
    """That of a clip with a space and an umlaut in its path."""
    return lips_of(fresh_project, tmp_path, "Größe 1.mp4", write_clip)


@pytest.mark.slow
def test_contours_alone_run_nothing_that_learns_or_measures(shot):
    project, options = shot
    assert set(project.would_run(*options)) == TRACK


@pytest.mark.slow
def test_a_photograph_takes_the_path_of_a_video(fresh_project, tmp_path):
    project, options = lips_of(fresh_project, tmp_path, "Größe 1.jpg", write_photo)
    assert set(project.would_run(*options)) == TRACK - {"video_facts", "landmarks_around"}


@pytest.mark.slow
def test_a_piece_of_numbered_images_learns_from_those_around_it(fresh_project, tmp_path):
    project, options = lips_of(fresh_project, tmp_path, "shot", write_images, first=20, last=25)
    run = project.snakemake("--dry-run", *options)
    printed = run.stdout + run.stderr
    body = printed.partition("rule landmarks_around:")[2].partition("rule ")[0]
    assert body.partition("output:")[0].count(".png") == 16
    short = json.dumps({"detector": {"track": {"span": 0}}})
    assert "landmarks_around" not in project.would_run(*options, f"contours={short}")


@pytest.mark.slow
def test_a_model_of_another_run_is_an_input_and_nothing_is_trained(shot, tmp_path):
    project, options = shot
    model = tmp_path / "MS.h5"
    model.write_bytes(b"")
    apply = json.dumps({"model": str(model)})
    run = project.snakemake("--dry-run", *options, f"apply={apply}")
    assert f", {model}" in run.stdout + run.stderr
    assert "rule train" not in run.stdout + run.stderr
    with h5py.File(model, "w") as file:
        topology = TRACKER_TOPOLOGIES["ict"]
        file.attrs.update(format=FORMAT, format_version=FORMAT_VERSION, topology_sha256=topology)
    other = project.snakemake("--dry-run", *options, f"apply={apply}", check=False)
    told = f"key apply.model: found {model}, which was trained for the face model ICT-FaceKit"
    assert other.returncode and told in other.stdout + other.stderr
    os.unlink(model)
    missing = project.snakemake("--dry-run", *options, f"apply={apply}", check=False)
    assert missing.returncode and str(model) in missing.stdout + missing.stderr
