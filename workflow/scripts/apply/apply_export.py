"""The whole corrected take: sequence, mesh, weights, overlay, and files for other programs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from vermilion.appearance.estimate import Appearance
from vermilion.config.apply import ExportConfig
from vermilion.export.albedo_texture import albedo_texture
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.flame import solve_flame
from vermilion.export.full_topology import FullFace, shapes_on_coarse
from vermilion.export.head_binding import HeadBinding
from vermilion.export.head_file import read_head
from vermilion.export.head_pose import corrected_pose
from vermilion.export.head_transfer import HeadTransfer
from vermilion.export.live_link import write_live_link
from vermilion.export.objs import write_obj
from vermilion.export.overlay import join_videos
from vermilion.export.own_frame import in_own_frame
from vermilion.export.packages import write_packages
from vermilion.export.plates import write_plates
from vermilion.export.rig import read_rig, solve_rig
from vermilion.export.shape_basis import shape_basis
from vermilion.export.static_correction import on_own_neutral
from vermilion.export.timeline import draw_timeline
from vermilion.export.weights import write_weights
from vermilion.external.flame import read_parameters
from vermilion.external.origin import Origin
from vermilion.external.placement import Placement
from vermilion.external.sequence import Request
from vermilion.faces.model import FaceModel
from vermilion.geometry.mesh import Mesh
from vermilion.geometry.mesh_files import write_ply
from vermilion.geometry.polygons import Polygons
from vermilion.imaging.draw import to_display
from vermilion.imaging.frames import open_frames
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.undistortion import straight_camera
from vermilion.provenance.begun_run import begin_job
from vermilion.storage.progress import progress
from vermilion.storage.sequences import (
    StreamedSequence,
    read_sequence,
    write_frames,
    write_sequence,
)
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
    animation = Animation(
        fit.frames, fps, corrected, Polygons.of_triangles(face.triangles), neutral, head, shapes,
        unit_mm, face.uv, fit.camera,
    )  # fmt: skip
    return replace(animation, head=corrected_pose(animation, face.regions["rigid"]))


def on_other_mesh(out, animation, other, name):
    """The animation on the full model or the user's head, frame by frame through a `.npy`."""
    shape = (len(animation.frames), len(other.neutral_mm), 3)
    rows = progress(range(shape[0]), name)
    write_frames(out, shape, (other.vertices_mm(animation, row) for row in rows))
    return other.animation(animation, StreamedSequence(out))


def on_head(inputs, out, animation, face, options):
    """The animation on the user's head, and its `HeadTransfer`."""
    head = HeadTransfer(
        read_head(inputs.head), HeadBinding.load(inputs.binding, inputs.labels), face,
        animation.neutral_mm, animation.shapes, options.head.shape,
    )  # fmt: skip
    print(f"a unit of {inputs.head} is {head.unit_mm:.4g} mm, the size of the tracked head")
    return on_other_mesh(out.on_head, animation, head, "head"), head


def vertex_colours(path, face):
    """Albedo (V, 3) of the vertices of the track's mesh, linear."""
    found = Appearance.load(path)
    seen = np.minimum(found.seen, 1.0)
    return samples_to_vertices(
        found.albedo[0], seen, found.samples, face.triangles, face.n_vertices
    )


def write_albedo(path, colours, animation, other):
    """The texture of the animation's mesh; of the full face or the user's head where there is one."""
    if other is not None:
        colours = other.carried(colours)
    cut = animation.cut_at_seams()
    write_srgb8(path, albedo_texture(colours[cut.source], cut.uv, cut.polygons.triangles))


def add_images(snakemake, animation, face, other, options):
    """The animation with its texture and plates, which are written."""
    inputs, out = snakemake.input, snakemake.output
    if inputs.get("appearance"):
        write_albedo(out.albedo, vertex_colours(inputs.appearance, face), animation, other)
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


def write_live_weights(snakemake, coarse, face, valid):
    """ARKit's weights of the corrected face, without what of its person the model does not show."""
    shapes = shapes_on_coarse(FaceModel.load(snakemake.input.studio), face)
    lips, neutral = lips_of(face), snakemake.params.neutral
    found = solve_rig(on_own_neutral(coarse, lips, valid, neutral), shapes, lips)
    print(f"ARKit: {found.left_mm.mean():.3f} mm off over the lips, on this person's own neutral")
    write_live_link(
        snakemake.output.live_link, found.frames, snakemake.params.fps, shapes.names, found.alone,
        coarse.head.rotation[coarse.rows],
    )  # fmt: skip


def write_rig(snakemake, options, animation, lips, valid, head):
    """Weights of the user's rig, with the shapes that it lacks: the person's, and the corrective."""
    inputs, out = snakemake.input, snakemake.output
    rig = read_rig(inputs.rig, len(animation.neutral_mm))
    if head is not None:  # the rig stands in the unit and frame of the head's file
        rig = replace(rig, shapes_mm=head.head_from_file.turn(rig.shapes_mm))
    own = on_own_neutral(animation, lips, valid, snakemake.params.neutral)
    found = solve_rig(own, rig, lips)
    static = np.linalg.norm(own.neutral_mm - animation.neutral_mm, axis=1)[lips].mean()
    print(
        f"rig: {found.left_mm.mean():.3f} mm off over the lips on this person's own neutral, which is {static:.3f} mm "
        f"from the tracked one; {found.corrected_mm.mean():.3f} mm with the corrective"
    )
    names, weights = [*rig.names, "person", "corrective"], found.shapes.weights
    table = np.column_stack([weights, np.ones(len(weights)), found.corrective])
    valid_rows = np.ones(len(table), bool)
    write_weights(out.rig, found.frames, snakemake.params.fps, names, table, valid_rows)
    shapes = {
        out.person: own.neutral_mm,
        out.corrective: animation.neutral_mm + found.corrective_mm,
    }
    for path, shown in shapes.items():
        shown = shown / options.unit_mm if head is None else head.head_from_file.undo(shown)
        write_obj(path, shown, animation.polygons, animation.uv, animation.uv_corners)


def write_flame(snakemake, coarse, face, placement, origin):
    """Jaw and expression of FLAME for the corrected lips, in the parameters of the base."""
    place = {name: snakemake.wildcards[name] for name in ("subject", "take")}
    path, model = Path(snakemake.input.parameters), Path(snakemake.input.flame_model)
    frames = [int(frame) for frame in coarse.frames]
    track = read_parameters(Request(path, frames, place=place, flame=model))
    own = in_own_frame(coarse, placement, origin)
    rigid, skin = face.regions["rigid"], face.regions["face"]
    found = solve_flame(own, track, lips_of(face), skin, rigid)
    found.take.save(snakemake.output.flame)
    kinds = ("jaw and expression alone", "the static offset", "offset and corrective")
    off = (found.alone_mm, found.offset_mm, found.corrected_mm)
    said = ", ".join(f"{x.mean():.3f} mm with {kind}" for x, kind in zip(off, kinds, strict=True))
    print(f"FLAME, {len(found.take.frames)} frames: off over the lips {said}")


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
    animation, other = coarse, None
    if options.topology == "full":
        studio = FaceModel.load(inputs.studio)
        other = FullFace.of(studio, face, coarse.neutral_mm, identity.identity, coarse.shapes)
        animation = on_other_mesh(out.full, coarse, other, "full face")
    elif inputs.get("head"):
        animation, other = on_head(inputs, out, coarse, face, options)
    if options.live_link:
        write_live_weights(snakemake, coarse, face, fit.valid)
    if options.rig:
        lips = lips_of(face) if other is None else other.lips
        head = other if inputs.get("head") else None
        write_rig(snakemake, options, animation, lips, fit.valid, head)
    animation = add_images(snakemake, animation, face, other, options)
    if inputs.get("placement"):
        placement, origin = Placement.load(inputs.placement), Origin.load(inputs.origin)
        if options.flame:
            write_flame(snakemake, coarse, face, placement, origin)
        animation = in_own_frame(animation, placement, origin, own_polygons=other is None)

    def basis():
        folder = Path(out.corrected).parent  # the system's for temporary files may be memory
        if options.topology == "full":
            return other.basis(shape_basis(coarse, options.tolerance_mm, folder))
        return shape_basis(animation, options.tolerance_mm, folder)

    write_packages({name: out[name] for name in options.formats}, animation, basis)


if __name__ == "__main__":
    begin_job(snakemake.log[0], __file__, snakemake.params.code)
    main(snakemake)
