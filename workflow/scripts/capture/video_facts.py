"""Hash a video file and list its frames, once a take."""

from vermilion.capture.video_facts import video_facts
from vermilion.storage.logfile import log_to


def main(snakemake):
    video_facts(snakemake.input[0]).save(snakemake.output[0])


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
