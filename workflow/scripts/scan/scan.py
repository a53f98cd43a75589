"""The tracker's face model of one person from a scan, with its overlay and quality."""

from vermilion.config.tracking import ScanConfig
from vermilion.faces.model import FaceModel
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.choose import open_detector
from vermilion.provenance.begun_run import begin_job
from vermilion.scan.landmarks import find_landmarks, read_scan_landmarks, write_scan_landmarks
from vermilion.scan.overlay import scan_overlay
from vermilion.scan.personal import personal_model
from vermilion.scan.read import read_scan
from vermilion.storage.quality import write_quality


def main(snakemake):
    inputs, output, cfg = snakemake.input, snakemake.output, snakemake.params.cfg
    subject, options = snakemake.wildcards.subject, ScanConfig(**cfg["scan"])
    generic, scan = FaceModel.load(inputs.tracker), read_scan(inputs.scan, subject)
    if options.landmarks:
        landmarks = read_scan_landmarks(inputs.landmarks, subject)
    else:
        detector = open_detector(
            cfg["landmarks.detector"], snakemake.params.model, cfg["landmarks.networks"]
        )
        landmarks = find_landmarks(scan, detector, generic.neutral_mm[generic.landmarks], subject)
    write_scan_landmarks(output.landmarks, landmarks)
    made = personal_model(
        generic,
        scan,
        landmarks,
        unit_mm=options.unit_mm,
        least_opening=-cfg["face_model.template_slight_open"],
        closed_eyes=options.eyes == "closed",
        finest_mm=options.finest_mm,
        subject=subject,
    )
    row = made.quality()
    print(row.figures)
    write_srgb8(output.overlay, scan_overlay(made))
    write_quality(output.quality, subject, "scan", "scan", [row])
    made.model.save(output.tracker)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
