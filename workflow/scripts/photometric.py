"""Pose and expression of each frame of a chunk from its picture."""

from vermilion.arrays import write_arrays
from vermilion.faces.model import FaceModel
from vermilion.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.logfile import log_to
from vermilion.photometric.appearance import Appearance
from vermilion.photometric.frame_fit import FrameProblem
from vermilion.photometric.settings import photometric_settings
from vermilion.photometric.take import TakeStart, refine_frames
from vermilion.tracking.result import Identity, TrackedTake
from vermilion.tracking.settings import fit_settings


def main(snakemake):
    place = (snakemake.wildcards.subject, snakemake.wildcards.take)
    inputs, params, cfg = snakemake.input, snakemake.params, snakemake.params.cfg
    fit, appearance = TrackedTake.load(inputs.fit), Appearance.load(inputs.appearance)
    rows = fit.index_of(params.frames)
    start = TakeStart.of(
        FaceModel.load(inputs.tracker),
        Identity.load(inputs.identity),
        fit,
        LandmarkTrack.load(inputs.landmarks),
        fit_settings(cfg["tracking.fit"], cfg["tracking.motion"]),
        rows,
    )
    face, source = start.face(appearance.samples), open_frames(params.source, *place)
    settings = photometric_settings(cfg["refinement.fit"])
    problem = FrameProblem(face, appearance, settings, start.settings.weight_sigma)
    refined = refine_frames(
        start,
        fit.valid[rows],
        lambda index: source.read(fit.camera.name, int(params.frames[index])),
        problem,
        cfg["refinement.appearance"]["pixel_mm"],
    )
    write_arrays(snakemake.output[0], frames=fit.frames[rows], **refined)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
