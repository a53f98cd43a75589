"""All faces in a chunk of the monocular images, and what these images look like."""

from vermilion.imaging.frames import open_frames
from vermilion.landmarks.choose import face_finder
from vermilion.landmarks.faces import find_faces
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cfg, params = snakemake.params.cfg, snakemake.params
    source = open_frames(params.source, snakemake.wildcards.subject, snakemake.wildcards.take)
    find, landmark_set = face_finder(
        cfg["landmarks.detector"],
        params.model,
        cfg["landmarks.networks"],
        cfg["landmarks.files"],
        str(snakemake.input.files),
    )
    finds = find_faces(
        lambda frame: source.read(params.camera, frame), find, params.frames, landmark_set
    )
    finds.save(snakemake.output.faces)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
