"""A corrected take with everything that is exported: what the other programs are asked to open."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vermilion.export.albedo_texture import albedo_texture
from vermilion.export.alembic import alembic_is_installed
from vermilion.export.animation import Animation, HeadFrame, NamedShapes
from vermilion.export.full_topology import FullFace
from vermilion.export.head_binding import bind_head
from vermilion.export.head_file import HeadFile
from vermilion.export.head_transfer import HeadTransfer
from vermilion.export.packages import write_packages
from vermilion.export.plates import write_plates
from vermilion.export.shape_basis import shape_basis
from vermilion.faces import procedural
from vermilion.geometry.camera import Camera, look_at
from vermilion.geometry.polygons import Polygons
from vermilion.geometry.raycast import RayCaster
from vermilion.imaging.images import write_srgb8
from vermilion.imaging.undistortion import straight_camera
from vermilion.scan.landmarks import ScanLandmarks

FPS, FIRST, COUNT = 30.0, 1001, 6
WIDTH, HEIGHT = 640, 480


def camera() -> Camera:
    """The plate's: with lens distortion, pixels that are nearly square, principal point off the middle."""
    pose = look_at(np.array([90.0, 30, 640]), np.array([0.0, 0, 40]), np.array([0.0, 1, 0]))
    lens = (1100.0, 1090.0, 331.0, 228.0, -0.08, 0.02, 0.001, -0.001)
    return Camera("cam", "OPENCV", lens, WIDTH, HEIGHT, pose)


def corrected_take() -> tuple[Animation, FullFace]:
    """A person who turns and speaks, with lips that no sum of shapes gives; and the full model."""
    studio, tracker = procedural.studio_model(n_identities=4), procedural.tracker_model(3000, 4)
    identity, rng = np.array([0.8, -0.5, 0.3, 0.1]), np.random.default_rng(7)
    weights = np.zeros((COUNT, tracker.n_expressions))
    weights[:, tracker.expression_names.index("jawOpen")] = np.linspace(0, 0.7, COUNT)
    weights[:, tracker.expression_names.index("mouthSmile_R")] = np.linspace(0.5, 0.1, COUNT)
    steps = np.arange(COUNT)
    turn = Rotation.from_euler("yx", np.stack([3.0 * steps - 6, 1.5 * steps], axis=1), degrees=True)
    place = np.stack([2.0 * steps, -1.0 * steps, 1.5 * steps], axis=1)
    head = HeadFrame(turn.as_matrix(), place)
    neutral = tracker.neutral_of(identity)
    lips = np.exp(-((neutral - neutral[tracker.outer_contour].mean(axis=0)) ** 2).sum(axis=1) / 200)
    wave = np.sin(neutral[:, 0] / 6 + rng.normal(0, 2, COUNT)[:, None])
    local = tracker.vertices(identity, weights)
    local = local + (lips * wave)[:, :, None] * [0.4, 1.2, 0.6]
    world = np.stack([head.to_world(row, mesh) for row, mesh in enumerate(local)])
    shapes = NamedShapes(tracker.expression_names, tracker.expressions_mm, weights)
    animation = Animation(
        FIRST + steps, FPS, world.astype(np.float32), Polygons.of_triangles(tracker.triangles),
        neutral, head, shapes, 1.0, tracker.uv, straight_camera(camera(), square=True),
    )  # fmt: skip
    return animation, FullFace.of(studio, tracker, neutral, identity, shapes)


def own_head(coarse: Animation) -> HeadTransfer:
    """Another person's head of another topology, in centimetres, with quads and a texture seam."""
    studio, tracker = procedural.studio_model(n_identities=4), procedural.tracker_model(3000, 4)
    vertices = 0.1 * studio.neutral_of(np.array([-0.8, 0.5, 0.3, -0.4])) + [5.0, 160.0, 0.0]
    polygons = Polygons.with_quads(studio.triangles)
    seam = np.where(studio.neutral_mm[polygons.corners, 0] < 0, studio.n_vertices, 0)
    uv = np.concatenate([0.5 * studio.uv, 0.5 * studio.uv + 0.5])
    head = HeadFile(vertices, polygons, uv, polygons.corners + seam)
    landmarks = ScanLandmarks(vertices[studio.landmarks], np.zeros(66))
    binding = bind_head(tracker, head, landmarks)
    return HeadTransfer(head, binding, tracker, coarse.neutral_mm, coarse.shapes)


def on_other_mesh(other: FullFace | HeadTransfer, coarse: Animation) -> Animation:
    """The take on another mesh."""
    sequence = np.stack([other.vertices_mm(coarse, row) for row in range(COUNT)])
    return other.animation(coarse, sequence.astype(np.float32))


def silhouette(animation: Animation, row: int, seen: Camera) -> np.ndarray:
    """What of each pixel (h, w) of the camera `seen` the mesh covers, 0 to 1, by 16 rays a pixel."""
    fine = seen.resized(4.0)
    vertices = np.asarray(animation.vertices_mm[row], dtype=np.float64)
    caster = RayCaster(vertices, animation.polygons.triangles)
    hit = caster.cast(*fine.rays(fine.pixel_grid())).hit
    return hit.reshape(HEIGHT, 4, WIDTH, 4).mean(axis=(1, 3))


def write_scene(folder: Path) -> None:
    """Write every format of the take, on the tracker's mesh, the full one and a head of the user, and the truth."""
    coarse, full = corrected_take()
    basis = shape_basis(coarse, 0.02)
    whole = on_other_mesh(full, coarse)
    head = on_other_mesh(own_head(coarse), coarse)
    for name, animation, shapes in (
        ("tracker", coarse, basis),
        ("full", whole, full.basis(basis)),
        ("head", head, shape_basis(head, 0.02)),
    ):
        out = folder / name
        out.mkdir(parents=True)
        np.save(out / "vertices_mm.npy", animation.vertices_mm)
        cut = animation.cut_at_seams()
        colours = np.tile([0.5, 0.32, 0.25], (len(cut.source), 1))
        texture = albedo_texture(colours, cut.uv, cut.polygons.triangles, 256)
        write_srgb8(out / "albedo.png", texture)

        def plate(frame: int, animation: Animation = animation) -> np.ndarray:
            grey = np.rint(255 * silhouette(animation, frame - FIRST, camera())).astype(np.uint8)
            return np.repeat(grey[:, :, None], 3, axis=2)

        write_plates(out / "plate", animation.frames, camera(), plate, ".png")
        packed = replace(animation, albedo="albedo.png", plate="plate/{frame:06d}.png")
        files = {"usd": "corrected.usdc", "usd_shapes": "corrected_shapes.usdc"}
        files |= {"gltf": "corrected.glb", "obj": "obj", "ply": "ply"}
        if alembic_is_installed():
            files["alembic"] = "corrected.abc"
        write_packages(
            {name: out / file for name, file in files.items()}, packed, lambda shapes=shapes: shapes
        )
    seen = coarse.camera
    truth = {
        "fps": FPS, "first": FIRST, "last": FIRST + COUNT - 1, "width": WIDTH, "height": HEIGHT,
        "calibration": seen.calibration.tolist(), "cam_from_world": seen.cam_from_world.tolist(),
    }  # fmt: skip
    (folder / "truth.json").write_text(json.dumps(truth))


if __name__ == "__main__":
    write_scene(Path(sys.argv[1]))
