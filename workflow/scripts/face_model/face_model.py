"""The configured face model as studio, template and tracker."""

from vermilion.faces.build import FaceModelSettings, build_models
from vermilion.provenance.begun_run import begin_job

if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    cfg = snakemake.params.cfg["face_model"]
    source = snakemake.input.get("source")
    settings = FaceModelSettings.of(cfg)
    source = source[0] if isinstance(source, list) and source else source
    models = build_models(cfg["name"], source, cfg["sha256"], settings)
    for part, model in models.items():
        model.save(snakemake.output[part])
        print(f"{part}: {model.n_vertices} vertices, {model.n_expressions} expressions")
