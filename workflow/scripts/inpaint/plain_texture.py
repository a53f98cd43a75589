"""Bake the un-tattooed texture of a subject from all cameras of its `plain` take (Lips16 3.2.1)."""

from vermilion.config.inpaint import DomainConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import write_srgb8
from vermilion.inpaint.bake import bake
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.files import write_texture
from vermilion.inpaint.overlay import texture_sheet
from vermilion.inpaint.views import read_camera_images
from vermilion.multiview.files import read_neutral
from vermilion.provenance.begun_run import begin_job


def main(snakemake):
    cfg = DomainConfig(**snakemake.params.cfg["inpaint.domain"])
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.params.take}
    model = FaceModel.load(snakemake.input.template)
    domain = lip_domain(model, cfg.skin_mm, cfg.inner_mm, cfg.texel_mm)
    params, frontal = snakemake.params, snakemake.params.cfg["capture.frontal_camera"]
    views = read_camera_images(
        params.source, snakemake.input.cameras, frontal, params.neutral, **place
    )
    neutral = read_neutral(snakemake.input.neutral, model.n_vertices, **place)
    caster = RayCaster(neutral, model.triangles)
    texture = bake(domain, caster, neutral, views, cfg.edge_mm)
    print(
        f"{len(views)} views cover {texture.seen.sum() / domain.valid.sum():.0%} of the lips' patch"
    )
    write_texture(snakemake.output.texture, texture)
    write_srgb8(snakemake.output.overlay, texture_sheet(texture))


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
