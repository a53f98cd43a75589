"""Download of the pinned ICT-FaceKit archive."""

from vermilion.faces.ict_archive import download_archive
from vermilion.provenance.begun_run import begin_job

if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    cfg = snakemake.params.cfg
    download_archive(cfg["face_model.url"], cfg["face_model.sha256"], snakemake.output[0])
