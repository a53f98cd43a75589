"""Hash a video file and list its frames, once a take."""

from vermilion.capture.video_facts import video_facts
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    video_facts(snakemake.input[0]).save(snakemake.output[0])


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
