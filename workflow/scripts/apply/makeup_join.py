"""The make-up of a whole take as one video, and one image of it."""

import shutil

from vermilion.export.overlay import join_videos
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.files import atomic_path


def main(snakemake):
    join_videos(snakemake.output.video, snakemake.input.videos)
    with atomic_path(snakemake.output.image) as temporary:
        shutil.copyfile(snakemake.input.images[0], temporary)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
