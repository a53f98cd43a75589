"""The whole corrected take: sequence, mesh, weights, overlay, and files for other programs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.appearance.estimate import Appearance
from vermilion.config.apply import ExportConfig
from vermilion.export.albedo_texture import albedo_texture
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.full_topology import FullFace, shapes_on_coarse
from vermilion.export.live_link import write_live_link
from vermilion.export.objs import write_obj
from vermilion.export.overlay import join_videos
from vermilion.export.own_frame import in_own_frame
from vermilion.export.packages import write_packages
from vermilion.export.plates import write_plates
from vermilion.export.rig import read_rig, solve_rig
from vermilion.export.shape_basis import shape_basis
from vermilion.export.timeline import draw_timeline
from vermilion.export.weights import write_weights
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.geometry.polygons import Polygons
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.undistortion import straight_camera
from vermilion.storage.files import atomic_path
from vermilion.storage.logfile import log_to
from vermilion.storage.progress import progress
from vermilion.storage.sequences import read_sequence, write_sequence
from vermilion.storage.tables import read_table
from vermilion.tracking.image_fit.overlay import samples_to_vertices
from vermilion.tracking.result import Identity, TrackedTake


def coarse_animation(corrected, face, fit, identity, fps, unit_mm):
    """The corrected sequence with the named shapes and weights of its track."""
    head = HeadFrame(fit.world_from_head_rotation, fit.world_from_head_translation_mm)
    shapes = NamedShapes(face.expression_names, face.expressions_mm, fit.weights)
    neutral = identity.neutral_mm
    if face.n_expressions != fit.weights.shape[1] or len(neutral) != face.n_vertices:
        # A sequence of another topology than the track's: its mean is its neutral.
        shapes = NamedShapes((), np.zeros((0, face.n_vertices, 3)), np.zeros((len(fit.frames), 0)))
        rows = [row for row in range(len(corrected)) if np.isfinite(corrected[row]).all()]
        neutral = np.mean([head.to_head(row, np.float64(corrected[row])) for row in rows], axis=0)
    return Animation(
        fit.frames, fps, corrected, Polygons.of_triangles(face.triangles), neutral, head, shapes,
        unit_mm, face.uv, fit.camera,
    )  # fmt: skip


def on_full_face(out, animation, face, studio, identity):
    """The animation on the full model, frame by frame through `full.npy`; and its `FullFace`."""
    full = FullFace.of(studio, face, animation.neutral_mm, identity.identity, animation.shapes)
    shape = (len(animation.frames), len(full.neutral_mm), 3)
    with atomic_path(out) as temporary:
        table = np.lib.format.open_memmap(temporary, "w+", np.float32, shape)
        for row in progress(range(len(table)), "full face"):
            table[row] = full.vertices_mm(animation, row)
        table.flush()
    return full.animation(animation, read_sequence(out)), full


def vertex_colours(path, face):
    """Albedo (V, 3) of the vertices of the track's mesh, linear."""
    found = Appearance.load(path)
    seen = np.minimum(found.seen, 1.0)
    return samples_to_vertices(
        found.albedo[0], seen, found.samples, face.triangles, face.n_vertices
    )


def write_albedo(path, colours, animation, full):
    """The texture of the animation's mesh; of the full face where there is one."""
    if full is not None:
        mean, reach = colours.mean(axis=0), np.asarray(full.carry.sum(axis=1))
        colours = full.carry @ colours + (1 - reach) * mean
    write_srgb8(path, albedo_texture(colours, animation.uv, animation.polygons.triangles))


def add_images(snakemake, animation, face, full, options):
    """The animation with its texture and plates, which are written."""
    inputs, out = snakemake.input, snakemake.output
    if inputs.get("appearance"):
        write_albedo(out.albedo, vertex_colours(inputs.appearance, face), animation, full)
        animation = replace(animation, albedo=Path(out.albedo).name)
    if options.plate:
        place = (snakemake.wildcards.subject, snakemake.wildcards.take)
        source = open_frames(snakemake.params.source, *place)
        camera = animation.camera
        write_plates(
            out.plate, animation.frames, camera,
            lambda frame: to_display(source.read(camera.name, frame)),
        )  # fmt: skip
        animation = replace(
            animation, camera=straight_camera(camera, square=True),
            plate=Path(out.plate).name + "/{frame:06d}.jpg",
        )  # fmt: skip
    return animation


def write_rigs(snakemake, options, coarse, animation, face):
    """ARKit's weights of the corrected face, and those of the user's rig with its corrective."""
    inputs, out, fps = snakemake.input, snakemake.output, snakemake.params.fps
    if options.live_link:
        shapes = shapes_on_coarse(FaceModel.load(inputs.studio), face)
        found = solve_rig(coarse, shapes, lips_of(face))
        print(f"ARKit: {found.left_mm.mean():.3f} mm off over the lips")
        rotation = coarse.head.rotation[coarse.rows]
        write_live_link(
            out.live_link, found.frames, fps, shapes.names, found.shapes.weights, rotation
        )
    if options.rig:
        model = FaceModel.load(inputs.studio) if options.topology == "full" else face
        rig = read_rig(inputs.rig, model.n_vertices)
        found = solve_rig(animation, rig, lips_of(model))
        print(
            f"rig: {found.left_mm.mean():.3f} mm off over the lips, {found.corrected_mm.mean():.3f} mm "
            "with the corrective"
        )
        names = [*rig.names, "corrective"]
        weights = np.column_stack([found.shapes.weights, found.corrective])
        write_weights(out.rig, found.frames, fps, names, weights, np.ones(len(weights), bool))
        shown = (animation.neutral_mm + found.corrective_mm) / options.unit_mm
        write_obj(out.corrective, shown, animation.polygons, animation.uv)


def lips_of(model):
    """Vertices (V,) of the vermilion."""
    return model.regions["vermilion_upper"] | model.regions["vermilion_lower"]


def main(snakemake):
    inputs, out, fps = snakemake.input, snakemake.output, snakemake.params.fps
    options = ExportConfig(**snakemake.params.cfg["apply.export"])
    face, fit = FaceModel.load(inputs.tracker), TrackedTake.load(inputs.fit)
    identity = Identity.load(inputs.identity)
    write_sequence(out.corrected, read_sequence(inputs.corrected))
    corrected = read_sequence(out.corrected)
    write_ply(out.mesh, Mesh(np.asarray(corrected[0], dtype=np.float64), face.triangles))
    write_weights(out.weights, fit.frames, fps, fit.expression_names, fit.weights, fit.valid)
    join_videos(out.overlay, inputs.overlays)
    quality = pd.concat([read_table(path) for path in inputs.quality], ignore_index=True)
    title = f"{snakemake.wildcards.subject}/{snakemake.wildcards.take}"
    draw_timeline(quality, title, out.timeline)

    coarse = coarse_animation(corrected, face, fit, identity, fps, options.unit_mm)
    animation, full = coarse, None
    if options.topology == "full":
        studio = FaceModel.load(inputs.studio)
        animation, full = on_full_face(out.full, coarse, face, studio, identity)
    write_rigs(snakemake, options, coarse, animation, face)
    animation = add_images(snakemake, animation, face, full, options)

    def basis():
        found = shape_basis(coarse, options.tolerance_mm)
        return found if full is None else full.basis(found)

    if inputs.get("placement"):
        animation = coarse = in_own_frame(
            animation, Placement.load(inputs.placement), Origin.load(inputs.origin)
        )
    write_packages({name: out[name] for name in options.formats}, animation, basis)


if __name__ == "__main__":
    log_to(snakemake.log[0])
    main(snakemake)
