"""The cuts of a take, and the face that is followed through it."""

from vermilion.landmarks.faces import SeenFaces
from vermilion.landmarks.following import FaceChoice, follow_face
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.tables import write_table


def main(snakemake):
    params, following = snakemake.params, snakemake.params.cfg["landmarks.following"]
    choice = FaceChoice.of(params.face, following["least_eyes_px"], following["person_difference"])
    followed = follow_face(SeenFaces.load(snakemake.input.faces), choice, params.one_shot)
    for sentence in followed.sentences():
        print(sentence)
    write_table(snakemake.output.table, followed.table())
    followed.save(snakemake.output.followed)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
