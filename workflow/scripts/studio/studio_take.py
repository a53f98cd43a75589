"""Pictures of a chunk of a synthetic take."""

from pathlib import Path

from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.storage.logfile import log_to
from vermilion.studio.capture_writer import write_pictures
from vermilion.studio.take import plan_of

if __name__ == "__main__":
    log_to(snakemake.log[0])
    cfg = snakemake.params.cfg
    plan = plan_of(FaceModel.load(snakemake.input.model), **cfg["plan"])
    folder = Path(snakemake.input.cameras[0]).parent
    pictures = cfg["pictures"]
    write_pictures(
        plan,
        read_cameras(folder),
        folder.parent,
        cfg["frames"],
        cfg["plan"]["first"],
        name=cfg["name"],
        seed=cfg["plan"]["seed"],
        noise_read=pictures["noise_read"],
        noise_shot=pictures["noise_shot"],
        n_directions=pictures["occlusion_directions"],
        n_points=pictures["light_samples"],
        edge_samples=pictures["edge_samples"],
    )
