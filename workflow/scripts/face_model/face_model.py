"""The configured face model as studio, template and tracker."""

from vermilion.faces.build import build_models
from vermilion.storage.logfile import log_to

if __name__ == "__main__":
    log_to(snakemake.log[0])
    cfg = snakemake.params.cfg["face_model"]
    source = snakemake.input.get("source")
    models = build_models(
        cfg["name"],
        source=source[0] if isinstance(source, list) and source else source,
        sha256=cfg["sha256"],
        slight_open=cfg["template_slight_open"],
        tracker_triangles=cfg["tracker_triangles"],
        studio_identities=cfg["studio_identities"],
        tracker_identities=cfg["tracker_identities"],
        studio_spacing_mm=cfg["studio_spacing_mm"],
        template_spacing_mm=cfg["template_spacing_mm"],
        seed=cfg["seed"],
    )
    for part, model in models.items():
        model.save(snakemake.output[part])
        print(f"{part}: {model.n_vertices} vertices, {model.n_expressions} expressions")
