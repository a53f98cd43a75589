"""Download of the pinned ICT-FaceKit archive."""

from vermilion.faces.ict_archive import download_archive
from vermilion.storage.logfile import log_to

if __name__ == "__main__":
    log_to(snakemake.log[0])
    cfg = snakemake.params.cfg
    download_archive(cfg["face_model.url"], cfg["face_model.sha256"], snakemake.output[0])
