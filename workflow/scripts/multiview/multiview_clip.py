"""The frames between two anchors tracked forward and backward."""

import cv2
import numpy as np

from vermilion.faces.model import FaceModel
from vermilion.multiview.anchors import TrackSettings, clip_frames_of
from vermilion.multiview.files import read_anchor, read_neutral, write_clip
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.take import MultiviewImages, open_coarse
from vermilion.multiview.track import Clip, track_clip
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, params, inputs = snakemake.params.cfg, snakemake.params, snakemake.input
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    track = {k: v for k, v in cfg["multiview.track"].items() if k != "clip_frames"}
    scale = track.pop("scale")
    model = FaceModel.load(inputs.template)
    neutral = read_neutral(inputs.neutral, model.n_vertices)
    anchors = [read_anchor(path) for path in inputs.anchors]
    index, (first, last) = int(snakemake.wildcards.clip), params.frames
    frames, end = clip_frames_of(first, last, [anchor.frame for anchor in anchors], index)
    if not frames:
        print("no anchor of its own: the clip before goes on through it")
        nothing = Clip(np.zeros(0, dtype=np.int64), np.zeros((0, *neutral.shape)), ())
        write_clip(snakemake.output.clip, nothing)
        return
    images = MultiviewImages.open(params.source, inputs.cameras, cfg["multiview.images"], *place)
    reference, load = open_coarse(images, first, neutral, model.triangles, scale)
    start = anchors[index - 1].vertices_mm if index else neutral
    numbers, stop = list(frames), None
    if end is not None:
        numbers.append(anchors[end - 1].frame)
        stop = anchors[end - 1].vertices_mm
    found = track_clip(reference, numbers, load, start, stop, FlowMatcher(), TrackSettings(**track))
    print(f"frames {found.frames[0]} to {found.frames[-1]}")
    print(f"unreadable frames: {np.count_nonzero([reason != '' for reason in found.reasons])}")
    write_clip(snakemake.output.clip, found)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
