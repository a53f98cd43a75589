"""Every flagged frame of every stage, with the reason."""

from vermilion.storage.logfile import log_to
from vermilion.storage.quality import flagged_frames
from vermilion.storage.tables import write_table


def main(snakemake):
    flagged = flagged_frames(snakemake.input.tables)
    write_table(snakemake.output.flagged, flagged)
    print(flagged.to_string())


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
