"""The anchor frame near a border between two clips, registered to the neutral."""

import cv2

from vermilion.faces.model import FaceModel
from vermilion.multiview.anchors import TrackSettings, find_anchor
from vermilion.multiview.files import read_neutral, write_anchor
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.take import MultiviewImages, open_coarse
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, params, inputs = snakemake.params.cfg, snakemake.params, snakemake.input
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    track = {k: v for k, v in cfg["multiview.track"].items() if k != "clip_frames"}
    scale = track.pop("scale")
    model = FaceModel.load(inputs.template)
    images = MultiviewImages.open(params.source, inputs.cameras, cfg["multiview.images"], *place)
    neutral = read_neutral(inputs.neutral, model.n_vertices)
    reference, load = open_coarse(images, params.neutral, neutral, model.triangles, scale)
    anchor = find_anchor(reference, params.window, load, FlowMatcher(), TrackSettings(**track))
    if anchor.frame < 0:
        print(f"no frame of {params.window} is like the neutral: the clips before and after join")
    else:
        print(f"anchor frame {anchor.frame} of {params.window}")
    write_anchor(snakemake.output.anchor, anchor)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
