"""Every flagged frame of every stage, with the reason."""

from vermilion.logfile import log_to
from vermilion.quality import flagged_frames
from vermilion.tables import write_table

if __name__ == "__main__":
    log_to(snakemake.log[0])
    flagged = flagged_frames(snakemake.input)
    write_table(snakemake.output[0], flagged)
    print(flagged.to_string())
