"""Paint the tattoo over in every frame of a chunk, in the frontal camera (Lips16 3.2.1)."""

import numpy as np

from vermilion.config.inpaint import CompositeConfig, DomainConfig, OpeningConfig, ShadingConfig
from vermilion.faces.model import FaceModel
from vermilion.geometry.camera import read_cameras
from vermilion.imaging.draw import sheet, to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.inpaint.domain import lip_domain
from vermilion.inpaint.files import read_texture
from vermilion.inpaint.frame import InpaintInputs, inpaint_frame
from vermilion.inpaint.grain import noise_seed
from vermilion.inpaint.opening import OpeningSettings
from vermilion.inpaint.overlay import before_after
from vermilion.inpaint.shading import ShadingSettings
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.errors import InputError
from vermilion.storage.files import atomic_folder
from vermilion.storage.frames import evenly_taken
from vermilion.storage.progress import progress
from vermilion.storage.quality import QualityRow, write_quality
from vermilion.storage.sequences import read_sequence


def take_inputs(snakemake, model, place):
    """What does not change from frame to frame."""
    cfg = DomainConfig(**snakemake.params.cfg["inpaint.domain"])
    how = CompositeConfig(**snakemake.params.cfg["inpaint.composite"]).model_dump()
    shading = ShadingConfig(**snakemake.params.cfg["inpaint.shading"]).model_dump()
    opening = OpeningConfig(**snakemake.params.cfg["inpaint.opening"]).model_dump()
    domain = lip_domain(model, cfg.skin_mm, cfg.inner_mm, cfg.texel_mm)
    plain, _ = read_texture(snakemake.input.plain, domain, **place)
    reference, more = read_texture(snakemake.input.reference, domain, **place)
    seed = how.pop("seed")
    inputs = InpaintInputs(
        domain, plain, reference, more["opacity"],
        gap_mm=shading.pop("gap_mm"), shading=ShadingSettings(**shading),
        edge_mm=cfg.edge_mm, opening=OpeningSettings(**opening), **how,
    )  # fmt: skip
    return inputs, seed


def main(snakemake):
    place = {"subject": snakemake.wildcards.subject, "take": snakemake.wildcards.take}
    name = snakemake.params.cfg["capture.frontal_camera"]
    model = FaceModel.load(snakemake.input.template)
    inputs, seed = take_inputs(snakemake, model, place)
    camera = read_cameras(snakemake.input.cameras)[name]
    source = open_frames(snakemake.params.source, **place)
    meshes = read_sequence(snakemake.input.meshes)
    frames, rows, tiles = snakemake.params.frames, [], []
    shown = evenly_taken(frames, 8)
    with atomic_folder(snakemake.output.frames) as folder:
        for index, frame in enumerate(progress(frames, "inpaint {subject}/{take}".format(**place))):
            try:
                linear = source.read(name, frame)
            except InputError as error:
                rows.append(QualityRow(frame, False, f"the image cannot be read: {error}"))
                continue
            vertices = np.asarray(meshes[index], dtype=np.float64)
            painted = None
            if np.isfinite(vertices).all():
                noise = noise_seed(seed, **place, frame=frame)
                painted = inpaint_frame(inputs, linear, camera, vertices, model.triangles, noise)
            if painted is None:
                rows.append(QualityRow(frame, False, "no mesh in the image"))
                continue
            after = to_display(painted.linear)
            write_srgb8(folder / f"{frame:06d}.png", after)
            figures = {
                "composited_px": painted.composited_px,
                "border_levels8": painted.border_levels,
            }
            rows.append(QualityRow(frame, figures=figures))
            if frame in shown:
                before = np.rint(painted.before * 255).astype(np.uint8)
                tiles.append(before_after(frame, before, after[painted.window.slices]))
    write_srgb8(snakemake.output.overlay, sheet(tiles, 4))
    write_quality(snakemake.output.quality, **place, stage="inpaint", rows=rows)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
