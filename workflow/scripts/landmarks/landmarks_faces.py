"""All faces in a chunk of the monocular images, and what these images look like."""

from vermilion.imaging.frames import open_frames
from vermilion.landmarks.choose import open_detector
from vermilion.landmarks.faces import find_faces
from vermilion.landmarks.table import GivenLandmarks
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cfg, params = snakemake.params.cfg, snakemake.params
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    if cfg["landmarks.detector"] == "files":
        given = {**cfg["landmarks.files"], "path": snakemake.input.files}
        table = GivenLandmarks(**given).read()
        landmark_set = table.landmark_set

        def find(frame, image):
            found = table.at(frame)
            return [found] if found.found else []

    else:
        kind, networks = cfg["landmarks.detector"], cfg["landmarks.networks"]
        detector = open_detector(kind, params.model, networks)
        landmark_set = detector.landmark_set

        def find(frame, image):
            return [] if image is None else detector.faces(image)

    finds = find_faces(
        lambda frame: source.read(params.camera, frame), find, params.frames, landmark_set
    )
    finds.save(snakemake.output.faces)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
