"""The make-up of a whole take as one video, and one image of it."""

import shutil

from vermilion.export.overlay import join_videos
from vermilion.storage.files import atomic_path
from vermilion.storage.logfile import log_to


def main(snakemake):
    join_videos(snakemake.output.video, snakemake.input.videos)
    with atomic_path(snakemake.output.image) as temporary:
        shutil.copyfile(snakemake.input.images[0], temporary)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
