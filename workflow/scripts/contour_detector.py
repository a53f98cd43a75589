"""Contour detectors of a take: trained on its labelled frames, or learnt along its tracked lips."""

import numpy as np

from vermilion.config.contours import ContourDetectorConfig
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.maps import evenly
from vermilion.contours.track_ridge import TrackRidgeDetector, learn_from_take
from vermilion.contours.training import TrainingSettings, read_labelled, train_detector
from vermilion.faces.model import FaceModel
from vermilion.features.tracked_lips import TrackedLips
from vermilion.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.logfile import log_to
from vermilion.sequences import locate, read_sequence
from vermilion.tracking.result import TrackedTake


def from_track(snakemake, cfg, source, track):
    """The detector that a take's own pictures and track tell; None where no frame serves."""
    options, inputs = cfg.track, snakemake.input
    fit = TrackedTake.load(inputs.fit)
    lips = TrackedLips.of(FaceModel.load(inputs.tracker))
    seen = track.frames[track.valid & np.isin(track.frames, fit.frames[fit.valid])]
    frames = sorted(evenly(seen.tolist(), options.frames))
    meshes = locate(inputs.coarse, frames)
    landmarks = dict(zip(track.frames.tolist(), track.points_px, strict=True))
    detector = TrackRidgeDetector(
        cfg.interocular_size_px,
        cfg.margin,
        cfg.ridge_width,
        options.inner_reach,
        cfg.edge_weight,
        cfg.stiffness,
        options.frame_reach,
        options.lip_reach,
    )

    def lips_px(frame: int) -> tuple[np.ndarray, np.ndarray]:
        path, row = meshes[frame]
        return lips.rings_px(read_sequence(path)[row], fit.camera)

    return learn_from_take(
        detector,
        frames,
        lambda frame: source.read(snakemake.params.camera, frame),
        landmarks.__getitem__,
        lips_px,
        options.reach,
    )


def main(snakemake) -> None:
    cfg = ContourDetectorConfig(**snakemake.params.cfg["contours.detector"])
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    source = open_frames(snakemake.params.source, **place)
    track = LandmarkTrack.load(snakemake.input.landmarks)
    labelled, detector = [], None
    if cfg.kind in ("auto", "boosted"):
        labelled = read_labelled(
            snakemake.params.capture,
            snakemake.params.camera,
            source,
            track,
            required=cfg.kind == "boosted",
            **place,
        )
    # The track comes with the job of a take that nobody labelled: labels of which none serves
    # leave the landmarks.
    tracked = cfg.kind != "landmarks" and snakemake.input.get("fit")
    if labelled:
        detector = train_detector(labelled, TrainingSettings.of(cfg), cfg.seed)
    elif tracked:
        detector = from_track(snakemake, cfg, source, track)
    if detector is None:
        detector = LandmarkRidgeDetector(
            cfg.interocular_size_px,
            cfg.margin,
            cfg.ridge_width,
            cfg.ridge_reach,
            cfg.edge_weight,
            cfg.stiffness,
        )
    detector.save(snakemake.output.detector)
    print(f"{type(detector).__name__} from {len(labelled)} labelled frames")


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
