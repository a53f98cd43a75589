"""Images of a chunk of a synthetic take."""

from pathlib import Path

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.provenance.begun_run import begin_job
from vermilion.studio.capture_writer import write_images
from vermilion.studio.take import plan_take
from vermilion.studio.take_settings import take_settings

if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    cfg = snakemake.params.cfg
    plan = plan_take(FaceModel.load(snakemake.input.model), take_settings(cfg["plan"]))
    write_images(
        plan,
        read_cameras(Path(snakemake.input.cameras[0]).parent),
        snakemake.params.capture,
        cfg["frames"],
        cfg["plan"]["first"],
        name=cfg["name"],
        seed=cfg["plan"]["seed"],
        **cfg["images"],
    )
