"""Contour detectors of a take's illumination, trained on its labelled frames (Lips16 3.2.2)."""

from vermilion.config.contours import ContourDetectorConfig
from vermilion.contours.landmark_ridge import LandmarkRidgeDetector
from vermilion.contours.training import TrainingSettings, read_labelled, train_detector
from vermilion.frames import open_frames
from vermilion.landmarks.detector import LandmarkTrack
from vermilion.logfile import log_to


def main(snakemake) -> None:
    cfg = ContourDetectorConfig(**snakemake.params.cfg["contours.detector"])
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    source = open_frames(snakemake.params.source, **place)
    labelled = []
    if cfg.kind != "landmarks":
        labelled = read_labelled(
            snakemake.params.capture,
            snakemake.params.camera,
            source,
            LandmarkTrack.load(snakemake.input.landmarks),
            required=cfg.kind == "boosted",
            **place,
        )
    if labelled:
        detector = train_detector(labelled, TrainingSettings.of(cfg), cfg.seed)
    else:
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
