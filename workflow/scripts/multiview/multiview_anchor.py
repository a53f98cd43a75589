"""The anchor frame near a border between two clips, registered to the neutral."""

import cv2

from vermilion.config.multiview import ImageConfig, TrackConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.imaging.frames import open_frames
from vermilion.multiview.anchors import TrackSettings, find_anchor
from vermilion.multiview.files import read_neutral, write_anchor
from vermilion.multiview.photometric import FlowMatcher
from vermilion.multiview.take import ImageSettings, MultiviewImages, open_coarse
from vermilion.storage.logfile import log_to


def main(snakemake):
    cv2.setNumThreads(1)
    cfg, params = snakemake.params.cfg, snakemake.params
    image_settings = ImageSettings(**ImageConfig(**cfg["multiview.images"]).model_dump())
    track = TrackConfig(**cfg["multiview.track"]).model_dump(exclude={"clip_frames"})
    scale = track.pop("scale")
    model = FaceModel.load(snakemake.input.template)
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    images = MultiviewImages(source, read_cameras(snakemake.input.cameras), image_settings)
    neutral = read_neutral(snakemake.input.neutral, model.n_vertices)
    reference, load = open_coarse(images, params.neutral, neutral, model.triangles, scale)
    anchor = find_anchor(reference, params.window, load, FlowMatcher(), TrackSettings(**track))
    if anchor.frame < 0:
        print(f"no frame of {params.window} is like the neutral: the clips before and after join")
    else:
        print(f"anchor frame {anchor.frame} of {params.window}")
    write_anchor(snakemake.output.anchor, anchor)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
