"""The whole corrected take: sequence, mesh, weights, USD, OBJ on request, overlay video."""

from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.config.apply import ExportConfig
from vermilion.export.objs import write_obj
from vermilion.export.overlay import join_videos
from vermilion.export.timeline import draw_timeline
from vermilion.export.usd import write_usd
from vermilion.export.weights import write_weights
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.storage.files import atomic_folder
from vermilion.storage.logfile import log_to
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    inputs, out, fps = snakemake.input, snakemake.output, snakemake.params.fps
    options = ExportConfig(**snakemake.params.cfg["apply.export"])
    tracker, fit = FaceModel.load(inputs.tracker), TrackedTake.load(inputs.fit)
    corrected = read_sequence(inputs.corrected)
    write_sequence(out.corrected, corrected)
    write_ply(out.mesh, Mesh(np.asarray(corrected[0], dtype=np.float64), tracker.triangles))
    write_weights(out.weights, fit.frames, fps, fit.expression_names, fit.weights, fit.valid)
    join_videos(out.overlay, inputs.overlays)
    quality = pd.concat([read_table(path) for path in inputs.quality], ignore_index=True)
    title = f"{snakemake.wildcards.subject}/{snakemake.wildcards.take}"
    draw_timeline(quality, title, out.timeline)
    if options.usd:
        write_usd(out.usd, fit.frames, corrected, tracker.triangles, fps, fit.camera, tracker.uv)
    if options.obj:
        with atomic_folder(out.obj) as folder:
            pairs = list(zip(fit.frames, corrected, strict=True))
            for frame, vertices in progress(pairs, "OBJ"):
                path = Path(folder) / f"{int(frame):06d}.obj"
                write_obj(path, vertices, tracker.triangles, tracker.uv)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
