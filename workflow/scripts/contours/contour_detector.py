"""Contour detectors of a take: trained on its labelled frames, or learnt along its tracked lips."""

import numpy as np

from vermilion.config.contours import ContourDetectorConfig
from vermilion.contours.labelled_frames import offset_rows, read_labelled
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.landmark_rings import LandmarkRings, dense_lips
from vermilion.contours.take_detector import detector_from_rings
from vermilion.contours.training import ContourTrainingSettings, train_detector
from vermilion.faces.model import FaceModel
from vermilion.features.tracked_lips import TrackedLips
from vermilion.imaging.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.quality import write_quality
from vermilion.storage.sequences import read_sequence, rows_of_frames
from vermilion.tracking.result import TrackedTake


class TrackedRings:
    """The tracked lips of a take in its images."""

    def __init__(self, inputs, landmarks: LandmarkTrack):
        self.fit = TrackedTake.load(inputs.fit)
        self.lips = TrackedLips.of(FaceModel.load(inputs.tracker))
        self.coarse = inputs.coarse
        served = landmarks.valid & np.isin(landmarks.frames, self.fit.frames[self.fit.valid])
        self.frames = landmarks.frames[served].tolist()

    def __call__(self, frame: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Outer and inner ring (n, 2) px of a frame; None where it is not tracked."""
        if frame not in self.frames:
            return None
        ((path, row),) = rows_of_frames(self.coarse, [frame]).values()
        return self.lips.rings_px(read_sequence(path)[row], self.fit.camera)


def main(snakemake) -> None:
    cfg = ContourDetectorConfig(**snakemake.params.cfg["contours.detector"])
    subject, take = snakemake.wildcards.subject, snakemake.wildcards.take
    place, camera = {"subject": subject, "take": take}, snakemake.params.camera
    source = open_frames(snakemake.params.source, **place)
    found = LandmarkTrack.load(snakemake.input.landmarks, None)
    track, dense = found.as_ibug66(), dense_lips(found)
    labelled, rows, by_track = [], [], None
    if cfg.kind in ("auto", "boosted"):
        labelled, rows = read_labelled(
            snakemake.params.capture,
            camera,
            source,
            track,
            required=cfg.kind == "boosted",
            **place,
        )
    if cfg.kind in ("auto", "track"):
        rings = LandmarkRings(found) if dense else TrackedRings(snakemake.input, track)
        own, around, seen = rings.frames, [], found
        if snakemake.input.around:
            beyond = LandmarkTrack.load(snakemake.input.around, None)
            around = beyond.frames[beyond.valid].tolist()
            seen = LandmarkTrack.load([*snakemake.input.landmarks, snakemake.input.around], None)
            rings = LandmarkRings(seen)
        by_track = detector_from_rings(
            cfg, lambda frame: source.read(camera, frame), seen, rings, own, dense, around
        )
    if labelled and by_track:
        rows += offset_rows(labelled, by_track, rings)
    if labelled:
        detector = train_detector(labelled, ContourTrainingSettings.of(cfg), cfg.seed)
    else:
        reach, shade = (cfg.lips_reach, cfg.lips_shade) if dense else (cfg.ridge_reach, 0.0)
        detector = by_track or LandmarkRidgeDetector.of(cfg, reach, lips_shade=shade)
    detector.save(snakemake.output.detector)
    rows.sort(key=lambda row: row.frame)
    write_quality(snakemake.output.quality, subject, take, "contour labels", rows)
    print(f"{type(detector).__name__} from {len(labelled)} labelled frames")
    for reason in sorted({row.reason for row in rows if row.reason}):
        print(reason)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
