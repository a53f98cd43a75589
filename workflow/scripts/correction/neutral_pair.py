"""Coarse and accurate neutral of a take, one laid on the other, with the image of their layer."""

from vermilion.config.correction import LayersConfig
from vermilion.correction.neutral_pair import NeutralPair
from vermilion.correction.overlay import layers_overlay
from vermilion.correction.take_layers import quality_rows, take_layers
from vermilion.correspondence.correspondence import Correspondence
from vermilion.faces.model import FaceModel
from vermilion.imaging.images import write_srgb8
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.arrays import read_arrays
from vermilion.storage.chunks import read_chunks, read_frames
from vermilion.tracking.result import Identity, TrackedTake


def main(snakemake):
    inputs, frame = snakemake.input, snakemake.params.frame
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    cfg = LayersConfig(**snakemake.params.cfg["correction.layers"])
    correspondence, fit = Correspondence.load(inputs.correspondence), TrackedTake.load(inputs.fit)
    template, row = FaceModel.load(inputs.template), fit.index_of([frame])
    neutral = read_neutral(inputs.accurate, template.n_vertices, **place)
    made = take_layers(
        correspondence,
        neutral[None],
        read_frames(inputs.coarse, [frame]),
        fit.world_from_head_rotation[row],
        fit.world_from_head_translation_mm[row],
        accurate_neutral_mm=neutral if cfg.head == "neutral" else None,
        face=FaceModel.load(inputs.tracker).regions["face"] if cfg.region == "face" else None,
    )
    checked, (quality,) = quality_rows(
        made,
        [frame],
        tracked=fit.valid[row],
        max_alignment_mm=cfg.max_alignment_mm,
    )
    found = read_chunks(inputs.features, [frame], ["features", "valid"])
    names = read_arrays(inputs.features[0], "feature file", ("names",), **place)["names"]
    reason = quality.reason or ("" if found["valid"][0] else "no contour features")
    if reason:
        print(
            f"WARNING: {place['subject']}/{place['take']}, frame {frame}: found {reason}; expected a "
            "neutral. Regressors are not told of it. Look at the overlays of this frame, or mark another "
            "one in correction.neutral_frames."
        )
    pair = NeutralPair(
        **place,
        coarse_mm=made.coarse_mm[0],
        accurate_mm=made.accurate_mm[0],
        features=found["features"][0],
        feature_names=names,
        neutral_mm=Identity.load(inputs.identity).neutral_mm,
        reason=reason,
    )
    pair.save(snakemake.output.pair)
    write_srgb8(snakemake.output.overlay, layers_overlay(correspondence, checked, [frame]))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
