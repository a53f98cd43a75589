"""The tattooed neutral of a take: its look in the frontal camera, and what is to be painted."""

from vermilion.config.inpaint import DomainConfig, MaskConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import write_srgb8
from vermilion.inpaint.bake import blend, view_texels
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.files import read_texture, write_texture
from vermilion.inpaint.overlay import texture_sheet
from vermilion.inpaint.tattoo import feather_mask, tattoo_mask
from vermilion.inpaint.views import read_camera_images
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cfg = DomainConfig(**snakemake.params.cfg["inpaint.domain"])
    look = MaskConfig(**snakemake.params.cfg["inpaint.mask"])
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    model = FaceModel.load(snakemake.input.template)
    domain = lip_domain(model, cfg.skin_mm, cfg.inner_mm, cfg.texel_mm)
    plain, _ = read_texture(snakemake.input.plain, domain, **place)
    params, frontal = snakemake.params, snakemake.params.cfg["capture.frontal_camera"]
    views = read_camera_images(
        params.source, snakemake.input.cameras, frontal, params.neutral, **place
    )
    neutral = read_neutral(snakemake.input.neutral, model.n_vertices, **place)
    caster = RayCaster(neutral, model.triangles)
    seen = view_texels(domain, caster, neutral, views, cfg.edge_mm)
    tattooed, reference = blend(domain, seen), blend(domain, seen[:1])
    mask = tattoo_mask(domain, tattooed, plain, look.reach_mm, look.sensitivity, look.closing_mm)
    opacity = feather_mask(domain, mask, look.border_mm, look.feather_mm)
    print(f"painted: {(opacity > 0.5).sum() * cfg.texel_mm**2:.0f} mm2")
    write_texture(snakemake.output.reference, reference, {"opacity": opacity})
    write_srgb8(snakemake.output.overlay, texture_sheet(plain, tattooed, opacity))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
