"""A generic regressor of three synthetic people: from their uncalibrated videos to a file, and onto a fourth."""

import re
import subprocess
import sys

import numpy as np
import pytest
import yaml

from vermilion.correspondence.models import bind_models
from vermilion.database.read import LipDatabase
from vermilion.faces.model import FaceModel
from vermilion.geometry.alignment import align_frames
from vermilion.geometry.head_frame import head_from_world
from vermilion.regression.model import load_model
from vermilion.tracking.result import TrackedTake

from .conftest import copy_project
from .test_graph import jobs_of

PEOPLE = ("c1", "c2", "c3")
SHEET = "subject\ttake\trole\tsource\tfirst\tlast\tfps\tsplit\n"


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A working copy whose configuration has three videos of the studio without calibration."""
    project = copy_project(tmp_path_factory.mktemp("generic"))
    rows = [f"{name}\tclip\tvideo\tstudio\t0\t7\t10\ttrain" for name in PEOPLE]
    rows.append("people\tlabelled\tvideo\tstudio\t0\t23\t30\tnone")
    (project.folder / "config" / "takes.few.tsv").write_text(SHEET + "\n".join(rows) + "\n")
    content = yaml.safe_load((project.folder / "config" / "tiny.yaml").read_text())
    content.update(results="results/few", takes="config/takes.few.tsv")
    studio = content["studio"]
    acted = {"poses": 3, "pose_seconds": [0.2, 0.3]}
    own = {
        name: {
            "seed": 30 + k,
            "takes": {"clip": {**acted, "seed": k, "video_view_mm": 220 + 30 * k}},
        }
        for k, name in enumerate(PEOPLE)
    }
    studio["subjects"] = own | {"people": studio["subjects"]["people"]}
    studio |= {"video_calibration": False, "contour_labels": 0, "expression_spread": 1.0}
    content |= {"apply": {"regressor": "none"}, "correction": {}, "training": {"folds": 3}}
    (project.folder / "config" / "few.yaml").write_text(yaml.safe_dump(content))
    return type(project)(project.folder, "config/few.yaml")


@pytest.mark.slow
def test_truth_is_read_by_the_database_of_a_generic_regressor_alone(project):
    run = project.snakemake("--dry-run", "generic")
    jobs = jobs_of(run.stdout + run.stderr)
    readers = {rule for rule, inputs, _ in jobs if "/truth/" in inputs}
    # The renderer needs the camera, which nobody else is told.
    assert {name for name in readers if not name.startswith("studio_take_")} == {"generic_database"}
    assert not {rule for rule, _, _ in jobs} & {"multiview_neutral", "layers", "correspondence"}


@pytest.mark.slow
def test_the_command_plans_the_regressor_of_the_first_people_alone(project):
    words = ["generic", "--configuration", project.configuration, "--people", "2", "-n"]
    command = [sys.executable, "-m", "vermilion.app", *words]
    environment = project.environment()
    run = subprocess.run(
        command, cwd=project.folder, env=environment, capture_output=True, text=True
    )
    planned = run.stdout + run.stderr
    assert run.returncode == 0, planned
    assert re.search(r"^features +2$", planned, re.M) and re.search(r"^train +1$", planned, re.M)
    assert not (project.folder / "models").exists()


@pytest.mark.slow
def test_people_of_the_studio_make_a_regressor_that_holds_none_of_them(project):
    project.snakemake("generic")
    model = load_model(project.results / "models" / "generic.h5")
    assert model.name == "generic" and not model.neutrals_mm
    assert sorted(model.training_frames) == [f"{name}/clip" for name in PEOPLE]
    with LipDatabase(project.results / "database" / "generic.h5") as database:
        assert database.subjects == PEOPLE
        entry, vertices = database.read_take("c1", "clip"), database.vertices
    calibration = (project.results / "takes/c1/clip/capture/cameras.json").read_text()
    assert '"assumed"' in calibration

    # What the database holds turns the track's neutral into the person's true one, but for the head's place.
    studio, tracker = (
        FaceModel.load(project.results / "face_model" / f"{name}.npz")
        for name in ("studio", "tracker")
    )
    take = project.results / "takes/c1/clip/tracking"
    fit, coarse = TrackedTake.load(take / "fit.npz"), np.load(take / "C/000000-000007.npy")
    local = head_from_world(
        coarse, fit.world_from_head_rotation, fit.world_from_head_translation_mm
    )
    truth = np.load(project.results / "truth/c1/clip/vertices_mm.npy").astype(float)
    true_mm = bind_models(studio, tracker).sample(truth, studio.triangles)[:, vertices]
    tracked_mm = local[:, vertices]
    assert entry.valid.all()
    made, left = (
        align_frames(mesh, true_mm, np.ones(len(vertices))).error_mm
        for mesh in (tracked_mm + entry.displacement_mm, tracked_mm)
    )
    assert made.max() < 1e-3 and left.min() > 0.3

    # Its correction of the mean neutral is none.
    first = np.stack([load_first(project, name) for name in PEOPLE])
    layers = model.predict(first)
    assert np.abs(layers).max() > 1e-3
    # But for the three digits that the file keeps of its basis.
    assert np.abs(layers.mean(axis=0)).max() < 0.01 * np.abs(layers).max()


def load_first(project, name):
    """Features (M,) of a person's first frame."""
    return np.load(project.results / f"takes/{name}/clip/features/000000-000007.npz")["features"][0]
