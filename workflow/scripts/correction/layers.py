"""Correction layers of a chunk, with quality rows and an overlay."""

import numpy as np

from vermilion.config.correction import LayersConfig
from vermilion.correction.overlay import layers_overlay
from vermilion.correction.take_layers import quality_rows, save_layers, take_layers
from vermilion.correspondence.correspondence import Correspondence
from vermilion.faces.model import FaceModel
from vermilion.imaging.images import write_srgb8
from vermilion.multiview.lost_frames import failed_frames
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.arrays import read_arrays
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence
from vermilion.tracking.result import TrackedTake


def main(snakemake):
    inputs, output, frames = snakemake.input, snakemake.output, snakemake.params.frames
    cfg = LayersConfig(**snakemake.params.cfg["correction.layers"])
    correspondence, fit = Correspondence.load(inputs.correspondence), TrackedTake.load(inputs.fit)
    rows = fit.index_of(frames)
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    neutral = read_arrays(inputs.accurate_neutral, "neutral", ("vertices_mm",), **place)
    neutral_mm = neutral["vertices_mm"].astype(np.float64)
    failed = failed_frames(
        [inputs.accurate_quality], inputs.drift, snakemake.params.cfg["multiview.lost"]
    )
    made = take_layers(
        correspondence,
        read_sequence(inputs.accurate),
        read_sequence(inputs.coarse),
        fit.world_from_head_rotation[rows],
        fit.world_from_head_translation_mm[rows],
        accurate_neutral_mm=neutral_mm if cfg.head == "neutral" else None,
        face=FaceModel.load(inputs.tracker).regions["face"] if cfg.region == "face" else None,
    )
    checked, quality = quality_rows(
        made,
        frames,
        tracked=fit.valid[rows],
        failed=failed,
        max_alignment_mm=cfg.max_alignment_mm,
    )
    write_srgb8(output.overlay, layers_overlay(correspondence, checked, frames))
    write_quality(output.quality, *place.values(), "correction", quality)
    save_layers(
        output.layers, checked, frames, correspondence.mask, correspondence.coarse_triangles
    )


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
