"""The neutral's mesh tracked coarsely through a take, from anchor frames."""

from functools import lru_cache

import cv2
import numpy as np

from vermilion.camera import read_cameras
from vermilion.config.multiview import ImageConfig, TrackConfig
from vermilion.faces.model import FaceModel
from vermilion.frames import open_frames
from vermilion.logfile import log_to
from vermilion.mesh import Mesh
from vermilion.multiview.files import read_neutral, write_track
from vermilion.multiview.motion import Reference
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.take import ImageSettings, Pictures
from vermilion.multiview.track import TrackSettings, track_take
from vermilion.sequences import write_ply

#: Frames whose small pictures are kept in memory, about 3 MB each for ten cameras.
KEPT_FRAMES = 300


def main(snakemake):
    cv2.setNumThreads(1)
    cfg = snakemake.params.cfg
    images = ImageSettings(**ImageConfig(**cfg["multiview.images"]).model_dump())
    track = TrackConfig(**cfg["multiview.track"]).model_dump()
    scale = track.pop("scale")
    model = FaceModel.load(snakemake.input.template)
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    source = open_frames(snakemake.params.source, subject, take)
    pictures = Pictures(source, read_cameras(snakemake.input.cameras), images)
    neutral = read_neutral(snakemake.input.neutral, model.n_vertices)
    first, last = snakemake.params.frames

    @lru_cache(maxsize=KEPT_FRAMES)
    def load(number):
        return pictures.load(number, scale)

    reference = Reference.of(load(first), neutral, model.triangles)
    found = track_take(
        reference, range(first, last + 1), load, FlowMatcher(), TrackSettings(**track)
    )
    print(f"anchor frames: {found.frames[found.anchors].tolist()}")
    print(f"unreadable frames: {np.count_nonzero([r != '' for r in found.reasons])}")
    write_track(snakemake.output.track, found)
    write_ply(snakemake.output.topology, Mesh(neutral, model.triangles))


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
