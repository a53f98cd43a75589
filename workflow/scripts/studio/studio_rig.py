"""Cameras, labels and truth of a synthetic take."""

from pathlib import Path

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import write_cameras
from vermilion.provenance.begun_run import begin_job
from vermilion.studio.capture_writer import write_labels, write_truth
from vermilion.studio.rig import RigSettings
from vermilion.studio.take import cameras_of, plan_take
from vermilion.studio.take_settings import take_settings

if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    cfg = snakemake.params.cfg
    plan = plan_take(FaceModel.load(snakemake.input.model), take_settings(cfg["plan"]))
    cameras = cameras_of(plan, cfg["plan"]["role"], RigSettings(**cfg["cameras"]))
    write_cameras(Path(snakemake.output.cameras[0]).parent, cameras)
    write_labels(
        plan,
        cameras,
        snakemake.params.capture,
        cfg["plan"]["first"],
        cfg["contours"],
        cfg["landmarks"],
    )
    write_truth(plan, Path(snakemake.output.truth[0]).parent)
