"""Another tracker's sequences as the base: its jobs take the place of our tracker's, the rest is the same."""

import json
import shutil

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.foreign_tracker import ForeignTracker, write_objs
from vermilion.correspondence.correspondence import Correspondence
from vermilion.external.read import read_tracked
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.scan.landmarks import ScanLandmarks, write_scan_landmarks
from vermilion.storage.tables import read_table

from .conftest import Project
from .test_graph import jobs_of

pytestmark = pytest.mark.slow

TAKES = (("s1", "rom"), ("s1", "phone"), ("s2", "rom"))
#: A frame of the shot that the sequence has not.
LOST = 5
#: Jobs of our own tracker.
OURS = {
    "identity", "image_identity", "tracking", "appearance", "image_fit", "image_fit_join", "offsets",
    "residuals", "ablations", "tracking_meshes",
}  # fmt: skip
#: Jobs that a sequence adds: each once a run, a subject, a take or a chunk of the tiny capture.
ADDED = {
    "tracked_topology": 3, "tracked_meshes": 5, "external_topology": 1, "external_model": 1,
    "external_identity": 2, "external_fit": 3, "external_meshes": 5,
}  # fmt: skip
#: Jobs that read the face model of the base.
READERS = (
    "external_identity", "external_fit", "external_meshes", "contours", "correspondence", "features",
    "layers", "neutral_pair", "lip_shapes", "evaluate", "apply", "apply_export",
)  # fmt: skip


def jobs(project, *, of, export=None, **tracking):
    """Rule, inputs and outputs of the jobs of the tiny capture with three sequences."""
    sheet = (project.folder / "config/takes.tiny.tsv").read_text().splitlines()
    rows = [sheet[0] + "\tof", *(line + "\t" for line in sheet[1:])]
    for subject, take in TAKES:
        source = project.folder / f"tracks/{subject}_{take}"
        source.mkdir(parents=True, exist_ok=True)
        (source / "0000.obj").touch()
        cells = [subject, f"{take}_ft", "tracked", str(source), "0", "7", "30", "none"]
        rows.append("\t".join([*cells, take if of else ""]))
    (project.folder / "config/takes.external.tsv").write_text("\n".join(rows) + "\n")
    settings = ["--config", "takes=config/takes.external.tsv"]
    if tracking:
        settings.append(f"tracking={json.dumps(tracking)}")
    if export:
        settings.append(f"apply={json.dumps({'export': export})}")
    run = project.snakemake("--dry-run", *settings)
    return jobs_of(run.stdout + run.stderr)


def counted(found):
    names = [rule for rule, _, _ in found]
    return {name: names.count(name) for name in sorted(set(names))}


def test_sequences_are_the_base_of_every_stage(fresh_project):
    ours, theirs = jobs(fresh_project, of=False), jobs(fresh_project, of=True)
    before, after = counted(ours), counted(theirs)
    assert not set(ADDED) & set(before)
    assert {name: after[name] for name in ADDED} == ADDED
    assert not OURS & set(after)
    rest = {name: n for name, n in before.items() if name not in OURS}
    assert {name: n for name, n in after.items() if name not in ADDED} == rest
    for rule in READERS:
        inputs = [given for name, given, _ in theirs if name == rule]
        assert inputs and all("face_model/external.npz" in given for given in inputs), rule
    ours_read_by = {name for name, given, _ in theirs if "face_model/tracker.npz" in given}
    assert ours_read_by <= {"all", "external_topology"}
    (export,) = [given for name, given, _ in theirs if name == "apply_export"]
    assert "s1/phone/tracking/placement.npz" in export
    assert "s1/phone_ft/tracking/sequence.npz" in export


def test_weights_and_a_model_of_another_run_are_inputs(fresh_project):
    base = {"weights": "tracks/{subject}_{of}.csv"}
    for name in ("s1_rom", "s1_phone", "s2_rom"):
        (fresh_project.folder / "tracks").mkdir(exist_ok=True)
        (fresh_project.folder / f"tracks/{name}.csv").touch()
    found = jobs(fresh_project, of=True, external={"base": base})
    (model,) = [given for name, given, _ in found if name == "external_model"]
    assert "tracks/s1_rom.csv" in model and "tracks/s2_rom.csv" in model
    assert "phone" not in model  # the held-out shot teaches nothing
    (fresh_project.folder / "other.npz").touch()
    found = jobs(fresh_project, of=True, external={"base": {"model": "other.npz"}})
    assert not {"external_topology", "external_model"} & {name for name, _, _ in found}
    assert all("other.npz" in given for name, given, _ in found if name == "features")


def test_flames_weights_are_solved_from_the_parameters_and_the_model(fresh_project):
    (fresh_project.folder / "flame.npz").touch()
    (fresh_project.folder / "tracks/s1_phone").mkdir(parents=True, exist_ok=True)
    (fresh_project.folder / "tracks/s1_phone/0000.npz").touch()
    flame = {"external": {"flame": "flame.npz"}}
    found = jobs(fresh_project, of=True, export={"flame": True}, **flame)
    (export,) = [(given, made) for name, given, made in found if name == "apply_export"]
    assert "tracks/s1_phone" in export[0]
    assert "flame.npz" in export[0]
    assert "apply/s1/phone/flame.npz" in export[1]


def by_hand(tracker, neutral_m):
    """Landmarks at the vertices (V, 3) m that a person would choose: the tiny run's detector, trained on
    24 small images, is no measure of whether landmarks are found on a mesh."""
    face = tracker.face
    places = tracker.sample(face.neutral_mm)
    nearest = cKDTree(places).query(face.neutral_mm[face.landmarks])[1]
    return ScanLandmarks(1000.0 * neutral_m[nearest], np.zeros(len(nearest)))


@pytest.fixture(scope="module")
def corrected(finished, tmp_path_factory):
    """The finished tiny capture, run again with a simulated tracker's sequences as its base."""
    folder = tmp_path_factory.mktemp("external") / "project"
    shutil.copytree(finished.folder, folder, symlinks=True)
    project = Project(folder, finished.configuration)
    results, sheet = project.results, folder / "config/takes.external.tsv"
    studio = FaceModel.load(folder / "results/external/face_model/studio.npz")
    tracker, meshes = ForeignTracker.of(studio, 6000), {}
    rows = [line + "\t" for line in sheet.read_text().splitlines()]
    rows[0] += "of"
    for subject, take in TAKES:
        truth = folder / "truth" / subject / take
        cameras = read_cameras(results / "takes" / subject / take / "cameras")
        camera = cameras.get("face2") or next(iter(cameras.values()))
        meshes[subject, take], _, _ = tracker.track(
            np.load(truth / "vertices_mm.npy"), np.load(truth / "neutral_mm.npy"), camera,
            len(take), int(subject[1:]),
        )  # fmt: skip
        source = f"tracks/{subject}_{take}"
        write_objs(folder / source, meshes[subject, take], tracker.triangles, 0)
        rows.append(
            "\t".join([subject, f"{take}_ft", "tracked", source, "", "", "30", "none", take])
        )
    (folder / "tracks/s1_phone" / f"head.{LOST:04d}.obj").unlink()
    sheet.write_text("\n".join(rows) + "\n")
    write_scan_landmarks(folder / "tracks/landmarks.tsv", by_hand(tracker, meshes["s1", "rom"][0]))

    def wish(content):
        content["apply"].update(export={"formats": ["usd", "obj"]})
        base = {"landmarks": "tracks/landmarks.tsv"}
        content.setdefault("tracking", {})["external"] = {"base": base}

    project.edit_configuration(wish)
    wanted = ["results/external/apply/s1/phone/corrected.npy"]
    project.snakemake("--rerun-triggers", "mtime", "--forcerun", *ADDED, "--", *wanted)
    return project, tracker, meshes["s1", "phone"]


def test_a_shot_comes_out_on_its_own_topology_world_and_unit(corrected):
    project, tracker, meshes = corrected
    out = project.results / "apply/s1/phone"
    frames = [frame for frame in range(len(meshes)) if frame != LOST]
    model = FaceModel.load(project.results / "face_model/external.npz")
    correspondence = Correspondence.load(project.results / "subjects/s1/correspondence.npz")
    mask = np.zeros(model.n_vertices, dtype=bool)
    mask[model.triangles[correspondence.mask]] = True
    to_mask = cKDTree(model.neutral_mm[mask]).query(model.neutral_mm)[0]
    # Beyond the seam; what hangs on the lips inside the mouth goes with them.
    away = (to_mask > 25.0) & ~model.regions["mouth_inner"]  # mm
    lips = model.regions["vermilion_upper"] | model.regions["vermilion_lower"]
    assert away.sum() > 300 and lips.sum() > 100
    for file in ("obj", "corrected.usdc"):
        back = read_tracked(out / file, frames, 1000.0)
        assert np.array_equal(back.triangles, tracker.triangles)
        moved = np.linalg.norm(back.vertices_mm / 1000.0 - meshes[frames], axis=2)
        assert moved[:, away].max() < 1e-4, file  # metres; it is 1e-7
        assert moved[:, lips].max() > 5e-4, file


def test_the_frame_that_the_sequence_lost_is_named(corrected):
    project, _, _ = corrected
    rows = read_table(project.results / "takes/s1/phone/tracking/quality/000000-000007.tsv")
    assert rows["frame"][rows["valid"] == 0].tolist() == [LOST]
    assert "not in s1_phone; export this frame again" in rows["reason"][LOST]
    log = (project.results / "logs/external_fit/s1-phone.log").read_text()
    assert "world of the sequence: its own, found by the landmarks" in log
