"""A person's own head as the mesh of exported files: our model laid over it, with an overlay."""

from vermilion.export.head_binding import bind_head, is_ours
from vermilion.export.head_file import read_head
from vermilion.export.head_overlay import head_overlay
from vermilion.faces.model import FaceModel
from vermilion.imaging.images import write_srgb8
from vermilion.landmarks.choose import open_detector
from vermilion.provenance.begun_run import begin_job
from vermilion.scan.landmarks import (
    ScanLandmarks,
    find_landmarks,
    read_scan_landmarks,
    write_scan_landmarks,
)


def landmarks_of(snakemake, generic, head, subject):
    """Landmarks on the head: of our own topology, given by hand, or detected in rendered views."""
    cfg, given = snakemake.params.cfg, snakemake.input.get("landmarks")
    if is_ours(generic, head):
        places = head.vertices[generic.landmarks]
        return ScanLandmarks(places, 0.0 * places[:, 0])
    if given:
        return read_scan_landmarks(given, subject)
    detector = open_detector(
        cfg["landmarks.detector"], snakemake.params.model, cfg["landmarks.networks"]
    )
    return find_landmarks(head.welded, detector, generic.neutral_mm[generic.landmarks], subject)


def main(snakemake):
    inputs, output, cfg = snakemake.input, snakemake.output, snakemake.params.cfg
    subject = snakemake.wildcards.subject
    generic, head = FaceModel.load(inputs.tracker), read_head(inputs.head, subject)
    landmarks = landmarks_of(snakemake, generic, head, subject)
    write_scan_landmarks(output.landmarks, landmarks)
    binding = bind_head(
        generic, head, landmarks,
        least_opening=-cfg["face_model.template_slight_open"], subject=subject, path=inputs.head,
    )  # fmt: skip
    print(binding.figures(generic.triangles))
    write_srgb8(output.overlay, head_overlay(generic, head, binding))
    binding.save(output.binding, output.labels)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
